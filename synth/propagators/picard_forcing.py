"""Sums of harmonics where collocation wants them: at the nodes of intervals and at even readings.

Many intervals make one block of moments that lie evenly about its centre, so that the even and the odd part of
all sums are two matrix products (see `products`): sines only for the edges of the table, and exact phases however
late the block. Those of a long table come by Fourier transform (see `periodic`).
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from synth.motion.harmonic_sum import Comb
from synth.phase import Floats, Integers, Phasors, rational_turns, turns
from synth.propagators.blocks import EvenTicks
from synth.propagators.periodic import PeriodicSums
from synth.propagators.picard_nodes import FINE, gauss_nodes

_ONE_THREAD = 1 << 18  # multiplications up to which OpenBLAS keeps to one thread
_FEWEST_ROWS = 8


@dataclass(frozen=True)
class Sums:
    """Several sums over the same harmonics.

    Attributes
    ----------
    angular_frequency : (harmonics,) float64
        rad/s
    coefficients : (sums, harmonics) complex128
    combs : tuple of Comb
        The last harmonics, if they are many multiples of one frequency.
    """

    angular_frequency: Floats
    coefficients: Phasors
    combs: tuple[Comb, ...] = ()

    def some(self, which: slice) -> Sums:
        """Some of the sums."""
        return Sums(self.angular_frequency, self.coefficients[which], self.combs)

    @property
    def alone(self) -> int:
        """How many harmonics, the first ones, belong to no comb."""
        return self.combs[0].first if self.combs else self.angular_frequency.size

    @cached_property
    def transforms(self) -> tuple[PeriodicSums, ...]:
        """All sums over every comb."""
        return tuple(comb.sums(*self.coefficients) for comb in self.combs)


class Grid:
    """Evaluates sums in blocks of the same moments about centres that are whole multiples of a step.

    Parameters
    ----------
    sums
        What to evaluate.
    step, fine_step
        Units of centres and of reaches, s; exact.
    starts, places : (groups,), (moments,) int64
        Moments of a block after its centre: every start plus every place, in that order increasing; in fine steps.
    most : int
        Most centres asked for at once: the work space for them is kept, for fresh memory costs as much as the sums.
    """

    def __init__(
        self, sums: Sums, step: Fraction, fine_step: Fraction, starts: Integers, places: Integers, most: int
    ) -> None:
        frequencies = sums.angular_frequency[: sums.alone].tolist()
        self._coefficients = sums.coefficients[:, : sums.alone]
        self._rate = turns(frequencies, step)
        fine = turns(frequencies, fine_step)
        half = starts.size * places.size
        table = (fine.phasors(starts)[:, :, None] * fine.phasors(places)[:, None, :]).reshape(len(frequencies), half)
        self._even, self._odd = np.ascontiguousarray(table.real), np.ascontiguousarray(table.imag)
        self._rows = max(_FEWEST_ROWS, _ONE_THREAD // max(table.size, 1))
        self._result = np.empty((len(sums.coefficients) * most, 2 * half))
        self._parts = np.empty((2, min(self._rows, len(self._result)), half))
        reaches = (starts[:, None] + places).ravel()
        both = np.concatenate([-reaches[::-1], reaches])
        self._combs = [
            (each, rational_turns(step / each.period), rational_turns(fine_step / each.period).wrapped(both))
            for each in sums.transforms
        ]

    def evaluate(self, centres: EvenTicks) -> Floats:
        """Real parts of the sums, (sums, centres * moments), in order of time; valid until the next call.

        A harmonic Re(U exp(i w (t_b + tau))) has an even part in tau, Re(U_b) cos(w tau), and an odd part,
        -Im(U_b) sin(w tau).
        """
        head = centres.phasors(self._rate)
        weights = (self._coefficients[:, None, :] * head.T).reshape(len(self._coefficients) * centres.count, len(head))
        real, imaginary = np.ascontiguousarray(weights.real), np.ascontiguousarray(weights.imag)
        half = self._even.shape[1]
        result = self._result[: len(weights)]
        for begin in range(0, len(weights), self._rows):
            strip = slice(begin, begin + self._rows)
            after, before = result[strip, half:], result[strip, half - 1 :: -1]
            even, odd = self._parts[:, : len(after)]
            np.matmul(real[strip], self._even, out=even)
            np.matmul(imaginary[strip], self._odd, out=odd)
            np.subtract(even, odd, out=after)
            np.add(even, odd, out=before)
        for transform, turn, within in self._combs:
            places = turn.wrapped(centres.index).T + within
            result += transform.at(places.ravel()).reshape(result.shape)
        return result.reshape(len(self._coefficients), -1)


def node_grid(sums: Sums, interval: Fraction, group: int, most: int) -> Grid:
    """Nodes of `group` intervals a block, an even number; centres count in intervals."""
    starts = (2 * np.arange(group // 2, dtype=np.int64) + 1) * FINE
    return Grid(sums, interval, interval / (2 * FINE), starts, gauss_nodes(), most)


def reading_grid(sums: Sums, step: Fraction, half: int, most: int) -> Grid:
    """Even readings, 2 * half a block; centres lie between two readings and count in half steps."""
    places = 2 * np.arange(half, dtype=np.int64) + 1
    return Grid(sums, step / 2, step / 2, np.zeros(1, dtype=np.int64), places, most)
