from __future__ import annotations

import math

import numpy as np
import pytest

from data_schemas.scene_motion import HarmonicMotion, NearResonantMotion
from synth.motion.harmonic_sum import add, harmonics, near_resonant


def test_period_and_angular_frequency_say_the_same() -> None:
    by_period = harmonics(HarmonicMotion(amplitude=(0.1, 0.2), period=(10.0, 4.0), phase=(0.0, 1.0)))
    rates = (2 * math.pi / 10, 2 * math.pi / 4)
    by_rate = harmonics(HarmonicMotion(amplitude=(0.1, 0.2), angular_frequency=rates, phase=(0.0, 1.0)))
    np.testing.assert_array_equal(by_period.angular_frequency, by_rate.angular_frequency)
    np.testing.assert_allclose(by_period.acceleration, [0.1, 0.2 * np.exp(1j)])


def test_phases_left_out_are_zero() -> None:
    assert np.all(harmonics(HarmonicMotion(amplitude=(0.1, 0.2), period=(10.0, 4.0))).acceleration.imag == 0)


def test_two_minute_beat() -> None:
    """Paper: a beat of two minutes is nu = pi/120 = 0.026 rad/s (its text prints 0.03)."""
    term = NearResonantMotion(amplitude=8e-4, beat_period=120.0)
    assert term.nu == pytest.approx(0.026, abs=2e-4)
    assert near_resonant(term, 6.2).angular_frequency[0] == pytest.approx(6.2 - 2 * math.pi / 120, rel=1e-15)


def test_detuning_of_either_sign() -> None:
    for nu in (-0.02, 0.0, 1e-12):
        motion = near_resonant(NearResonantMotion(amplitude=8e-4, detuning=nu, phase=0.5), 6.2)
        assert motion.angular_frequency[0] == 6.2 - 2 * nu
        assert motion.acceleration[0] == pytest.approx(8e-4 * np.exp(0.5j))


def test_sum_of_no_terms_is_rest() -> None:
    assert add([]).angular_frequency.size == 0
