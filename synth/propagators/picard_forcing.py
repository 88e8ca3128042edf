"""Sums of harmonics where collocation wants them: at the nodes of intervals and at readings, and where those lie.

Many intervals make one block of moments that lie evenly about its centre, so that the even and the odd part of
all sums are two matrix products (see `blocks`): sines only for the edges of the table, and exact phases however
late the block. Those of a long table come by Fourier transform (see `periodic`). Even readings repeat a short pattern
among intervals, uneven ones are looked up.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from synth.kernels.collocation_weights import FINE, gauss_nodes, interpolation
from synth.kernels.picard import read
from synth.motion.harmonic_sum import Comb
from synth.phase import Floats, Integers, Phasors, rational_turns, turns
from synth.propagators.blocks import FEWEST_ROWS, ONE_THREAD, EvenTicks, PeriodicSums, halves
from synth.propagators.times import UnevenTimes

_MOST_STEPS = 4096  # in an interval: bounds the table of weights
_MOST_HALF_BLOCK = 64  # readings in half a block of the steady part

Evaluator = Callable[[slice], Floats]
"""Sums (sums, readings) at some readings, by their number."""


@dataclass(frozen=True)
class Sums:
    """Several sums over the same harmonics."""

    angular_frequency: Floats
    """(harmonics,) rad/s"""
    coefficients: Phasors
    """(sums, harmonics)."""
    combs: tuple[Comb, ...] = ()
    """The last harmonics, if they are many multiples of one frequency."""

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
        self._result = np.empty((len(sums.coefficients) * most, 2 * half))
        rows = max(FEWEST_ROWS, ONE_THREAD // max(table.size, 1))
        self._parts = np.empty((2, min(rows, len(self._result)), half))
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
        result = self._result[: len(weights)]
        halves((real, self._even), (imaginary, self._odd), result, self._parts)
        for transform, turn, within in self._combs:
            places = turn.wrapped(centres.index).T + within
            result += transform.at(places.ravel()).reshape(result.shape)
        return result.reshape(len(self._coefficients), -1)


def node_grid(sums: Sums, interval: Fraction, group: int, most: int) -> Grid:
    """Nodes of `group` intervals a block, an even number; centres count in intervals."""
    starts = (2 * np.arange(group // 2, dtype=np.int64) + 1) * FINE
    return Grid(sums, interval, interval / (2 * FINE), starts, gauss_nodes(), most)


@dataclass(frozen=True)
class EvenReadings:
    """Readings 0, step, 2 step ... among intervals of steps/parts steps."""

    step: Fraction
    """s"""
    count: int
    steps: int
    parts: int
    """An interval is `steps` steps long, divided by `parts`."""

    @classmethod
    def among(cls, step: Fraction, count: int, longest: float) -> EvenReadings:
        """Choose the longest intervals, at most `longest` seconds, that fit the step."""
        steps = min(max(1, math.floor(longest / step)), _MOST_STEPS)
        return cls(step, count, steps, math.ceil(step * steps / Fraction(longest)))

    @property
    def intervals(self) -> int:
        """How many intervals hold all readings."""
        return (self.count - 1) * self.parts // self.steps + 1 if self.count else 0

    @property
    def interval(self) -> Fraction:
        """Length of an interval, s."""
        return self.step * self.steps / self.parts

    def halved(self) -> EvenReadings:
        """The same readings among intervals half as long."""
        common = math.gcd(self.steps, 2 * self.parts)
        return EvenReadings(self.step, self.count, self.steps // common, 2 * self.parts // common)

    @cached_property
    def _table(self) -> Floats:
        return interpolation(np.arange(self.steps) / self.steps)

    def portion(self, first: int, count: int) -> slice:
        """Readings within `count` intervals from the `first`."""
        begin, end = (min(-(-edge * self.steps // self.parts), self.count) for edge in (first, first + count))
        return slice(begin, end)

    def read(self, points: Floats, first: int, result: Floats) -> None:
        """Add y at readings, from its points in intervals from the `first`, to the result (pendulums, readings)."""
        count = result.shape[1]
        if self.parts == 1:  # all intervals are read at the same places
            for values, each in zip(result, points, strict=True):
                values += (each @ self._table.T).reshape(-1)[:count]
            return
        edges = -(-np.arange(first, first + points.shape[1] + 1, dtype=np.int64) * self.steps // self.parts)
        index = np.arange(edges[0], edges[0] + count, dtype=np.int64)
        begin = np.minimum(edges - edges[0], count)
        read(points, begin, index * self.parts % self.steps, self._table, result)

    def steady(self, sums: Sums, most: int) -> Evaluator:
        """Sums at the readings of portions of at most `most` intervals, in blocks of twice `half` readings.

        Centres lie between two readings and count in half steps.
        """
        readings = min(self.count, most * self.steps // self.parts + 1)
        half = min(_MOST_HALF_BLOCK, max(1, math.isqrt(readings // 4)))
        places = 2 * np.arange(half, dtype=np.int64) + 1
        step, blocks = self.step / 2, -(-readings // (2 * half))
        grid = Grid(sums, step, step, np.zeros(1, dtype=np.int64), places, blocks)

        def evaluate(portion: slice) -> Floats:
            count = portion.stop - portion.start
            centres = EvenTicks(2 * portion.start + 2 * half - 1, 4 * half, -(-count // (2 * half)))
            return grid.evaluate(centres)[:, :count].copy()

        return evaluate


@dataclass(frozen=True)
class UnevenReadings:
    """Readings at increasing times of a chronometer, not negative."""

    seconds: Floats
    """(readings,)."""
    scale: Fraction
    """True time over the chronometer's."""
    length: float
    """Length of an interval in the chronometer's seconds: a power of two, so that intervals begin at exact times."""

    @classmethod
    def among(cls, seconds: Floats, scale: Fraction, longest: float) -> UnevenReadings:
        """Choose the longest intervals of at most `longest` seconds of true time."""
        return cls(seconds, scale, math.ldexp(1.0, math.frexp(longest / float(scale))[1] - 1))

    @property
    def intervals(self) -> int:
        """How many intervals hold all readings."""
        return int(self._number[-1]) + 1 if self.seconds.size else 0

    @property
    def interval(self) -> Fraction:
        """Length of an interval, s."""
        return Fraction(self.length) * self.scale

    def halved(self) -> UnevenReadings:
        """The same readings among intervals half as long."""
        return UnevenReadings(self.seconds, self.scale, self.length / 2)

    @cached_property
    def _number(self) -> Integers:
        return np.floor(self.seconds / self.length).astype(np.int64)

    def portion(self, first: int, count: int) -> slice:
        """Readings within `count` intervals from the `first`."""
        begin, end = np.searchsorted(self._number, [first, first + count]).tolist()
        return slice(begin, end)

    def read(self, points: Floats, first: int, result: Floats) -> None:
        """Add y at readings, from its points in intervals from the `first`, to the result (pendulums, readings)."""
        edges = np.searchsorted(self._number, np.arange(first, first + points.shape[1] + 1))
        index = slice(int(edges[0]), int(edges[-1]))
        place = self.seconds[index] / self.length - self._number[index]
        read(points, edges - edges[0], np.arange(place.size), interpolation(place), result)

    def steady(self, sums: Sums, most: int) -> Evaluator:
        """Sums at the readings of portions of any length."""

        def evaluate(portion: slice) -> Floats:
            if portion.start == portion.stop:
                return np.zeros((len(sums.coefficients), 0))
            times = UnevenTimes(self.seconds[portion], self.scale)
            series = times.series(sums.angular_frequency[: sums.alone], sums.coefficients[:, : sums.alone])
            result = np.ascontiguousarray(series)
            for each in sums.transforms:
                result += each.at(times.places(each.period))
            return result

        return evaluate
