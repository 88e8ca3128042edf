r"""Pendulums with the full sine and cosine on a support that moves as sums of harmonics.

    theta'' + 2 gamma theta' = -n^2 [(1 + zeta) sin theta + u cos theta],   u = x''/g, zeta = z''/g

Exponential Picard collocation: theta = psi + y, where psi is the steady linear answer to the harmonics of u that lie
away from n, in closed form, and u_near stands for the others. What is left is small,

    y'' + 2 gamma y' + n^2 y = n^2 r,   r = (theta - sin theta) - zeta sin theta + u (1 - cos theta) - u_near

and is solved interval by interval: r is the polynomial through its values at Gauss nodes, its answer under the exact
linear flow is a product with fixed weights, and nodes and answer are iterated until they agree. A term that depends
on theta' (a further damping) would be one more summand of r, with the angular velocity at the nodes from the same
weights (`kernels.collocation_weights`).

Nothing but the state (y, y'/n) passes from interval to interval, with a propagator and a state of two doubles each;
phases come from whole numbers. Hence 1e-15 to 1e-14 of the largest angle in an hour.

Intervals are handled in strides: forcing for all nodes of a stride by matrix products, then the compiled kernel. A
stride that iteration or the nodes cannot manage is taken again from its start in intervals half as long.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from data_schemas.errors import RefusedError
from synth.disturbances import Kicks
from synth.kernels.collocation import NODES, POINTS
from synth.kernels.collocation_weights import continuation, legendre_tail, weights
from synth.kernels.picard import Forcing, Law, march
from synth.motion.harmonic_sum import HarmonicSum, Sums
from synth.pendulums.linear import NEAR_RESONANT_BAND
from synth.phase import Floats
from synth.propagators.blocks import Ticks
from synth.propagators.picard_error import Estimate
from synth.propagators.picard_forcing import Grid, Readings
from synth.propagators.times import EvenTimes, UnevenTimes

_REACH = (6.0, 4.0)
"""Intervals to try, times the fastest of n + w, rad: in 4 rad 16 nodes resolve r to 1e-15 of theta, in 6 where the
fastest harmonics are weak,"""
_READ = 4.3  # and times n, rad: the angle between nodes is then told to 2e-15
_GROUP = 32  # intervals in a block of the forcing
_BLOCKS = 24  # blocks in a stride at most; forcing and readings of a stride then stay in the processor's cache
_MOST_HALVINGS = 10
_PATIENCE = 8  # strides after which longer intervals are tried again
_STOP = 1e-15  # change of r, relative to the angle, that no longer matters even where angles feel all of it


@dataclass(frozen=True)
class PicardPlan:
    """Independent pendulums on one support, and when to read them.

        Examples
        --------
        A free pendulum of 0.1 rad is late by theta^2/16 of a turn each turn:

        >>> from fractions import Fraction
    from functools import cached_property
        >>> still = HarmonicSum(np.empty(0), np.empty(0, dtype=complex))
        >>> plan = PicardPlan(np.array([6.0]), np.zeros(1), np.array([[0.1, 0.0]]), still, still, 9.81,
        ...                   EvenTimes(Fraction(1, 4), 9))
        >>> theta, error = plan.elongation()
        >>> bool(abs(theta[0, 8] - 0.1 * np.cos(12 * (1 - 0.1**2 / 16))) < 1e-5), error < 1e-14
        (True, True)
    """

    frequencies: Floats
    damping_rates: Floats
    """(pendulums,) n > 0 in rad/s at infinitesimal arc, gamma in 1/s; taken as the doubles they are."""
    starts: Floats  # (pendulums, 2) angle in rad and angular velocity in rad/s at t = 0
    horizontal: HarmonicSum
    vertical: HarmonicSum  # x'' and z'' (up), m/s^2
    gravity: float  # m/s^2
    times: EvenTimes | UnevenTimes  # Readings, increasing, none before t = 0
    linear: bool = False  # Whether the law is linear: r = -zeta theta - u_near
    kicks: Kicks | None = None  # Impulses at ends of intervals

    def elongation(self) -> tuple[Floats, float]:
        """Angles at all readings.

        `RefusedError` if the motion is too violent for intervals of any sensible length.

        Returns
        -------
        theta : (pendulums, readings) float64
            rad
        estimated_error : float
            Largest error, relative to the largest angle of the pendulum.
        """
        theta, error, done = np.empty((len(self.frequencies), self.times.count)), 0.0, 0
        for angles, so_far in strides(self):
            here = slice(done, done + angles.shape[1])
            theta[:, here], error, done = angles, max(error, so_far), here.stop
        return theta, error

    def readings(self) -> list[Readings]:
        """The readings among intervals of each length to try."""
        times, kicks = self.times, self.kicks
        motions = (self.horizontal, self.vertical)
        fastest = max(float(np.max(motion.angular_frequency, initial=0.0)) for motion in motions)
        own = float(np.max(self.frequencies))
        longest = [min(reach / (own + fastest), _READ / own) for reach in _REACH]
        if kicks is not None:
            return [Readings(times, kicks.step / (times.step if isinstance(times, EvenTimes) else times.scale))]
        return [Readings.among(times, each) for each in longest]

    @cached_property
    def sums(self) -> tuple[Sums, Sums]:
        """Steady answers of all pendulums, u, and that part of u which they leave out, if any; and zeta."""
        horizontal, vertical = _at_least_one(self.horizontal), _at_least_one(self.vertical)
        w = horizontal.angular_frequency
        u = horizontal.acceleration / self.gravity
        low, high = NEAR_RESONANT_BAND
        n, gamma = self.frequencies[:, None], self.damping_rates[:, None]
        near = ((w > low * n) & (w < high * n)).any(axis=0)
        steady = np.where(near, 0.0, -(n**2) * u / np.where(near, 1.0, (n - w) * (n + w) + 2j * gamma * w))
        sums = np.vstack([steady, u, np.where(near, u, 0.0)] if near.any() else [steady, u])
        heave = vertical.acceleration[None, :] / self.gravity
        return Sums(w, sums, horizontal.combs), Sums(vertical.angular_frequency, heave, vertical.combs)

    @property
    def steady(self) -> Sums:
        """Steady answers of all pendulums, rad."""
        return self.sums[0].some(slice(len(self.frequencies)))

    def rest(self) -> tuple[Floats, Floats]:
        """What the starts have beyond the steady answers: y and y'/n at t = 0, (pendulums,) rad."""
        w, steady = self.steady.angular_frequency, self.steady.coefficients
        angle = self.starts[:, 0] - steady.real.sum(axis=1)
        speed = self.starts[:, 1] - (1j * w * steady).real.sum(axis=1)
        return angle, speed / self.frequencies

    def shadowed(self) -> PicardPlan:
        """Every pendulum twice."""
        frequencies, damping_rates = np.tile(self.frequencies, 2), np.tile(self.damping_rates, 2)
        return replace(self, frequencies=frequencies, damping_rates=damping_rates, starts=np.tile(self.starts, (2, 1)))


