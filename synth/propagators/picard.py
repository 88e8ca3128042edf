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
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from synth.kicks import Kicks
from synth.motion.harmonic_sum import HarmonicSum
from synth.pendulums.linear import NEAR_RESONANT_BAND
from synth.phase import Floats
from synth.propagators.picard_forcing import Readings, Sums
from synth.propagators.picard_march import Equations, Swing, march
from synth.propagators.times import EvenTimes, UnevenTimes

_REACH = (6.0, 4.0)
"""Intervals to try, times the fastest of n + w, rad: in 4 rad 16 nodes resolve r to 1e-15 of theta, in 6 where the
fastest harmonics are weak,"""
_READ = 4.3
"""and times n, rad: the angle between nodes is then told to 2e-15."""


@dataclass(frozen=True)
class PicardPlan:
    """Independent pendulums on one support, and when to read them.

    Examples
    --------
    A free pendulum of 0.1 rad is late by theta^2/16 of a turn each turn:

    >>> from fractions import Fraction
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
    starts: Floats
    """(pendulums, 2) angle in rad and angular velocity in rad/s at t = 0."""
    horizontal: HarmonicSum
    vertical: HarmonicSum
    """x'' and z'' (up), m/s^2."""
    gravity: float
    """m/s^2"""
    times: EvenTimes | UnevenTimes
    """Readings, increasing, none before t = 0."""
    linear: bool = False
    """Whether the law is linear: r = -zeta theta - u_near."""
    kicks: Kicks | None = None
    """Impulses at ends of intervals."""

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
        swings = list(self.stream())
        theta = [np.empty((len(self.frequencies), 0)), *(swing.theta for swing in swings)]
        return np.concatenate(theta, axis=1), swings[-1].estimated_error if swings else 0.0

    def stream(self) -> Iterator[Swing]:
        """Angles portion by portion, in order of time and in bounded memory.

        `RefusedError`: as `elongation`.
        """
        return march(self._equations(), self._readings())

    def _readings(self) -> list[Readings]:
        """The readings among intervals of each length to try."""
        times, kicks = self.times, self.kicks
        motions = (self.horizontal, self.vertical)
        fastest = max(float(np.max(motion.angular_frequency, initial=0.0)) for motion in motions)
        own = float(np.max(self.frequencies))
        longest = [min(reach / (own + fastest), _READ / own) for reach in _REACH]
        if kicks is not None:
            return [Readings(times, kicks.step / (times.step if isinstance(times, EvenTimes) else times.scale))]
        return [Readings.among(times, each) for each in longest]

    def _equations(self) -> Equations:
        horizontal, vertical = _at_least_one(self.horizontal), _at_least_one(self.vertical)
        w = horizontal.angular_frequency
        u = horizontal.acceleration / self.gravity
        low, high = NEAR_RESONANT_BAND
        n, gamma = self.frequencies[:, None], self.damping_rates[:, None]
        near = ((w > low * n) & (w < high * n)).any(axis=0)
        steady = np.where(near, 0.0, -(n**2) * u / np.where(near, 1.0, (n - w) * (n + w) + 2j * gamma * w))
        angle = self.starts[:, 0] - steady.real.sum(axis=1)
        speed = self.starts[:, 1] - (1j * w * steady).real.sum(axis=1)
        sums = np.vstack([steady, u, np.where(near, u, 0.0)] if near.any() else [steady, u])
        heave = vertical.acceleration[None, :] / self.gravity
        return Equations(
            self.frequencies, self.damping_rates, np.array([angle, speed / self.frequencies]),
            Sums(w, sums, horizontal.combs), Sums(vertical.angular_frequency, heave, vertical.combs),
            self.linear, self.kicks,
        )  # fmt: skip


def _at_least_one(motion: HarmonicSum) -> HarmonicSum:
    """The motion; a constant zero for none, so that no sum is empty."""
    return motion if motion.angular_frequency.size else HarmonicSum(np.zeros(1), np.zeros(1, dtype=np.complex128))
