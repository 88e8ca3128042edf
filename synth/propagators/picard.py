r"""Pendulums with the full sine and cosine on a support that moves as sums of harmonics.

    theta'' + 2 gamma theta' = -n^2 [(1 + zeta) sin theta + u cos theta],   u = x''/g, zeta = z''/g

Exponential Picard collocation: theta = psi + y, where psi is the steady linear answer to the harmonics of u that lie
away from n, in closed form, and u_near stands for the others. What is left is small,

    y'' + 2 gamma y' + n^2 y = n^2 r,   r = (theta - sin theta) - zeta sin theta + u (1 - cos theta) - u_near

and is solved interval by interval: r is the polynomial through its values at Gauss nodes, its answer under the exact
linear flow is a product with fixed weights, and nodes and answer are iterated until they agree. Where the law is
linear, r = -zeta theta - u_near.

Propagator and state (y, y'/n) are two doubles each; hence 1e-15 to 1e-14 of the largest angle in an hour. A stride of
intervals that iteration or the nodes cannot manage is taken again in intervals half as long.
"""

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from data_schemas.errors import RefusedError
from synth.disturbances import Kicks
from synth.kernels.collocation import NODES
from synth.kernels.picard import march
from synth.motion.harmonic_sum import HarmonicSum, Sums
from synth.pendulums.linear import NEAR_RESONANT_BAND
from synth.phase import Floats
from synth.propagators.picard_forcing import GROUP, Level, Readings
from synth.propagators.times import EvenTimes, UnevenTimes

_REACH = (6.0, 4.0)
"""Intervals to try, times the fastest of n + w, rad: in 4 rad 16 nodes resolve r to 1e-15 of theta, in 6 where the
fastest harmonics are weak,"""
_READ = 4.3  # and times n, rad: the angle between nodes is then told to 2e-15
_MOST_HALVINGS = 10
_PATIENCE = 8  # strides after which longer intervals are tried again
_STOP = 1e-15  # change of r, relative to the angle, that no longer matters even where angles feel all of it
LARGE = 0.3  # angle from which growth is measured, rad
_NUDGE = 1e-13  # error that a shadow starts with, in largest angles: far above rounding, far below any arc
_FARTHEST = 1e-6  # a shadow may start at most this far, in rad: close to rest, energy asks for more
_FAR = 0.1  # of the largest angle: a shadow farther away no longer tells how fast errors grow
_EPSILON = 2.0**-53
_LAST_PLACES = 8.0
_RESOLVED = 2e-14  # of the largest angle: what r beyond its last term may cost


@dataclass(frozen=True)
class PicardPlan:
    """Independent pendulums on one support, and when to read them."""

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
        """All angles, (pendulums, readings) rad, and the relative error; `RefusedError` if too violent."""
        theta, error = self.times.values(self.steady), 0.0
        for first, points, readings, so_far in strides(self):
            readings.read(points, first, theta[:, readings.portion(first, points.shape[1])])
            error = max(error, so_far)
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

    def shadowed(self) -> "PicardPlan":
        """Every pendulum twice."""
        frequencies, damping_rates = np.tile(self.frequencies, 2), np.tile(self.damping_rates, 2)
        return replace(self, frequencies=frequencies, damping_rates=damping_rates, starts=np.tile(self.starts, (2, 1)))


def _at_least_one(motion: HarmonicSum) -> HarmonicSum:
    """The motion; a constant zero for none, so that no sum is empty."""
    return motion if motion.angular_frequency.size else HarmonicSum(np.zeros(1), np.zeros(1, dtype=np.complex128))


