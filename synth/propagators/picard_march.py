"""Marching collocation through a record, with intervals as short as the motion asks for.

Intervals are handled in strides: forcing for all nodes of a stride by matrix products, then the compiled march. A
stride that iteration or the nodes cannot manage is taken again from its start in intervals half as long.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from data_schemas.errors import RefusedError
from synth.kernels.collocation import NODES, POINTS
from synth.kernels.collocation_weights import continuation, legendre_tail, weights
from synth.kernels.picard import Forcing, Law
from synth.kernels.picard import march as march_intervals
from synth.kicks import Kicks
from synth.phase import Floats
from synth.propagators.blocks import EvenTicks
from synth.propagators.picard_error import Estimate
from synth.propagators.picard_forcing import Grid, Readings, Sums, steady_at

GROUP = 32
"""Intervals in a block of the forcing."""

_BLOCKS = 24  # blocks in a stride at most; forcing and readings of a stride then stay in the processor's cache
_MOST_HALVINGS = 10
_PATIENCE = 8  # strides after which longer intervals are tried again
_STOP = 1e-15  # change of r, relative to the angle, that no longer matters even where angles feel all of it


@dataclass(frozen=True)
class Equations:
    """Pendulums and forcing, as collocation wants them."""

    frequencies: Floats
    damping_rates: Floats
    """(pendulums,) n in rad/s, gamma in 1/s."""
    start: Floats
    """(2, pendulums) y and y'/n at t = 0, rad."""
    horizontal: Sums
    """Steady answers of all pendulums, u, and that part of u which they leave out, if any."""
    vertical: Sums
    """zeta."""
    linear: bool = False
    """Whether the law is linear."""
    kicks: Kicks | None = None
    """Whose step every interval is, or a whole part of it."""

    def shadowed(self) -> Equations:
        """Every pendulum twice."""
        answers = self.horizontal.coefficients
        count = len(self.frequencies)
        horizontal = replace(self.horizontal, coefficients=np.vstack([answers[:count], answers]))
        frequencies, damping_rates = np.tile(self.frequencies, 2), np.tile(self.damping_rates, 2)
        return replace(self, frequencies=frequencies, damping_rates=damping_rates, horizontal=horizontal)


class Swing(NamedTuple):
    """Angles at the next readings."""

    theta: Floats
    """(pendulums, readings) rad."""
    estimated_error: float
    """Of the largest error up to here, relative to the largest angle of the pendulum up to here."""


