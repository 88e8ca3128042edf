"""Laws that the motion of nonlinear pendulums keeps, and that collocation must keep."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from picard_cases import GRAVITY, HEAVE, STILL, SWELL, N, make, motion

from data_schemas.errors import RefusedError
from data_schemas.scene_pendulum import StateStart
from synth.motion.harmonic_sum import HarmonicSum
from synth.pendulums.linear import respond, start_state
from synth.propagators import picard, picard_forcing
from synth.propagators.times import EvenTimes, UnevenTimes


def _period(amplitude: float) -> mpmath.mpf:
    """4 K(sin(A/2))/n."""
    with mpmath.workdps(30):
        return 4 * mpmath.ellipk(mpmath.sin(mpmath.mpf(amplitude) / 2) ** 2) / mpmath.mpf(N)


def _seconds(times: list[mpmath.mpf]) -> UnevenTimes:
    return UnevenTimes(np.array([float(each) for each in times]), Fraction(1))


@pytest.mark.parametrize("near", [0.5 * N, 0.9 * N, N, N + 1e-3])
def test_linear_limit(near: float) -> None:
    """Arcs of 1e-9: what is not linear is below 1e-18 of them."""
    swell = motion((0.6, 3e-9), (near, 4e-10j))
    times = EvenTimes(Fraction(1, 20), 801)
    theta, error = make([(2e-9, 1e-9)], swell, damping_rate=1e-3, times=times).elongation()
    response = respond(N, 1e-3, StateStart(angle=2e-9, angular_velocity=1e-9), swell, GRAVITY)
    linear = times.elongation([response])
    # both are right to a few units of the last place
    assert np.max(np.abs(theta - linear)) <= 4e-15 * np.max(np.abs(linear))
    assert error <= 1e-14


def test_start_state_is_that_of_the_linear_motion() -> None:
    swell = motion((0.6, 0.3), (0.99 * N, 1e-3j))
    start = StateStart(angle=0.02, angular_velocity=-0.03)
    state = start_state(respond(N, 2e-3, start, swell, GRAVITY))
    np.testing.assert_allclose(state, [0.02, -0.03], rtol=0, atol=1e-16)


def test_mirror() -> None:
    """theta -> -theta with u -> -u, to the last bit: every operation is odd or even."""
    mirrored = HarmonicSum(SWELL.angular_frequency, -SWELL.acceleration)
    for start in ((0.02, 0.1), (0.9, 0.3)):  # short polynomials, and reduced angles
        plan = make([start], SWELL, HEAVE, damping_rate=1e-3)
        other = replace(plan, starts=-plan.starts, horizontal=mirrored)
        assert np.array_equal(plan.elongation()[0], -other.elongation()[0])


def test_time_reversal() -> None:
    """Backwards along the same path: a pendulum started at the end leads to the beginning."""
    last = 12.5
    plan = make([(0.3, 0.4)], SWELL, HEAVE)
    # The angular velocity at the end comes from a symmetric pair of readings and the equation's own smoothness.
    step = 2.0**-8
    offsets = step * np.arange(-8, 9)
    near = replace(plan, times=UnevenTimes(last + offsets, Fraction(1))).elongation()[0][0]
    fit = np.polynomial.Polynomial.fit(offsets, near, 13)
    speed = float(fit.deriv()(0.0))
    shift = [
        HarmonicSum(each.angular_frequency, (each.acceleration * np.exp(1j * each.angular_frequency * last)).conj())
        for each in (SWELL, HEAVE)
    ]
    back = make([(near[8], -speed)], *shift, times=UnevenTimes(np.array([last / 2, last]), Fraction(1)))
    forth = replace(plan, times=UnevenTimes(np.array([0.0, last / 2]), Fraction(1)))
    # differentiation of rounded readings costs 1e-13; the shear of 12 s of motion no more than ten times that
    np.testing.assert_allclose(back.elongation()[0][:, ::-1], forth.elongation()[0], rtol=0, atol=2e-12)


def test_sample_rate_does_not_matter() -> None:
    coarse = make([(0.03, 0.02), (0.6, 0.0)], SWELL, HEAVE)
    theta = coarse.elongation()[0]
    for rate in (2, 7, 40, 500):  # intervals of a part, of a few and of many steps
        other = replace(coarse, times=EvenTimes(Fraction(1, rate), 20 * rate + 1)).elongation()[0]
        common = np.gcd(rate, 20)
        # different intervals round differently: a few units of the last place, times the shear of 20 s at 0.6 rad
        np.testing.assert_allclose(
            other[:, :: rate // common], theta[:, :: 20 // common], rtol=0, atol=2e-14 * np.max(np.abs(theta))
        )


def test_slow_clock_and_gap() -> None:
    """A chronometer's second is `scale` true ones; strides without readings are passed through."""
    scale = Fraction(5, 4)
    plan = make([(0.03, 0.02)], SWELL, damping_rate=1e-3, times=UnevenTimes(np.array([0.0, 600.0]), scale))
    even = replace(plan, times=EvenTimes(Fraction(750), 2)).elongation()[0]
    np.testing.assert_allclose(plan.elongation()[0], even, rtol=0, atol=1e-15)


