"""Beats: at and near resonance, told by their growth or as two harmonics, whichever loses nothing."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import numpy as np
import pytest

from data_schemas.scene_pendulum import FreeStart
from synth.motion.harmonic_sum import HarmonicSum
from synth.pendulums.linear import respond
from synth.propagators.times import EvenTimes, growth

OWN, GRAVITY = 6.0, 9.81
STEP, COUNT = Fraction(1, 16), 57_601  # an hour
SAMPLES = [0, 1, 2, 16, 1600, 57_599, 57_600]


@pytest.mark.parametrize("apart", [0.0, 1e-12, -(2.0**-40), 1e-5, 2.77e-4, 2.79e-4, 0.01, -1.19, 1.4])
@pytest.mark.parametrize("damping_rate", [0.0, 1e-4, 0.5])
def test_beat_is_exact_for_any_detuning_and_time(apart: float, damping_rate: float) -> None:
    """G (exp(i m t) - exp(lambda t))/mu in 50 digits; an hour times 2.78e-4 is where one way gives way to the other."""
    m = OWN + apart
    motion = HarmonicSum(np.array([m]), np.array([0.3 + 0.1j]))
    response = respond(OWN, damping_rate, FreeStart(amplitude=0.0, phase=0.0), motion, GRAVITY)
    assert response.near.size == 1
    found = EvenTimes(STEP, COUNT).free_harmonic(response)
    with mpmath.workdps(50):
        omega = mpmath.sqrt(mpmath.mpf(OWN) ** 2 - mpmath.mpf(damping_rate) ** 2)
        mu = mpmath.mpc(damping_rate, mpmath.mpf(m) - omega)
        gain = (
            -(mpmath.mpf(OWN) ** 2) * mpmath.mpc(0.3, 0.1) / mpmath.mpf(GRAVITY) / mpmath.mpc(damping_rate, m + omega)
        )
        exact = []
        for k in SAMPLES:
            t = mpmath.mpf(k) / 16
            end = mpmath.exp(mpmath.mpc(-damping_rate, omega) * t)
            exact.append(complex(gain * (t * end if mu == 0 else (mpmath.expj(m * t) - end) / mu)))
    # two phases and a quotient, each right to a rounding or two
    assert np.abs(found[SAMPLES] - exact).max() <= 3e-15 * np.abs(found).max()


def test_growth_near_and_at_resonance() -> None:
    seconds = np.array([-3.0, 0.0, 1e-3, 3.0])
    split = np.array([[0.0], [1e-9 + 1e-12j], [0.1 - 0.3j]])
    with mpmath.workdps(40):
        exact = [
            [complex(t if mu == 0 else mpmath.expm1(mpmath.mpc(mu) * mpmath.mpf(t)) / mpmath.mpc(mu)) for t in seconds]
            for mu in split[:, 0].tolist()
        ]
    assert np.abs(growth(split, seconds) - exact).max() < 1e-15


def test_overdamped_decay_over_long_blocks_does_not_overflow() -> None:
    """A pendulum that forgets its start within seconds, read each 10 s for months: growth over a block, exp(1000)."""
    still = HarmonicSum(np.empty(0), np.empty(0, dtype=complex))
    response = respond(OWN, 2.0, FreeStart(amplitude=0.01, phase=0.0), still, GRAVITY)
    theta = EvenTimes(Fraction(10), 1_000_000).elongation([response])[0]
    assert theta[0] == pytest.approx(0.01, rel=1e-12)
    assert np.abs(theta[1:]).max() < 1e-9
