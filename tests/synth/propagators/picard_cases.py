"""Pendulums and motions that the tests of Picard collocation share."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from synth.motion.harmonic_sum import HarmonicSum
from synth.propagators.picard import PicardPlan
from synth.propagators.times import EvenTimes, UnevenTimes

GRAVITY = 9.81
N = 2 * math.pi / 1.01


def motion(*terms: tuple[float, complex]) -> HarmonicSum:
    """Terms of angular frequency and complex amplitude."""
    return HarmonicSum(np.array([w for w, _ in terms]), np.array([a for _, a in terms], dtype=np.complex128))


STILL = motion()
SWELL = motion((0.6, 0.5), (0.97, 0.3j), (1.4, -0.2 + 0.1j))
HEAVE = motion((0.55, 0.2j), (1.1, 0.15))


def make(
    starts: Sequence[tuple[float, float]],
    horizontal: HarmonicSum = STILL,
    vertical: HarmonicSum = STILL,
    *,
    times: EvenTimes | UnevenTimes | None = None,
    damping_rate: float = 0.0,
    frequency: float = N,
) -> PicardPlan:
    """A plan for pendulums of one frequency."""
    count = len(starts)
    return PicardPlan(
        np.full(count, frequency),
        np.full(count, damping_rate),
        np.array(starts, dtype=float),
        horizontal,
        vertical,
        GRAVITY,
        EvenTimes(Fraction(1, 20), 401) if times is None else times,
    )


def right_side(plan: PicardPlan, k: int, t: float, state: np.ndarray) -> list[float]:
    """Equation of motion of one pendulum, written out anew."""
    x, z = (
        float(np.sum((each.acceleration * np.exp(1j * each.angular_frequency * t)).real))
        for each in (plan.horizontal, plan.vertical)
    )
    angle, speed = state
    force = (1 + z / plan.gravity) * math.sin(angle) + x / plan.gravity * math.cos(angle)
    return [speed, -(plan.frequencies[k] ** 2) * force - 2 * plan.damping_rates[k] * speed]


def at_sea() -> PicardPlan:
    """Two pendulums of 30 and 12 mrad, an hour at 20 Hz, 33 harmonics either way: psi 75 mrad, zeta 0.03 rms."""
    k = np.arange(33)
    share = 1 / (1 + ((k - 12) / 8) ** 2)
    phase = np.exp(1j * k**2)
    return PicardPlan(
        np.array([N, N * (1 - 1e-4)]),
        np.array([1e-4, 1.2e-4]),
        np.array([[0.03, 0.0], [0.012, 0.1]]),
        HarmonicSum(2 * np.pi / (4 + k / 2), GRAVITY * 0.075 / 4.0 * share * phase),
        HarmonicSum(2 * np.pi / (4.25 + k / 2), GRAVITY * 0.0125 * share * phase.conj()),
        GRAVITY,
        EvenTimes(Fraction(1, 20), 72_000),
    )
