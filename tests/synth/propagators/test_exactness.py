"""The closed form against 50-digit arithmetic and against an ODE solver."""

from __future__ import annotations

import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from exact_pendulum import ExactPendulum
from scipy.integrate import solve_ivp

from data_schemas.scene_pendulum import StateStart
from synth.motion.harmonic_sum import HarmonicSum
from synth.pendulums.linear import respond
from synth.propagators.times import EvenTimes, UnevenTimes

GRAVITY = 9.81
N = 2 * math.pi / 1.00966
START = StateStart(angle=0.02, angular_velocity=-0.03)
SAMPLES = [0, 1, 2, 187, 188, 4321, 35_999, 71_998, 71_999]

# The last harmonic: far from n, in a two-minute beat, within 1e-12 of n, at n, at the edges of the band.
CLOSEST = {
    "far": 0.5 * N,
    "beat": N - math.pi / 60,
    "hair": N - 1e-12,
    "resonant": N,
    "low edge": 0.8001 * N,
    "high edge": 1.2499 * N,
}


def _motion(closest: float) -> HarmonicSum:
    chance = np.random.default_rng(4)
    rates = np.append(chance.uniform(0.3, 1.6, 6), closest)
    amplitudes = np.append(chance.uniform(0.02, 0.1, 6), 8e-4)
    return HarmonicSum(rates, amplitudes * np.exp(1j * chance.uniform(0, 6.28, 7)))


def _exact(motion: HarmonicSum, damping_rate: float) -> ExactPendulum:
    """The reference reads the very phasors: the rounding of a exp(i p) is not held against the simulator."""
    mpmath.mp.dps = 50
    phasors = [mpmath.mpc(each) for each in motion.acceleration.tolist()]
    size, phase = [abs(each) for each in phasors], [mpmath.arg(each) for each in phasors]
    rates = motion.angular_frequency.tolist()
    return ExactPendulum(N, damping_rate, rates, size, phase, GRAVITY, START.angle, START.angular_velocity)


@pytest.mark.parametrize("damping_rate", [0.0, 1e-4])
@pytest.mark.parametrize("closest", CLOSEST)
def test_an_hour_at_20_hz(closest: str, damping_rate: float) -> None:
    motion = _motion(CLOSEST[closest])
    response = respond(N, damping_rate, START, motion, GRAVITY)
    theta = EvenTimes(Fraction(1, 20), 72_000).elongation([response])[0]
    exact = _exact(motion, damping_rate)
    error = max(abs(float(exact(mpmath.mpf(k) / 20) - theta[k])) for k in SAMPLES)
    assert error <= 1e-14 * np.max(np.abs(theta))  # the bar of the propagator


@pytest.mark.parametrize("closest", ["beat", "resonant", "low edge"])
def test_an_hour_at_uneven_times_of_a_slow_clock(closest: str) -> None:
    motion = _motion(CLOSEST[closest])
    response = respond(N, 1e-4, START, motion, GRAVITY)
    scale = 1 + Fraction(7, 86_400)
    seconds = np.sort(np.random.default_rng(5).uniform(-1.0, 3600.0, 2000))
    theta = UnevenTimes(seconds, scale).elongation([response])[0]
    exact = _exact(motion, 1e-4)
    picked = range(0, 2000, 311)
    true = [mpmath.mpf(float(seconds[k])) * scale.numerator / scale.denominator for k in picked]
    error = max(abs(float(exact(t) - theta[k])) for k, t in zip(picked, true, strict=True))
    assert error <= 1e-14 * np.max(np.abs(theta))


def test_an_ode_solver_agrees() -> None:
    motion = _motion(CLOSEST["beat"])
    response = respond(N, 2e-3, START, motion, GRAVITY)
    times = EvenTimes(Fraction(1, 20), 800)
    theta = times.elongation([response])[0]

    def slope(t: float, state: np.ndarray) -> list[float]:
        push = np.real(np.exp(1j * motion.angular_frequency * t) @ motion.acceleration) / GRAVITY
        return [state[1], -2 * 2e-3 * state[1] - N**2 * (state[0] + push)]

    solution = solve_ivp(
        slope,
        (0, 40),
        [START.angle, START.angular_velocity],
        "DOP853",
        np.arange(800) / 20,
        rtol=1e-12,
        atol=1e-14,
    )
    # 40 s at rtol 1e-12: the solver's own error, 1e-11 of the angle
    np.testing.assert_allclose(theta, solution.y[0], rtol=0, atol=2e-12)


@pytest.mark.parametrize("count", [1, 2, 7, 8, 31, 1000, 1001])
def test_any_number_of_moments(count: int) -> None:
    """Even times are the same moments as uneven ones, whatever the size of the last block."""
    motion = _motion(CLOSEST["beat"])
    responses = [respond(N, rate, START, motion, GRAVITY) for rate in (0.0, 1e-3)]
    step = Fraction(1, 8)  # exact in binary, so that both have the same moments
    even, uneven = EvenTimes(step, count), UnevenTimes(np.arange(count) / 8, Fraction(1))
    w = motion.angular_frequency
    np.testing.assert_allclose(even.elongation(responses), uneven.elongation(responses), rtol=0, atol=1e-16)
    np.testing.assert_allclose(even.free_harmonic(responses[1]), uneven.free_harmonic(responses[1]), rtol=0, atol=1e-16)
    push = even.series(w, motion.acceleration[None, :])
    assert push.shape == (1, count)
    np.testing.assert_allclose(push, uneven.series(w, motion.acceleration[None, :]), rtol=0, atol=2e-15)


def test_thousands_of_harmonics_and_none() -> None:
    """More harmonics than one product takes, in and out of the band; and an empty sum is zero."""
    rates = np.linspace(0.1, 12.0, 1500)
    motion = HarmonicSum(rates, np.full(1500, 1e-4 + 0j))
    response = respond(N, 1e-3, START, motion, GRAVITY)
    assert response.near.size > 300
    theta = EvenTimes(Fraction(1, 40), 40_000).elongation([response])[0]
    exact = _exact(motion, 1e-3)
    error = max(abs(float(exact(mpmath.mpf(k) / 40) - theta[k])) for k in (0, 17, 39_999))
    assert error <= 1e-14 * np.max(np.abs(theta))
    nothing = HarmonicSum(np.empty(0), np.empty(0, dtype=complex))
    assert np.all(EvenTimes(Fraction(1, 4), 60).series(nothing.angular_frequency, nothing.acceleration[None]) == 0)
