"""Parts of the methods on their own: colours, limits, readings of the raw first pendulum, integrals of corrections."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from data_schemas.errors import RefusedError
from pipeline import correction
from pipeline.harmonics.envelope import SlowMotion, sliding_envelope
from pipeline.methods.exact import as_estimate, numerical_error, residual_colour
from pipeline.methods.phases import complex_form, corrected, passes_zero, phases, value_and_slope, with_noise
from pipeline.phase_speed import phase_speed

STEP, N, DAMPING = 0.1, 6.2, 2e-4
TIME = STEP * np.arange(4000)


def prepared(noise: float = 1e-6, apart: float = 4e-4, second: float = 0.011) -> Any:
    """A stand-in of two free swings, their frequencies apart, whose difference was read with noise."""
    one, two = 0.02 * np.exp(0.3j + 1j * (N - 3e-4 + apart) * TIME), second * np.exp(1.9j + 1j * (N - 3e-4) * TIME)
    draw = np.random.default_rng(2)
    difference = (one - two).real + noise * draw.normal(size=TIME.size)
    envelope = sliding_envelope(TIME, STEP, one.real, difference, N)
    observation = SimpleNamespace(step=STEP, difference=difference, frequency_ratio=1.0 + 2e-4, damping_difference=3e-5)
    budget = SimpleNamespace(noise_difference=0.3, noise_theta=0.1, influence=np.ones(envelope.time.size) * (1 + 2j))
    return SimpleNamespace(
        sliding=envelope,
        observation=observation,
        nominal=N,
        fine=SimpleNamespace(frequency=N, damping_rate=DAMPING),
        fine_budget=budget,
        fine_explained=0.9,
        noise_difference=np.nan,
        theta_error=lambda gain, noise: 2.0 * gain * noise,
    )


def test_white_residuals_are_white_and_a_swing_is_not() -> None:
    draw = np.random.default_rng(3)
    made: Any = SimpleNamespace(observation=SimpleNamespace(step=STEP))

    def colour(residual: np.ndarray, frequency: float = N) -> float:
        fit: Any = SimpleNamespace(noise=float(np.std(residual)), residual=residual, frequency=frequency)
        return residual_colour(fit, made)

    # a thousand blocks: 3 %, four sigmas 13 %
    assert colour(draw.normal(size=40_013)) == pytest.approx(1.0, abs=0.13)
    # all of it near the swing: half of a block's 40 samples
    assert colour(np.cos(N * STEP * np.arange(40_000))) == pytest.approx(20.0, rel=0.02)
    assert colour(np.cos(0.5 * N * STEP * np.arange(40_000))) < 0.5
    assert colour(np.zeros(100)) == 1.0


def test_the_numerical_error_grows_by_the_eighth_power() -> None:
    fit: Any = SimpleNamespace(stiffness=np.array([3.0, -4.0]) * 1e-2, frequency=N)
    strength = np.sqrt(12.5) * 1e-2 / (2.0 * N)
    least = numerical_error(fit, 1e-6)
    assert least == pytest.approx(3e-9 * strength)
    assert (numerical_error(fit, 0.1) - least) / strength == pytest.approx(5e-6 * (0.1 * N) ** 8)


def test_amplitudes_below_a_tenth_pass_zero() -> None:
    for least, passing in ((0.0999, True), (0.1001, False)):
        assert passes_zero(np.array([1.0, np.nan, least, 0.5])) is passing
    assert passes_zero(np.array([np.nan])) is False


def test_raw_readings_are_those_of_a_polynomial_of_degree_eight() -> None:
    """Exact through the nine nearest samples, between them and beyond the ends, whatever is missing."""
    time = np.linspace(0.0, 2.0, 21)
    series = (time - 0.7) ** 8 + 3.0 * time
    series[[4, 11]] = np.nan
    at = np.array([0.0, 0.03, 0.41, 1.0, 1.13, 1.99, 2.0])
    value, slope = value_and_slope(time, series, at)
    np.testing.assert_allclose(value, (at - 0.7) ** 8 + 3.0 * at, atol=1e-9)
    np.testing.assert_allclose(slope, 8.0 * (at - 0.7) ** 7 + 3.0, atol=1e-7)
    # of what is no polynomial the nearest know most
    wave, _ = value_and_slope(np.arange(100.0), np.sin(0.8 * np.arange(100.0)), np.array([50.3]))
    assert wave[0] == pytest.approx(np.sin(0.8 * 50.3), abs=1e-3)


def test_speeds_of_the_model_are_those_of_27_and_38() -> None:
    made = prepared()
    seen, envelope = made.observation, made.sliding
    first, difference = envelope.first, envelope.difference
    second = first - difference
    lead, ratio = np.angle(first / difference), seen.frequency_ratio
    by_27 = phase_speed(ratio * N, N, np.abs(first), np.abs(difference), lead, seen.damping_difference) - N
    np.testing.assert_allclose(correction.model_speed(made, N, arc=False), by_27, rtol=1e-9)
    amplitude = np.abs([first, second, difference])
    own = np.array([[ratio * N], [N]]) * (1.0 - amplitude[:2] ** 2 / 16.0)
    own[0] = ratio * (N - N * amplitude[0] ** 2 / 16.0)
    growth = -np.array([[DAMPING + seen.damping_difference], [DAMPING]]) * amplitude[:2]
    decay = growth[1] / amplitude[1] - growth[0] / amplitude[0]
    by_38 = phase_speed(own[0], own[1], amplitude[0], amplitude[2], lead, decay) - N
    np.testing.assert_allclose(correction.model_speed(made, N, arc=True), by_38, rtol=1e-9)
    whole = correction.by_periods(made, N)
    np.testing.assert_allclose(np.gradient(whole, envelope.hop)[1:-1], by_27[1:-1], atol=1e-8)


def test_phases_are_refused_where_they_mean_nothing() -> None:
    made = prepared()
    found = phases(made)
    np.testing.assert_allclose(np.exp(1j * found.phase), made.sliding.difference / np.abs(made.sliding.difference))
    np.testing.assert_allclose(found.weight, np.abs(made.sliding.difference) ** 2)
    made.fine_explained = 0.01
    with pytest.raises(RefusedError, match="does not explain it"):
        phases(made)


def test_the_complex_form_alone_goes_through_zero() -> None:
    made = prepared(apart=0.02, second=0.02)
    with pytest.raises(RefusedError, match="falls below a tenth of its maximum"):
        phases(made)
    made.fine = SimpleNamespace(frequency=N, damping_rate=0.0, model=made.sliding.difference * (1.0 + 1e-4))
    found = complex_form(made)
    assert found.frequency == N
    size = np.abs(made.sliding.difference)
    assert found.noise == pytest.approx(1e-4 * np.sqrt(0.5 * np.mean(size**2) / made.sliding.noise_gain))


@pytest.mark.parametrize("colour", [0.2, 1.0, 4.0])
def test_less_than_white_noise_is_taken_for_white(colour: float) -> None:
    fit: Any = SimpleNamespace(influence=[0.5], noise=2e-6, frequency=N, damping_rate=DAMPING, residual=np.zeros(7))
    made: Any = SimpleNamespace(nominal=6.0, fine=SimpleNamespace(slope=0.1))
    found = as_estimate(made, fit, colour, 3e-6, 4e-6, reduced=True)
    assert found.sigma == pytest.approx(np.sqrt(25.0 + max(colour, 1.0)) * 1e-6)
    assert found.uncorrected == pytest.approx(np.hypot(6.1, DAMPING))
    assert (found.samples, found.noise, found.acceleration_reduced) == (7, 2e-6, True)


def test_windows_show_a_phase_that_bends_as_it_is() -> None:
    """The envelope's fit takes a quadratic phase as it is, and of a faster one what it lets through."""
    made = prepared()
    time = 0.5 * np.arange(900) - 20.0
    rise = 1e-4 * (time + 20.0)
    made.slow_motion = SlowMotion(-20.0, 0.5, np.zeros(900), np.zeros(900), rise)
    parts = correction.of_real_pendulums(made, N)
    exact = made.slow_motion.phase(N, made.sliding.time)
    assert np.ptp(exact) > 20.0
    np.testing.assert_allclose(parts["acceleration"], exact, atol=2e-5)
    made.slow_motion = SlowMotion(-20.0, 0.5, np.zeros(900), np.zeros(900), 0.01 * np.cos(3.0 * time))
    fast = correction.of_real_pendulums(made, N)["acceleration"]
    line = np.polynomial.Polynomial.fit(made.sliding.time, fast, 1)(made.sliding.time)
    assert np.ptp(fast - line) < 0.05 * 2.0 * 0.5 * 0.01 * N / 3.0
    whole = correction.integrated(correction.model_speed(made, N, arc=True), made.sliding.hop)
    np.testing.assert_allclose(parts["non_isochronism"] + parts["arc"], whole, atol=1e-12)


