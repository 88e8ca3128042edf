"""Intervals of collocation: sums of harmonics at their nodes and at readings, where those lie, and the weights.

Many intervals make one block of moments (see `blocks`); a long table comes by Fourier transform. Even readings repeat a
short pattern among intervals, uneven ones are looked up.
"""

import math
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from synth.kernels import collocation as core
from synth.kernels.collocation import FINE, NODES, POINTS
from synth.kernels.picard import Forcing, Law
from synth.motion.harmonic_sum import Sums
from synth.phase import Floats, Integers, rational_turns, turns
from synth.propagators.blocks import Ticks, product
from synth.propagators.times import EvenTimes, UnevenTimes

if TYPE_CHECKING:
    from synth.propagators.picard import PicardPlan

_MOST_STEPS = 4096  # in an interval: bounds the table of weights
GROUP = 32  # intervals in a block of the forcing
_BLOCKS = 24  # blocks in a stride at most; forcing and readings of a stride then stay in the processor's cache


class Grid:
    """Evaluates sums at the nodes of intervals (s, exact), in blocks of an even `group` about centres in whole ones."""

    def __init__(self, sums: Sums, interval: Fraction, group: int) -> None:
        fine_step, nodes = interval / (2 * FINE), core.gauss_nodes()
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

    def evaluate(self, centres: Ticks) -> Floats:
        """Real parts of the sums, (sums, centres * moments), in order: Re(U_b) cos(w tau) - Im(U_b) sin(w tau)."""
        head = centres.phasors(self._rate)
        rows = len(self._coefficients) * centres.index.size
        weights = (self._coefficients.T[:, :, None] * head[:, None, :]).reshape(len(head), rows)
        result = np.empty((rows, 2 * self._even.shape[1]))
        product([(weights.real, self._even)], [(weights.imag, self._odd)], result)
        for transform, turn, within in self._combs:
            places = turn.wrapped(centres.index).T + within
            result += transform.at(places.ravel()).reshape(result.shape)
        return result.reshape(len(self._coefficients), -1)


@dataclass(frozen=True)
class Readings:
    """Readings in order of time, none before t = 0, among intervals of one length."""

    times: EvenTimes | UnevenTimes
    length: Fraction
    """Of an interval in steps, or in the chronometer's seconds: then a power of two, so that intervals begin at exact
    times."""

    @classmethod
    def among(cls, times: EvenTimes | UnevenTimes, longest: float) -> "Readings":
        """Choose the longest intervals, at most `longest` seconds of true time, that fit the readings."""
        if isinstance(times, UnevenTimes):
            return cls(times, Fraction(math.ldexp(1.0, math.frexp(longest / float(times.scale))[1] - 1)))
        steps = min(max(1, math.floor(longest / times.step)), _MOST_STEPS)
        return cls(times, Fraction(steps, math.ceil(times.step * steps / Fraction(longest))))

    @property
    def interval(self) -> Fraction:
        """Length of an interval, s."""
        return self.length * (self.times.step if isinstance(self.times, EvenTimes) else self.times.scale)

    @property
    def intervals(self) -> int:
        """How many intervals hold all readings."""
        return int(self._weights(slice(self.times.count - 1, self.times.count))[0][0]) + 1 if self.times.count else 0

    def halved(self) -> "Readings":
        """The same readings among intervals half as long."""
        return Readings(self.times, self.length / 2)

    def _weights(self, some: slice) -> tuple[Integers, Floats]:
        """The interval of each reading, and the weights of its points, (readings, POINTS)."""
        if isinstance(self.times, UnevenTimes):
            turns = self.times.seconds[some] / float(self.length)
            number = np.floor(turns).astype(np.int64)
            return number, core.interpolation(turns - number)
        index = np.arange(some.start, some.stop, dtype=np.int64) * self.length.denominator
        number, place = np.divmod(index, self.length.numerator)
        return number, self._table[place]

    @cached_property
    def _table(self) -> Floats:
        return core.interpolation(np.arange(self.length.numerator) / self.length.numerator)

    def portion(self, first: int, count: int) -> slice:
        """Readings within `count` intervals from the `first`."""
        edges = [first * self.length, (first + count) * self.length]
        if isinstance(self.times, UnevenTimes):
            return slice(*np.searchsorted(self.times.seconds, [float(edge) for edge in edges]).tolist())
        return slice(*(min(math.ceil(edge), self.times.count) for edge in edges))

    def read(self, points: Floats, first: int, result: Floats) -> None:
        """Add y at readings, from its points in intervals from the `first`, to the result (pendulums, readings)."""
        if isinstance(self.times, EvenTimes) and self.length.denominator == 1:  # the same places in all
            for values, each in zip(result, points, strict=True):
                values += (each @ self._table.T).reshape(-1)[: result.shape[1]]
            return
        number, rows = self._weights(self.portion(first, points.shape[1]))
        for values, each in zip(result, points, strict=True):
            values += np.einsum("ij,ij->i", each[number - first], rows)


