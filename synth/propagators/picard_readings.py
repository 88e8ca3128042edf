"""Where readings lie among intervals: even ones repeat a short pattern, uneven ones are looked up."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from synth.kernels.collocation import read
from synth.phase import Floats, Integers
from synth.propagators.picard_forcing import Grid, Sums, reading_grid
from synth.propagators.picard_weights import interpolation
from synth.propagators.uneven import UnevenTimes

_MOST_HALF_BLOCK = 64  # readings in half a block of the steady part


@dataclass(frozen=True)
class Portion:
    """Readings within consecutive intervals.

    Attributes
    ----------
    index : (readings,) int64
        Which readings.
    begin : (intervals + 1,) int64
        First reading of each interval, counted from the first of the portion.
    row : (readings,) int64
        Row of the table for each.
    table : (rows, POINTS) float64
        As `picard_weights.interpolation`.
    """

    index: Integers
    begin: Integers
    row: Integers
    table: Floats


@dataclass(frozen=True)
class EvenReadings:
    """Readings 0, step, 2 step ... among intervals of steps/parts steps.

    Attributes
    ----------
    step : Fraction
        s
    count : int
    steps, parts : int
        An interval is `steps` steps long, divided by `parts`.
    """

    step: Fraction
    count: int
    steps: int
    parts: int

    @classmethod
    def among(cls, step: Fraction, count: int, longest: float) -> EvenReadings:
        """Choose the longest intervals, at most `longest` seconds, that fit the step."""
        steps = max(1, math.floor(longest / step))
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

    def portion(self, first: int, count: int) -> Portion:
        """Readings within `count` intervals from the `first`."""
        edges = -(-np.arange(first, first + count + 1, dtype=np.int64) * self.steps // self.parts)
        edges = np.minimum(edges, self.count)
        index = np.arange(edges[0], edges[-1], dtype=np.int64)
        return Portion(index, edges - edges[0], index * self.parts % self.steps, self._table)

    def read(self, points: Floats, portion: Portion, result: Floats) -> None:
        """Add y at the readings of a portion, from its points, to the result (pendulums, readings)."""
        if self.parts > 1:
            read(points, portion.begin, portion.row, portion.table, result)
            return
        count = portion.index.size
        for values, each in zip(result, points, strict=True):
            values += (each @ portion.table.T).reshape(-1)[:count]

    def steady(self, sums: Sums, most: int) -> EvenSums:
        """Evaluator of sums at the readings of portions of at most `most` intervals."""
        readings = min(self.count, most * self.steps // self.parts + 1)
        half = min(_MOST_HALF_BLOCK, max(1, math.isqrt(readings // 4)))
        blocks = -(-readings // (2 * half))
        return EvenSums(reading_grid(sums, self.step, half, blocks), half)


@dataclass(frozen=True)
class EvenSums:
    """Sums of harmonics at even readings, in blocks of twice `half`."""

    grid: Grid
    half: int

    def __call__(self, portion: Portion) -> Floats:
        """Values (sums, readings)."""
        count = portion.index.size
        block = np.arange(-(-count // (2 * self.half)), dtype=np.int64)
        first = 2 * portion.index[:1].sum() + 2 * self.half - 1
        return self.grid.evaluate(first + 4 * self.half * block)[:, :count].copy()


@dataclass(frozen=True)
class UnevenReadings:
    """Readings at increasing times of a chronometer, not negative.

    Attributes
    ----------
    seconds : (readings,) float64
    scale : Fraction
        True time over the chronometer's.
    length : float
        Length of an interval in the chronometer's seconds: a power of two, so that intervals begin at exact times.
    """

    seconds: Floats
    scale: Fraction
    length: float

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

    def portion(self, first: int, count: int) -> Portion:
        """Readings within `count` intervals from the `first`."""
        edges = np.searchsorted(self._number, np.arange(first, first + count + 1))
        index = np.arange(edges[0], edges[-1], dtype=np.int64)
        place = self.seconds[index] / self.length - self._number[index]
        return Portion(index, edges - edges[0], index - edges[0], interpolation(place))

    def read(self, points: Floats, portion: Portion, result: Floats) -> None:
        """Add y at the readings of a portion, from its points, to the result (pendulums, readings)."""
        read(points, portion.begin, portion.row, portion.table, result)

    def steady(self, sums: Sums, most: int) -> UnevenSums:
        """Evaluator of sums at the readings of portions."""
        del most  # nothing to prepare
        return UnevenSums(sums, self.seconds, self.scale)


@dataclass(frozen=True)
class UnevenSums:
    """Sums of harmonics at uneven readings."""

    sums: Sums
    seconds: Floats
    scale: Fraction

    def __call__(self, portion: Portion) -> Floats:
        """Values (sums, readings)."""
        times = UnevenTimes(self.seconds[portion.index], self.scale)
        return np.ascontiguousarray(times.series(self.sums.angular_frequency, self.sums.coefficients))
