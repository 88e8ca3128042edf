"""Where readings lie among intervals: even ones repeat a short pattern, uneven ones are looked up."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from synth.kernels.collocation import read
from synth.phase import Floats, Integers
from synth.propagators.blocks import EvenTicks
from synth.propagators.picard_forcing import Grid, Sums, reading_grid
from synth.propagators.picard_nodes import interpolation
from synth.propagators.times import UnevenTimes

_MOST_STEPS = 4096  # in an interval: bounds the table of weights
_MOST_HALF_BLOCK = 64  # readings in half a block of the steady part


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

    def __call__(self, portion: slice) -> Floats:
        """Values (sums, readings)."""
        count = portion.stop - portion.start
        first = 2 * portion.start + 2 * self.half - 1
        centres = EvenTicks(first, 4 * self.half, -(-count // (2 * self.half)))
        return self.grid.evaluate(centres)[:, :count].copy()


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

    def __call__(self, portion: slice) -> Floats:
        """Values (sums, readings)."""
        if portion.start == portion.stop:
            return np.zeros((len(self.sums.coefficients), 0))
        times = UnevenTimes(self.seconds[portion], self.scale)
        alone = self.sums.alone
        series = times.series(self.sums.angular_frequency[:alone], self.sums.coefficients[:, :alone])
        result = np.ascontiguousarray(series)
        for each in self.sums.transforms:
            result += each.at(times.places(each.period))
        return result