class Level:
    """One length of intervals: forcing, weights and readings of a plan."""

    def __init__(self, plan: "PicardPlan", readings: Readings) -> None:
        blocks = min(_BLOCKS, -(-readings.intervals // GROUP))
        self.readings = readings
        self.most = blocks * GROUP
        self.turn = plan.frequencies * float(readings.interval)
        self._pendulums = len(plan.frequencies)
        horizontal, vertical = plan.sums
        same = np.array_equal(horizontal.angular_frequency, vertical.angular_frequency)
        if same and horizontal.combs == vertical.combs:
            merged = replace(horizontal, coefficients=np.vstack([vertical.coefficients, horizontal.coefficients]))
            self._grids = [Grid(merged, readings.interval, GROUP)]
        else:
            self._grids = [Grid(each, readings.interval, GROUP) for each in (vertical, horizontal)]
        self.points = np.empty((self._pendulums, self.most, POINTS))
        self.room = np.empty((4, self._pendulums, NODES))
        self._still = np.zeros((self.most, NODES))
        self._plan = plan
        own = [[Fraction(each) for each in values.tolist()] for values in (plan.frequencies, plan.damping_rates)]
        sets = [core.weights(n**2, 2 * gamma, readings.interval, n) for n, gamma in zip(*own, strict=True)]
        flow, inner, end, propagator, _ = (np.array(column) for column in zip(*sets, strict=True))
        inner = np.ascontiguousarray(inner[:, : NODES * NODES])
        guess = np.array([(core.continuation().T @ each.reshape(NODES, NODES)).ravel() for each in inner])
        self.law = Law(flow, inner, guess, end, propagator, core.legendre_tail()[None, :], plan.linear)

    def _impulses(self, first: int, count: int) -> Floats:
        """At the ends of intervals: what stays of y and y'/n, and what is added, (3, pendulums, count)."""
        jumps = np.zeros((3, self._pendulums, count))
        jumps[0] = 1.0
        kicks = self._plan.kicks
        if kicks is not None:
            every = round(kicks.step / self.readings.interval)  # intervals to an impulse, exactly
            begin, end = first // every, (first + count) // every
            drawn = kicks.changes(begin, end - begin)
            copies = self._pendulums // drawn.shape[1]  # a shadow gets its pendulum's
            last = (np.arange(begin, end) + 1) * every - 1 - first
            jumps[:, :, last] = np.tile(drawn, (1, copies, 1))
            rate, steady = self._plan.steady.angular_frequency, self._plan.steady.coefficients
            for p, at in np.argwhere(jumps[0] == 0.0):  # theta is set: y is what the steady answer leaves of it
                turning = steady[p] * np.exp(1j * rate * float((first + at + 1) * self.readings.interval))
                slope = (1j * rate * turning).sum().real / self._plan.frequencies[p]
                jumps[1:, p, at] -= turning.sum().real, slope
        return jumps

    def forcing(self, first: int, count: int) -> Forcing:
        """What acts in `count` intervals from the `first`."""
        centres = Ticks.even(first + GROUP // 2, GROUP, count // GROUP)
        sums = [grid.evaluate(centres).reshape(-1, count, NODES) for grid in self._grids]
        vertical, horizontal = (sums[0][0], sums[0][1:]) if len(sums) == 1 else (sums[0][0], sums[1])
        rest = horizontal[self._pendulums :]
        drive = rest[1] if len(rest) > 1 else self._still[:count]
        return Forcing(horizontal[: self._pendulums], vertical, rest[0], drive, self._impulses(first, count))