class _Level:
    """One length of intervals: forcing, weights and readings."""

    def __init__(self, equations: Equations, readings: Readings, shown: int) -> None:
        blocks = min(_BLOCKS, -(-readings.intervals // GROUP))
        self.readings = readings
        self.most = blocks * GROUP
        self.turn = equations.frequencies * float(readings.interval)
        self._pendulums = len(equations.frequencies)
        horizontal, vertical = equations.horizontal, equations.vertical
        same = np.array_equal(horizontal.angular_frequency, vertical.angular_frequency)
        if same and horizontal.combs == vertical.combs:
            merged = replace(horizontal, coefficients=np.vstack([vertical.coefficients, horizontal.coefficients]))
            self._grids = [Grid(merged, readings.interval, GROUP)]
        else:
            self._grids = [Grid(each, readings.interval, GROUP) for each in (vertical, horizontal)]
        self.points = np.empty((self._pendulums, self.most, POINTS))
        self._still = np.zeros((self.most, NODES))
        self._kicks = equations.kicks
        self._answers = horizontal.some(slice(self._pendulums))
        self._frequencies = equations.frequencies
        self.shown = horizontal.some(slice(shown))
        each_pendulum = zip(equations.frequencies.tolist(), equations.damping_rates.tolist(), strict=True)
        sets = [
            weights(Fraction(n) ** 2, 2 * Fraction(gamma), readings.interval, Fraction(n)) for n, gamma in each_pendulum
        ]
        flow, inner, end, propagator, _ = (np.array(column) for column in zip(*sets, strict=True))
        inner = np.ascontiguousarray(inner[:, : NODES * NODES])
        guess = np.array([(continuation().T @ each.reshape(NODES, NODES)).ravel() for each in inner])
        self.law = Law(flow, inner, guess, end, propagator, legendre_tail()[None, :], equations.linear)

    def _impulses(self, first: int, count: int) -> Floats:
        """At the ends of intervals: what stays of y and y'/n, and what is added, (3, pendulums, count)."""
        jumps = np.zeros((3, self._pendulums, count))
        jumps[0] = 1.0
        if self._kicks is not None:
            every = round(self._kicks.step / self.readings.interval)  # intervals to an impulse, exactly
            begin, end = first // every, (first + count) // every
            drawn = self._kicks.changes(begin, end - begin)
            copies = self._pendulums // drawn.shape[1]  # a shadow gets its pendulum's
            last = (np.arange(begin, end) + 1) * every - 1 - first
            jumps[:, :, last] = np.tile(drawn, (1, copies, 1))
            for p, at in np.argwhere(jumps[0] == 0.0):  # theta is set: y is what the steady answer leaves of it
                jumps[1:, p, at] -= self._steady(int(p), float((first + at + 1) * self.readings.interval))
        return jumps

    def _steady(self, p: int, time: float) -> Floats:
        """Steady answer of a pendulum and its slope over n, rad."""
        rate = self._answers.angular_frequency
        turning = self._answers.coefficients[p] * np.exp(1j * rate * time)
        return np.array([turning.sum().real, (1j * rate * turning).sum().real / self._frequencies[p]])

    def forcing(self, first: int, count: int) -> Forcing:
        """What acts in `count` intervals from the `first`."""
        centres = EvenTicks(first + GROUP // 2, GROUP, count // GROUP)
        sums = [grid.evaluate(centres).reshape(-1, count, NODES) for grid in self._grids]
        vertical, horizontal = (sums[0][0], sums[0][1:]) if len(sums) == 1 else (sums[0][0], sums[1])
        rest = horizontal[self._pendulums :]
        drive = rest[1] if len(rest) > 1 else self._still[:count]
        return Forcing(horizontal[: self._pendulums], vertical, rest[0], drive, self._impulses(first, count))


def march(equations: Equations, readings: Sequence[Readings]) -> Iterator[Swing]:
    """Angles of stride after stride.

    The first stride is tried in intervals of several lengths, longest first; later ones halve what it took.

    `RefusedError` if intervals of a thousandth of the planned length are still too long.
    """
    shown = len(equations.frequencies)
    lengths = list(readings)
    levels = [_Level(equations, lengths.pop(0), shown)] if lengths[0].intervals else []
    state = np.zeros((shown, 4))
    state[:, 0], state[:, 2] = equations.start
    remainder = np.zeros((shown, NODES))
    estimate = Estimate(shown)
    depth, calm, patience, done = 0, 0, _PATIENCE, 0
    while levels and done < levels[depth].readings.intervals:
        level = levels[depth]
        count = min(level.most, -(-(level.readings.intervals - done) // GROUP) * GROUP)
        carried, known, tried = state.copy(), remainder.copy(), estimate.copy()
        result = _stride(level, done, count, carried, known, tried)
        if result is not None and tried.is_large and len(state) == shown:
            # The growth of errors must be measured, from the start of this stride on.
            estimate = estimate.shadowed(tried)
            equations = equations.shadowed()
            levels = [_Level(equations, each.readings, shown) for each in levels]
            state, remainder = np.tile(state, (2, 1)), np.tile(remainder, (2, 1))
            estimate.nudge(state)
        elif result is not None:
            state, remainder, estimate = carried, known, tried
            done += count
            yield Swing(result, estimate.relative)
            calm += 1
            if depth and calm >= patience:
                depth, done, calm = depth - 1, done // 2, 0
                remainder = np.zeros_like(remainder)
        elif done == 0 and depth == 0 and lengths:
            levels = [_Level(equations, lengths.pop(0), shown)]
            remainder = np.zeros_like(remainder)
        else:
            if depth == _MOST_HALVINGS:
                interval = float(level.readings.interval)
                raise RefusedError(
                    f"motion: too violent for Picard collocation at t = {done * interval:.6g} s, even in intervals of"
                    f" {interval:.3g} s; choose the explicit method"
                )
            patience = 2 * patience if calm == 0 and depth + 1 < len(levels) else patience
            depth, done, calm = depth + 1, 2 * done, 0
            remainder = np.zeros_like(remainder)
            if depth == len(levels):
                levels.append(_Level(equations, level.readings.halved(), shown))


def _stride(
    level: _Level, first: int, count: int, state: Floats, remainder: Floats, estimate: Estimate
) -> Floats | None:
    """March `count` intervals; state, remainder and estimate move on. Return theta, or none if it went wrong."""
    forcing = level.forcing(first, count)
    peak = np.array([_largest(each) for each in forcing.steady])
    zeta, u, rest = (_largest(each) for each in (forcing.vertical, forcing.horizontal, forcing.drive))
    turn = level.turn
    report = estimate.report()
    report[:, 3] = np.maximum(report[:, 3], state[:, 0] ** 2 + state[:, 2] ** 2)
    angle = np.minimum(peak + np.sqrt(report[:, 3]), np.pi)
    contraction = float(np.max(turn**2 / 4 * (zeta + angle**2 / 2 + u * angle)))
    points = level.points[:, :count]
    floor = (peak + np.minimum(turn, turn**2) * rest) ** 2
    stop = min(max(_STOP / max(contraction, 1e-3), 10 * _STOP), 100 * _STOP)
    marched = march_intervals(state, remainder, forcing, level.law, floor, stop, points, report)
    if marched < count or not np.isfinite(state).all():
        return None
    estimate.add(report, peak, turn, points)
    if not estimate.is_resolved:
        return None
    portion = level.readings.portion(first, count)
    theta = steady_at(level.readings.times, level.shown, portion)
    level.readings.read(points[: len(theta)], first, theta)
    return theta


def _largest(values: Floats) -> float:
    return max(float(values.max()), -float(values.min()))