def _at_least_one(motion: HarmonicSum) -> HarmonicSum:
    """The motion; a constant zero for none, so that no sum is empty."""
    return motion if motion.angular_frequency.size else HarmonicSum(np.zeros(1), np.zeros(1, dtype=np.complex128))


class _Level:
    """One length of intervals: forcing, weights and readings."""

    def __init__(self, plan: PicardPlan, readings: Readings, shown: int) -> None:
        blocks = min(_BLOCKS, -(-readings.intervals // _GROUP))
        self.readings = readings
        self.most = blocks * _GROUP
        self.turn = plan.frequencies * float(readings.interval)
        self._pendulums = len(plan.frequencies)
        horizontal, vertical = plan.sums
        same = np.array_equal(horizontal.angular_frequency, vertical.angular_frequency)
        if same and horizontal.combs == vertical.combs:
            merged = replace(horizontal, coefficients=np.vstack([vertical.coefficients, horizontal.coefficients]))
            self._grids = [Grid(merged, readings.interval, _GROUP)]
        else:
            self._grids = [Grid(each, readings.interval, _GROUP) for each in (vertical, horizontal)]
        self.points = np.empty((self._pendulums, self.most, POINTS))
        self._still = np.zeros((self.most, NODES))
        self._plan, self._kicks = plan, plan.kicks
        self.shown = horizontal.some(slice(shown))
        each_pendulum = zip(plan.frequencies.tolist(), plan.damping_rates.tolist(), strict=True)
        sets = [
            weights(Fraction(n) ** 2, 2 * Fraction(gamma), readings.interval, Fraction(n)) for n, gamma in each_pendulum
        ]
        flow, inner, end, propagator, _ = (np.array(column) for column in zip(*sets, strict=True))
        inner = np.ascontiguousarray(inner[:, : NODES * NODES])
        guess = np.array([(continuation().T @ each.reshape(NODES, NODES)).ravel() for each in inner])
        self.law = Law(flow, inner, guess, end, propagator, legendre_tail()[None, :], plan.linear)

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
        rate = self._plan.steady.angular_frequency
        turning = self._plan.steady.coefficients[p] * np.exp(1j * rate * time)
        return np.array([turning.sum().real, (1j * rate * turning).sum().real / self._plan.frequencies[p]])

    def forcing(self, first: int, count: int) -> Forcing:
        """What acts in `count` intervals from the `first`."""
        centres = Ticks.even(first + _GROUP // 2, _GROUP, count // _GROUP)
        sums = [grid.evaluate(centres).reshape(-1, count, NODES) for grid in self._grids]
        vertical, horizontal = (sums[0][0], sums[0][1:]) if len(sums) == 1 else (sums[0][0], sums[1])
        rest = horizontal[self._pendulums :]
        drive = rest[1] if len(rest) > 1 else self._still[:count]
        return Forcing(horizontal[: self._pendulums], vertical, rest[0], drive, self._impulses(first, count))


def strides(plan: PicardPlan) -> Iterator[tuple[Floats, float]]:
    """Angles of stride after stride, (pendulums, readings) rad, and the estimate of the largest error up to there.

    The first stride is tried in intervals of several lengths, longest first; later ones halve what it took.

    `RefusedError` if intervals of a thousandth of the planned length are still too long.
    """
    shown = len(plan.frequencies)
    lengths = plan.readings()
    levels = [_Level(plan, lengths.pop(0), shown)] if lengths[0].intervals else []
    state = np.zeros((shown, 4))
    state[:, 0], state[:, 2] = plan.rest()
    remainder = np.zeros((shown, NODES))
    estimate = Estimate(shown)
    depth, calm, patience, done = 0, 0, _PATIENCE, 0
    while levels and done < levels[depth].readings.intervals:
        level = levels[depth]
        count = min(level.most, -(-(level.readings.intervals - done) // _GROUP) * _GROUP)
        carried, known, tried = state.copy(), remainder.copy(), estimate.copy()
        result = _stride(level, done, count, carried, known, tried)
        if result is not None and tried.is_large and len(state) == shown:
            # The growth of errors must be measured, from the start of this stride on.
            estimate = estimate.shadowed(tried)
            plan = plan.shadowed()
            levels = [_Level(plan, each.readings, shown) for each in levels]
            state, remainder = np.tile(state, (2, 1)), np.tile(remainder, (2, 1))
            estimate.nudge(state)
        elif result is not None:
            state, remainder, estimate = carried, known, tried
            done += count
            yield result, estimate.relative
            calm += 1
            if depth and calm >= patience:
                depth, done, calm = depth - 1, done // 2, 0
                remainder = np.zeros_like(remainder)
        elif done == 0 and depth == 0 and lengths:
            levels = [_Level(plan, lengths.pop(0), shown)]
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
                levels.append(_Level(plan, level.readings.halved(), shown))


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
    floor = (peak + np.minimum(turn, turn**2) * rest) ** 2
    stop = min(max(_STOP / max(contraction, 1e-3), 10 * _STOP), 100 * _STOP)
    done = march(state, remainder, forcing, level.law, floor, stop, level.points, report)  # whole: a part compiles anew
    points = level.points[:, :count]
    if done < count or not np.isfinite(state).all():
        return None
    estimate.add(report, peak, turn, points)
    if not estimate.is_resolved:
        return None
    portion = level.readings.portion(first, count)
    theta = level.readings.times.stretch(portion.start, portion.stop).values(level.shown)
    level.readings.read(points[: len(theta)], first, theta)
    return theta


def _largest(values: Floats) -> float:
    return max(float(values.max()), -float(values.min()))
