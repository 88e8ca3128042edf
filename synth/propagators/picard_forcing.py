"""Sums of harmonics where collocation wants them: at the nodes of intervals and at readings, and where those lie.

Many intervals make one block of moments that lie evenly about its centre, so that the even and the odd part of
all sums are two matrix products (see `blocks`): sines only for the edges of the table, and exact phases however
late the block. Those of a long table come by Fourier transform (see `blocks`). Even readings repeat a short pattern
among intervals, uneven ones are looked up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from synth.kernels.collocation_weights import FINE, gauss_nodes, interpolation
from synth.motion.harmonic_sum import Comb
from synth.phase import Floats, Integers, Phasors, rational_turns, turns
from synth.propagators.blocks import EvenTicks, PeriodicSums, product
from synth.propagators.times import EvenTimes, UnevenTimes

_MOST_STEPS = 4096  # in an interval: bounds the table of weights


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
    """Evaluates sums at the nodes of intervals, in blocks of so many about centres that count in intervals.

    Parameters
    ----------
    sums
        What to evaluate.
    interval
        s; exact.
    group : int
        Intervals of a block, even.
    """

    def __init__(self, sums: Sums, interval: Fraction, group: int) -> None:
        fine_step, nodes = interval / (2 * FINE), gauss_nodes()
        starts = (2 * np.arange(group // 2, dtype=np.int64) + 1) * FINE  # middles of intervals after the centre
        frequencies = sums.angular_frequency[: sums.alone].tolist()
        self._coefficients = sums.coefficients[:, : sums.alone]
        self._rate = turns(frequencies, interval)
        fine = turns(frequencies, fine_step)
        half = starts.size * nodes.size
        table = (fine.phasors(starts)[:, :, None] * fine.phasors(nodes)[:, None, :]).reshape(len(frequencies), half)
        self._even, self._odd = np.ascontiguousarray(table.real), np.ascontiguousarray(table.imag)
        reaches = (starts[:, None] + nodes).ravel()
        both = np.concatenate([-reaches[::-1], reaches])
        self._combs = [
            (each, rational_turns(interval / each.period), rational_turns(fine_step / each.period).wrapped(both))
            for each in sums.transforms
        ]

    def evaluate(self, centres: EvenTicks) -> Floats:
        """Real parts of the sums, (sums, centres * moments), in order of time.

        A harmonic Re(U exp(i w (t_b + tau))) has an even part in tau, Re(U_b) cos(w tau), and an odd part,
        -Im(U_b) sin(w tau).
        """
        head = centres.phasors(self._rate)
        weights = (self._coefficients.T[:, :, None] * head[:, None, :]).reshape(len(head), -1)
        result = np.empty((weights.shape[1], 2 * self._even.shape[1]))
        product([(weights.real, self._even)], [(weights.imag, self._odd)], result)
        for transform, turn, within in self._combs:
            places = turn.wrapped(centres.index).T + within
            result += transform.at(places.ravel()).reshape(result.shape)
        return result.reshape(len(self._coefficients), -1)


def steady_at(times: EvenTimes | UnevenTimes, sums: Sums, portion: slice) -> Floats:
    """Sums at some of the moments, by their number, (sums, moments)."""
    if portion.start == portion.stop:
        return np.zeros((len(sums.coefficients), 0))
    some = times.stretch(portion.start, portion.stop)
    series = some.series(sums.angular_frequency[: sums.alone], sums.coefficients[:, : sums.alone])
    result = np.ascontiguousarray(series)
    for each in sums.transforms:
        result += each.at(some.places(each.period))
    return result


@dataclass(frozen=True)
class EvenReadings:
    """Readings 0, step, 2 step ... among intervals of steps/parts steps."""

    times: EvenTimes
    steps: int
    parts: int
    """An interval is `steps` steps long, divided by `parts`."""

    @classmethod
    def among(cls, times: EvenTimes, longest: float) -> EvenReadings:
        """Choose the longest intervals, at most `longest` seconds, that fit the step."""
        steps = min(max(1, math.floor(longest / times.step)), _MOST_STEPS)
        return cls(times, steps, math.ceil(times.step * steps / Fraction(longest)))

    @property
    def intervals(self) -> int:
        """How many intervals hold all readings."""
        return (self.times.count - 1) * self.parts // self.steps + 1 if self.times.count else 0

    @property
    def interval(self) -> Fraction:
        """Length of an interval, s."""
        return self.times.step * self.steps / self.parts

    def halved(self) -> EvenReadings:
        """The same readings among intervals half as long."""
        return EvenReadings(self.times, *Fraction(self.steps, 2 * self.parts).as_integer_ratio())

    @cached_property
    def _table(self) -> Floats:
        return interpolation(np.arange(self.steps) / self.steps)

    def portion(self, first: int, count: int) -> slice:
        """Readings within `count` intervals from the `first`."""
        begin, end = (min(-(-edge * self.steps // self.parts), self.times.count) for edge in (first, first + count))
        return slice(begin, end)

    def read(self, points: Floats, first: int, result: Floats) -> None:
        """Add y at readings, from its points in intervals from the `first`, to the result (pendulums, readings)."""
        count = result.shape[1]
        if self.parts == 1:  # all intervals are read at the same places
            for values, each in zip(result, points, strict=True):
                values += (each @ self._table.T).reshape(-1)[:count]
            return
        begin = self.portion(first, 1).start
        number, place = np.divmod(np.arange(begin, begin + count, dtype=np.int64) * self.parts, self.steps)
        _read(points, number - first, self._table[place], result)


@dataclass(frozen=True)
class UnevenReadings:
    """Readings at increasing times of a chronometer, not negative."""

    times: UnevenTimes
    length: float
    """Length of an interval in the chronometer's seconds: a power of two, so that intervals begin at exact times."""

    @classmethod
    def among(cls, times: UnevenTimes, longest: float) -> UnevenReadings:
        """Choose the longest intervals of at most `longest` seconds of true time."""
        return cls(times, math.ldexp(1.0, math.frexp(longest / float(times.scale))[1] - 1))

    @property
    def intervals(self) -> int:
        """How many intervals hold all readings."""
        return int(self._number[-1]) + 1 if self.times.count else 0

    @property
    def interval(self) -> Fraction:
        """Length of an interval, s."""
        return Fraction(self.length) * self.times.scale

    def halved(self) -> UnevenReadings:
        """The same readings among intervals half as long."""
        return UnevenReadings(self.times, self.length / 2)

    @cached_property
    def _number(self) -> Integers:
        return np.floor(self.times.seconds / self.length).astype(np.int64)

    def portion(self, first: int, count: int) -> slice:
        """Readings within `count` intervals from the `first`."""
        begin, end = np.searchsorted(self._number, [first, first + count]).tolist()
        return slice(begin, end)

    def read(self, points: Floats, first: int, result: Floats) -> None:
        """Add y at readings, from its points in intervals from the `first`, to the result (pendulums, readings)."""
        index = self.portion(first, points.shape[1])
        number = self._number[index]
        place = self.times.seconds[index] / self.length - number
        _read(points, number - first, interpolation(place), result)


def _read(points: Floats, number: Integers, rows: Floats, result: Floats) -> None:
    """Add y in intervals of these numbers, by rows of weights (readings, POINTS)."""
    for values, each in zip(result, points, strict=True):
        values += np.einsum("ij,ij->i", each[number], rows)