@pytest.mark.parametrize("amplitude", [1e-6, 1e-3, 0.1, 0.5, 1.0])
def test_period(amplitude: float) -> None:
    """Zero at 25 1/4 periods of the elliptic integral: to 1e-12 of the period."""
    period = _period(amplitude)
    theta = make([(amplitude, 0.0)], times=_seconds([period * mpmath.mpf("25.25")])).elongation()[0][0, 0]
    assert abs(theta) / (2 * np.sin(amplitude / 2) * N) / (25.25 * float(period)) <= 1e-12


@pytest.mark.compiled
@pytest.mark.parametrize("amplitude", [2.0, 3.0, 3.1])
def test_period_of_a_large_arc(amplitude: float) -> None:
    """The first quarter, before errors have grown."""
    period = _period(amplitude)
    theta = make([(amplitude, 0.0)], times=_seconds([period / 4])).elongation()[0][0, 0]
    assert abs(theta) / (2 * np.sin(amplitude / 2) * N) / (0.25 * float(period)) <= 1e-12


def _energy_drift(amplitude: float, swings: int) -> float:
    """Angles at whole periods are turning points, where an error of phase does not show."""
    period = _period(amplitude)
    times = _seconds([period * k for k in range(0, swings + 1, swings // 10)])
    theta = make([(amplitude, 0.0)], times=times).elongation()[0][0]
    energy = 2 * np.sin(theta / 2) ** 2
    return float(np.max(np.abs(energy / energy[0] - 1)))


def test_energy_over_1000_swings() -> None:
    assert _energy_drift(0.1, 1000) <= 1e-13


@pytest.mark.compiled
@pytest.mark.parametrize("amplitude", [1e-6, 0.1, 1.0, 2.5])
def test_energy_over_10000_swings(amplitude: float) -> None:
    assert _energy_drift(amplitude, 10_000) <= 1e-12


def test_convergence_order(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half the interval: within intervals r's polynomial decides, at their ends Gauss nodes do twice as well.

    Orders are 18 and 32 in the limit; in intervals of half a swing and more they are still below.
    """
    monkeypatch.setattr(picard, "_RESOLVED", np.inf)  # else intervals are halved at once
    monkeypatch.setattr(picard, "LARGE", np.inf)
    plan = make([(0.5, 0.0)], SWELL, HEAVE, times=EvenTimes(Fraction(1, 8), 161))
    monkeypatch.setattr(picard, "_READ", np.inf)
    monkeypatch.setattr(picard, "_REACH", [0.26 * (N + 1.4)])  # intervals of a quarter of a second
    exact = plan.elongation()[0]
    within, ends = [], []
    for longest in (1.0, 0.5):
        monkeypatch.setattr(picard, "_REACH", [1.001 * longest * (N + 1.4)])
        theta, estimate = plan.elongation()
        error = np.abs(theta - exact)[0]
        within.append(float(np.max(error)))
        ends.append(float(np.max(error[::8])))
        true = within[-1] / float(np.max(np.abs(exact)))
        assert estimate / 1000 <= true <= 10 * estimate
    assert within[1] > 1e-12  # far above rounding
    assert within[0] / within[1] >= 2.0**14
    assert ends[0] / ends[1] >= 2.0**20


def _free_swing(amplitude: float, readings: list[int]) -> tuple[float, float]:
    """True and estimated error at readings at quarters of seconds, against Jacobi's function cd."""
    plan = make([(amplitude, 0.0)], times=UnevenTimes(np.array(readings) / 4, Fraction(1)))
    theta, estimate = plan.elongation()
    with mpmath.workdps(30):
        modulus = mpmath.sin(mpmath.mpf(amplitude) / 2)
        exact = [
            2 * mpmath.asin(modulus * mpmath.ellipfun("cd", mpmath.mpf(N) * k / 4, m=modulus**2)) for k in readings
        ]
    error = max(float(abs(a - b)) for a, b in zip(theta[0].tolist(), exact, strict=True))
    return error / amplitude, estimate


@pytest.mark.parametrize("amplitude", [0.02, 0.25, 1.0])
def test_estimate_is_honest(amplitude: float) -> None:
    """True error at most ten estimates, at least a thousandth."""
    error, estimate = _free_swing(amplitude, list(range(121)))
    assert estimate / 1000 <= error <= 10 * estimate


@pytest.mark.compiled
@pytest.mark.parametrize("amplitude", [0.02, 0.25, 0.5, 1.0, 3.0])
def test_estimate_is_honest_after_an_hour(amplitude: float) -> None:
    error, estimate = _free_swing(amplitude, list(range(14_300, 14_400, 3)))
    assert estimate / 1000 <= error <= 10 * estimate


@pytest.mark.compiled
@pytest.mark.parametrize("damping_rate", [0.0, 1e-4])
def test_linear_limit_after_an_hour(damping_rate: float) -> None:
    """A propagator or a state of single doubles would be 1e-14 off at least; arcs of 1e-12 shift the phase by 1e-20."""
    swell = motion((0.6, 3e-12))
    times = EvenTimes(Fraction(1, 4), 14_400)
    theta, _ = make([(2e-12, 1e-12)], swell, damping_rate=damping_rate, times=times).elongation()
    response = respond(N, damping_rate, StateStart(angle=2e-12, angular_velocity=1e-12), swell, GRAVITY)
    linear = times.elongation([response])
    assert np.max(np.abs(theta - linear)) <= 3e-15 * np.max(np.abs(linear))


def test_a_pendulum_that_hangs_still() -> None:
    theta, error = make([(0.0, 0.0)], STILL, HEAVE).elongation()
    assert not theta.any()
    assert error == 0.0


def test_strides_follow_each_other_and_are_bounded() -> None:
    plan = make([(0.03, 0.02)], SWELL, HEAVE, times=EvenTimes(Fraction(1, 5), 2501))
    begins, counts, errors = zip(
        *((first, y.shape[1], error) for first, y, _, error in picard.strides(plan)), strict=True
    )
    assert len(counts) > 1
    assert list(begins) == [sum(counts[:k]) for k in range(len(counts))]
    assert list(errors) == sorted(errors)


def test_intervals_lengthen_when_the_motion_calms_down(monkeypatch: pytest.MonkeyPatch) -> None:
    plan = make([(1.5, 0.0)], SWELL, damping_rate=0.1, times=EvenTimes(Fraction(1, 4), 241))
    whole = plan.elongation()[0]
    monkeypatch.setattr(picard_forcing, "_BLOCKS", 1)
    monkeypatch.setattr(picard, "_PATIENCE", 1)
    lengths = [readings.interval for _, _, readings, _ in picard.strides(plan)][:-1]
    assert min(lengths) == lengths[0] < lengths[-1] == max(lengths)
    # other intervals round differently: some units of the last place
    np.testing.assert_allclose(plan.elongation()[0], whole, rtol=0, atol=2e-14)


def test_no_readings() -> None:
    assert make([(0.1, 0.0)], times=EvenTimes(Fraction(1, 20), 0)).elongation()[0].shape == (1, 0)


def test_violence_is_refused() -> None:
    plan = make([(0.1, 0.0)], STILL, motion((1.0, 1e9)), times=EvenTimes(Fraction(1, 20), 3))
    with pytest.raises(RefusedError, match="choose the explicit method"):
        plan.elongation()
