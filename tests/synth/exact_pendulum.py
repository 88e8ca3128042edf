"""A linear pendulum in 50-digit arithmetic, by undetermined coefficients: shares nothing with the simulator.

    theta'' + 2 gamma theta' + n^2 theta = -n^2 sum a cos(w t + p)/g

The particular solution is a sum of A cos + B sin found from a 2x2 system for each harmonic; the homogeneous
one takes up the state at t = 0. At exact resonance without damping the system is singular: the frequency is
then moved by 1e-25, which changes the motion by less than 1e-18 in an hour.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mpmath

mpmath.mp.dps = 50


@dataclass
class ExactPendulum:
    """Numbers are taken as the doubles they are."""

    frequency: float
    damping_rate: float
    rates: Sequence[float]
    amplitudes: Sequence[Any]
    phases: Sequence[Any]
    gravity: float
    angle: Any
    angular_velocity: Any

    def __post_init__(self) -> None:
        n, gamma = mpmath.mpf(self.frequency), mpmath.mpf(self.damping_rate)
        self.terms = []
        for w, a, p in zip(self.rates, self.amplitudes, self.phases, strict=True):
            w = mpmath.mpf(float(w))
            if w == n and gamma == 0:
                w += mpmath.mpf("1e-25")
            force = -(n**2) * mpmath.mpf(a) / mpmath.mpf(self.gravity)
            stiff, loss = n**2 - w**2, 2 * gamma * w
            size = force / (stiff**2 + loss**2)
            # force cos(w t + p) is answered by size (stiff cos(w t + p) + loss sin(w t + p))
            self.terms.append((w, mpmath.mpf(p), size * stiff, size * loss))
        self.omega = mpmath.sqrt(n**2 - gamma**2)
        self.gamma = gamma
        self.cosine = mpmath.mpf(self.angle) - self.particular(0)
        speed = mpmath.mpf(self.angular_velocity) - self.particular_speed(0)
        self.sine = (speed + gamma * self.cosine) / self.omega

    def particular(self, t: Any) -> Any:
        return mpmath.fsum(c * mpmath.cos(w * t + p) + s * mpmath.sin(w * t + p) for w, p, c, s in self.terms)

    def particular_speed(self, t: Any) -> Any:
        return mpmath.fsum(w * (s * mpmath.cos(w * t + p) - c * mpmath.sin(w * t + p)) for w, p, c, s in self.terms)

    def __call__(self, t: Any) -> Any:
        swing = self.cosine * mpmath.cos(self.omega * t) + self.sine * mpmath.sin(self.omega * t)
        return self.particular(t) + mpmath.exp(-self.gamma * t) * swing