def strides(plan: PicardPlan) -> Iterator[tuple[int, Floats, Readings, float]]:
    """Of stride after stride its first interval, y at points of its intervals, (pendulums, intervals, POINTS) rad, the
    readings among intervals so long, and the estimate of the largest error up to there.

    `RefusedError` if intervals of a thousandth of the planned length are still too long.
    """
    shown = len(plan.frequencies)
    lengths = plan.readings()
    levels = [Level(plan, lengths.pop(0))] if lengths[0].intervals else []
    state = np.zeros((shown, 4))
    state[:, 0], state[:, 2] = plan.rest()
    remainder = np.zeros((shown, NODES))
    estimate = Estimate(shown)
    depth, calm, patience, done = 0, 0, _PATIENCE, 0
    while levels and done < levels[depth].readings.intervals:
        level = levels[depth]
        count = min(level.most, -(-(level.readings.intervals - done) // GROUP) * GROUP)
        carried, known, tried = state.copy(), remainder.copy(), copy(estimate)
        result = _stride(level, done, count, carried, known, tried)
        if result is not None and np.any(tried.peak > LARGE) and len(state) == shown:
            # The growth of errors must be measured, from the start of this stride on.
            estimate = estimate.shadowed(tried)
            plan = plan.shadowed()
            levels = [Level(plan, each.readings) for each in levels]
            state, remainder = np.tile(state, (2, 1)), np.tile(remainder, (2, 1))
            estimate.nudge(state)
        elif result is not None:
            state, remainder, estimate = carried, known, tried
            done += count
            yield done - count, result, level.readings, estimate.relative
            calm += 1
            if depth and calm >= patience:
                depth, done, calm = depth - 1, done // 2, 0
                remainder = np.zeros_like(remainder)
        elif done == 0 and depth == 0 and lengths:
            levels = [Level(plan, lengths.pop(0))]
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
                levels.append(Level(plan, level.readings.halved()))


def _stride(
    level: Level, first: int, count: int, state: Floats, remainder: Floats, estimate: "Estimate"
) -> Floats | None:
    """March `count` intervals; state, remainder and estimate move on. Return y at their points, of all pendulums that
    are shown, or none if it went wrong."""
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
    done = march(state, remainder, forcing, level.law, floor, stop, level.points, report, level.room)
    points = level.points[:, :count]  # the march takes them whole: a part compiles anew
    if done < count or not np.isfinite(state).all():
        return None
    estimate.add(report, peak, turn, points)
    if not np.all(estimate.beyond <= _RESOLVED * estimate.peak):  # r is no polynomial of the nodes' degree
        return None
    return points[: estimate.shown]


def _largest(values: Floats) -> float:
    return max(float(values.max()), -float(values.min()))


class Estimate:
    """How far several pendulums (so many without shadows) may be off, rad.

    - Readings and phases are rounded: a few units of the last place of the largest angle.
    - r beyond its last Legendre term, extrapolated from the decay of the last two pairs and integrated twice over an
      interval. It does not add up: at Gauss nodes the ends of intervals are right to its square.
    - The rounding of r adds up like a random walk in the state and then grows. A small arc turns a change of amplitude
      into one of phase by dn/dTheta = -n Theta/8. For a large one growth is the distance from a shadow of each
      pendulum, behind all pendulums, which starts with a little more energy: one rounding of the speed at the lowest
      point. Energy, because near the separatrix it decides what comes next.
    """

    def __init__(self, pendulums: int) -> None:
        self.shown = pendulums
        self._amplitude, self.peak = np.zeros((2, pendulums))  # of y, squared; of the angle
        self.beyond, self._walk = np.zeros((2, pendulums))  # what r beyond its last term costs; rounding, squared
        self._turned = np.zeros(pendulums)  # n t
        self._nudge, self._growth = np.zeros(pendulums), np.ones(pendulums)

    def shadowed(self, other: "Estimate") -> "Estimate":
        """From here on with shadows; their nudge is a share of the largest angle that `other` saw."""
        result = copy(self)
        result._amplitude = np.tile(self._amplitude, 2)
        result._nudge = _NUDGE * np.minimum(other.peak, np.pi)
        return result

    def nudge(self, state: Floats) -> None:
        """Move the states of shadows, the second half of (pendulums, 4) as in `kernels.picard.march`."""
        for error, shadow in zip(self._nudge.tolist(), state[self.shown :], strict=True):
            uphill = np.array([np.sin(shadow[0]), shadow[2]])
            steepness = float(np.hypot(*uphill))
            energy = error**2 / _NUDGE
            step = min(energy / steepness, _FARTHEST) if steepness > error else error
            direction = uphill / steepness if steepness > error else np.array([0.0, 1.0])
            shadow[[0, 2]] += step * direction

    def report(self) -> Floats:
        """Fresh report for `kernels.picard.march`."""
        report = np.zeros((len(self._amplitude), 5))
        report[:, 3] = self._amplitude
        return report

    def add(self, report: Floats, steady: Floats, turn: Floats, points: Floats) -> None:
        """Take up a stride's `report` (pendulums, 5), with shadows; arrays are replaced, never written to.

        Largest angles of the `steady` answers, rad; the `turn` n h; y at the `points` (pendulums, intervals, POINTS).
        """
        self._amplitude = report[:, 3]
        shown = slice(self.shown)
        last, before = np.sqrt(report[shown, 0]), np.sqrt(report[shown, 1])
        decay = np.divide(last, before, out=np.ones_like(last), where=before > last)
        self.beyond = np.maximum(self.beyond, last * decay * (turn[shown] / (4 * NODES)) ** 2)
        self._walk = self._walk + (_EPSILON * turn[shown]) ** 2 * report[shown, 2] / NODES
        self._turned = self._turned + turn[shown] * points.shape[1]
        self.peak = np.maximum(self.peak, np.sqrt(self._amplitude[shown]) + steady[shown])
        if len(points) > self.shown:
            apart = np.abs(points[self.shown :] - points[shown]).max(axis=(1, 2))
            grown = np.divide(apart, self._nudge, out=np.ones_like(apart), where=self._nudge > 0)
            grown[apart > _FAR * self.peak] *= 10.0  # the distance is bounded, what it stands for is not
            self._growth = np.maximum(self._growth, grown)

    @property
    def relative(self) -> float:
        """Largest error relative to the largest angle; 2 says that nothing is known."""
        arc = 1.0 + self._turned * np.minimum(self._amplitude[: self.shown], LARGE**2) / 8
        walk = np.sqrt(self._walk) * np.maximum(self._growth, arc)
        error = _LAST_PLACES * _EPSILON * self.peak + self.beyond + walk
        share = np.divide(error, self.peak, out=np.zeros_like(error), where=self.peak > 0)
        return min(float(np.max(share, initial=0.0)), 2.0)