def test_an_estimate_is_the_slope_of_the_corrected_phase() -> None:
    """Its noise that of the residual: as read, as neighbours know it, coloured where it is more than that."""
    made = prepared(1e-5, apart=0.0)
    found = phases(made)
    shift = 3e-4 * found.envelope.time
    plain, moved = corrected(made, found, {}), corrected(made, found, {"arc": shift})
    assert np.sqrt(plain.frequency**2 - DAMPING**2) == pytest.approx(np.polyfit(
        found.envelope.time, found.phase, 1, w=np.sqrt(found.weight))[0] + N, rel=1e-13)  # fmt: skip
    assert moved.frequency == pytest.approx(plain.frequency - 3e-4, rel=1e-9)
    assert moved.uncorrected == plain.uncorrected == plain.frequency
    assert moved.finite_arc == pytest.approx(-3e-4)
    assert (plain.finite_arc, plain.acceleration_reduced) == (0.0, False)
    assert corrected(made, found, {"acceleration": shift}).acceleration_reduced
    # windows of 16 s on 400: some 25 independent ones
    assert plain.noise == pytest.approx(1e-5, rel=0.4)
    assert plain.residual_colour == pytest.approx(1.0)
    assert plain.sigma == pytest.approx(np.hypot(0.3, 2.0 * 0.1) * plain.noise)
    assert (plain.samples, plain.damping_rate) == (4000, DAMPING)
    for known in (0.5, 3.0):
        made.noise_difference = known * plain.noise
        other = corrected(made, found, {})
        assert other.residual_colour == pytest.approx(known**-2)
        assert other.noise == made.noise_difference
        own = 0.3 * known * max(1.0, 1.0 / known)
        assert other.sigma == pytest.approx(np.hypot(own, 0.2 * known) * plain.noise)
    made.noise_difference = 0.0
    assert corrected(made, found, {}).residual_colour == 1.0


def test_few_samples_a_swing_count_each_sample() -> None:
    made = prepared(1e-5)
    squares = np.full(made.sliding.time.size, 2e-12)
    plain = with_noise(made, squares, N, 0.0)
    made.nominal = 100.0  # as if there were hardly any
    sparse = with_noise(made, squares, N, 0.0)
    influence = made.sliding.influence(made.fine_budget.influence, TIME.size, round(made.sliding.hop / STEP))
    ratio = np.hypot(np.linalg.norm(influence), 0.2) / np.hypot(0.3, 0.2)
    assert sparse.sigma / plain.sigma == pytest.approx(ratio)
    assert plain.noise == pytest.approx(np.sqrt(1e-12 / made.sliding.noise_gain))
    assert plain.uncorrected == pytest.approx(np.hypot(N, DAMPING))
    squares[40:] = np.nan
    squares[:3] = 8e-12
    assert with_noise(made, squares, N, 0.0).noise == pytest.approx(
        np.sqrt(0.5 * np.nanmean(squares) / made.sliding.noise_gain)
    )
