"""The fit of the complex form of (27), on exactly integrated envelopes, and its error budget by Monte Carlo."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from exact_pair import N2, Pair, swell

from pipeline.harmonics.envelope import Envelope, sliding_envelope
from pipeline.harmonics.narrowband import (
    NarrowbandFit,
    budget,
    fit_narrowband,
    phase_slope,
    regression,
    running_integral,
)

HOP = 1.0
TIME = 8.0 + HOP * np.arange(285)
CARRIER = N2 * (1.0 + 3e-5)  # the nominal frequency is off by 60 mGal


def envelopes(pair: Pair) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """D, X and X' of the free harmonics relative to the carrier."""
    turn = np.exp(-1j * CARRIER * TIME)
    first, second = (pair.harmonic(which, TIME) * turn for which in (0, 1))
    speed = (pair.harmonic(0, TIME, 1) - 1j * CARRIER * pair.harmonic(0, TIME)) * turn
    return first - second, first, speed


def fit(pair: Pair, known_damping: bool = True, **changes: Any) -> NarrowbandFit:
    difference, first, speed = envelopes(pair)
    series = {"difference": difference, "first": first, "first_speed": speed, "coverage": np.ones(TIME.size)}
    constants = {
        "ratio": pair.frequency[0] / pair.frequency[1],
        "damping_difference": pair.damping[0] - pair.damping[1],
    }
    envelope: Any = SimpleNamespace(
        time=TIME, hop=HOP, carrier=CARRIER, **{name: changes.pop(name, each) for name, each in series.items()}
    )
    return fit_narrowband(envelope, **constants | changes, damping_rate=pair.damping[1] if known_damping else None)


def relative(found: NarrowbandFit, pair: Pair) -> float:
    """mGal; the envelope turns at the damped frequency."""
    n2, gamma = pair.frequency[1], pair.damping[1]
    return 2e5 * 9.81 * (np.hypot(found.frequency, gamma) / n2 - 1.0)


@pytest.mark.parametrize("eps", [0.0, 1e-12, 1e-5, -1e-4, 1e-3])
def test_recovers_n2_of_free_harmonics(eps: float) -> None:
    found = fit(Pair.apart(eps))
    # the quadrature's (n1 - n0)^4 remainder at a hop of 1 s is 1e-5 mGal at eps = 1e-3, rounding else
    assert abs(relative(found, Pair.apart(eps))) < 2e-5 if abs(eps) > 1e-4 else 1e-6


def test_holds_the_ratio_not_the_difference() -> None:
    """The same data with a nominal 1e-3 off: only the ratio n1/n2 is an input, so nothing changes."""
    pair = Pair.apart(1e-4)
    assert abs(relative(fit(pair, ratio=1.0 + 1e-4), pair)) < 1e-5
    shifted = relative(fit(pair, ratio=1.0 + 1.001e-4), pair)
    assert abs(shifted) > 0.02  # 1e-7 of n1/n2 costs 0.196 mGal x Theta1/a cos


@pytest.mark.parametrize("damping", [(2e-4, 2e-4), (3e-4, 1e-4)])
@pytest.mark.parametrize("known", [True, False])
def test_damping_is_taken_or_found(damping: tuple[float, float], known: bool) -> None:
    pair = Pair.apart(1e-4, damping=damping)
    found = fit(pair, known)
    assert found.damping_rate == pytest.approx(damping[1], abs=1e-9)
    # exact but for the quadrature: a decaying free harmonic obeys the complex form with Xi = 0
    assert abs(relative(found, pair)) < 2e-5


def test_ignored_damping_costs_what_physics_says() -> None:
    pair = Pair.apart(1e-4, damping=(2e-4, 1e-4))
    assert abs(relative(fit(pair, damping_difference=0.0), pair)) > 0.1


def test_beats_through_zero_do_not_matter() -> None:
    pair = Pair.apart(1e-3, free=(0.01 + 0j, 0.01 * np.exp(0.8j)))
    difference, _, _ = envelopes(pair)
    assert np.abs(difference).min() < 0.05 * np.abs(difference).max()
    assert abs(relative(fit(pair), pair)) < 1e-4


@pytest.mark.parametrize("missing", [0, 100])
def test_starts_of_a_part_first_lead_to_the_same_fit(missing: int, monkeypatch: pytest.MonkeyPatch) -> None:
    pair, cut = Pair.apart(3e-3), np.where(np.arange(TIME.size) < missing, np.nan, 1.0)
    difference = envelopes(pair)[0] * cut
    whole = fit(pair, difference=difference)
    monkeypatch.setattr("pipeline.harmonics.narrowband._SCAN_WHOLE", 1.0)
    assert fit(pair, difference=difference).frequency == pytest.approx(whole.frequency, rel=1e-12)


def test_missing_instants_have_no_weight() -> None:
    pair = Pair.apart(1e-4)
    difference, _, _ = envelopes(pair)
    weight = np.ones(TIME.size)
    weight[40:90] = 0.0
    weight[120:125] = 0.0
    broken = np.where(weight > 0.0, difference, 7.0)  # must not be looked at
    found = fit(pair, difference=broken, coverage=weight)
    assert abs(relative(found, pair)) < 1e-6
    # the model bridges them all the same
    assert np.abs(found.model - difference).max() < 1e-9


def test_model_and_jacobian_by_finite_differences() -> None:
    pair = Pair.apart(1e-3, damping=(3e-4, 1e-4))
    found = fit(pair, known_damping=False)
    ratio = pair.frequency[0] / pair.frequency[1]
    apart = pair.damping[0] - pair.damping[1]

    def model(frequency: float, gamma: float, start: complex) -> np.ndarray:
        """Trapezoidal sum on ten times as many instants; the frequencies are those of the damped swings."""
        fine = np.linspace(TIME[0], TIME[-1], 10 * (TIME.size - 1) + 1)
        turn = np.exp(-1j * CARRIER * fine)
        x = pair.harmonic(0, fine) * turn
        x_speed = (pair.harmonic(0, fine, 1) - 1j * CARRIER * pair.harmonic(0, fine)) * turn
        one = np.sqrt(ratio**2 * (frequency**2 + gamma**2) - (gamma + apart) ** 2)
        drive = x + 1.5 / (1j * one) * (x_speed + (1j * (CARRIER - one) + gamma + apart) * x)
        mu = 1j * (frequency - CARRIER) - gamma
        inner = (1j * (one - frequency) - apart) * drive * np.exp(-mu * (fine - fine[0]))
        total = np.concatenate([[0.0], np.cumsum(0.5 * (inner[1:] + inner[:-1]))]) * (fine[1] - fine[0])
        return (np.exp(mu * (fine - fine[0])) * (start + total))[::10]

    at = (found.frequency, found.damping_rate, complex(found.model[0]))
    assert np.abs(model(*at) - found.model).max() < 1e-9
    by_frequency = (model(at[0] + 1e-6, *at[1:]) - model(at[0] - 1e-6, *at[1:])) / 2e-6
    by_damping = (model(at[0], at[1] + 1e-6, at[2]) - model(at[0], at[1] - 1e-6, at[2])) / 2e-6
    by_real, by_imag = (model(*at[:2], at[2] + d) - model(*at) for d in (1.0, 1j))
    for row, numeric in zip(found.jacobian, (by_real, by_imag, by_frequency, by_damping), strict=True):
        assert np.abs(row - numeric).max() < 2e-4 * np.abs(numeric).max()


def test_running_integral_is_of_fourth_order() -> None:
    errors = []
    for count in (21, 41):
        x = np.linspace(0.0, 2.0, count)
        found = running_integral(np.exp(1j * x) * x, x[1])
        exact = np.exp(1j * x) * (1.0 - 1j * x) - 1.0
        errors.append(np.abs(found - exact).max())
    assert errors[0] / errors[1] > 12.0
    cubic = np.linspace(0.0, 1.0, 9) ** 3 + 0j
    assert np.abs(running_integral(cubic, 0.125) - np.linspace(0.0, 1.0, 9) ** 4 / 4).max() < 1e-15
    assert running_integral(np.array([1.0, 2.0, 4.0]), 2.0).tolist() == [0.0, 3.0, 9.0]  # trapezia when short


def test_phase_slope_and_regression_against_polyfit() -> None:
    random = np.random.default_rng(1)
    weight = random.uniform(0.2, 1.0, TIME.size)
    values = 0.3 * TIME + random.normal(0, 1, TIME.size)
    assert regression(TIME, values, weight) == pytest.approx(np.polyfit(TIME, values, 1, w=np.sqrt(weight))[0])
    envelope = 0.01 * np.exp(1j * (2.0 - 0.4 * TIME))
    envelope[3] = np.nan
    weight[3] = 0.0
    assert phase_slope(TIME, envelope, weight) == pytest.approx(-0.4)
    size = random.uniform(0.5, 2.0, TIME.size)
    noisy = size * envelope * np.exp(0.3j * random.normal(0, 1, TIME.size))
    phase = np.full(TIME.size, np.nan)
    phase[weight > 0.0] = np.unwrap(np.angle(noisy[weight > 0.0]))
    fitted = np.polyfit(TIME[weight > 0.0], phase[weight > 0.0], 1, w=(np.sqrt(weight) * size)[weight > 0.0])[0]
    assert phase_slope(TIME, noisy, weight) == pytest.approx(fitted, rel=1e-12)


# budget ---------------------------------------------------------------------------------------------------------

STEP = 0.1
SAMPLES = np.arange(3000) * STEP


def _monte_carlo(pair: Pair, known: bool, count: int, of: str, gaps: bool = False) -> tuple[float, float]:
    """Standard deviation of the fitted n2 for unit-variance noise in one series, and the budget's."""
    random = np.random.default_rng(17)
    theta, difference = pair.elongation(0, SAMPLES), pair.difference(SAMPLES)
    if gaps:
        difference[900:1300] = np.nan
    sigma = 1e-6
    values = []
    for _ in range(count):
        noise = random.normal(0.0, sigma, SAMPLES.size)
        series = (theta + noise, difference) if of == "theta" else (theta, difference + noise)
        envelope = sliding_envelope(SAMPLES, STEP, *series, CARRIER)
        values.append(_fit(envelope, pair, known).frequency)
    envelope = sliding_envelope(SAMPLES, STEP, theta, difference, CARRIER)
    shares = budget(envelope, _fit(envelope, pair, known), pair.frequency[0] / pair.frequency[1], _apart(pair))
    predicted = shares.noise_theta if of == "theta" else shares.noise_difference
    return float(np.std(values)) / sigma, predicted


def _apart(pair: Pair) -> float:
    return pair.damping[0] - pair.damping[1]


def _fit(e: Envelope, pair: Pair, known: bool) -> NarrowbandFit:
    return fit_narrowband(e, pair.frequency[0] / pair.frequency[1], _apart(pair), pair.damping[1] if known else None)


@pytest.mark.parametrize("gaps", [False, True])
@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("of", ["difference", "theta"])
def test_budget_of_reading_noise_against_monte_carlo(of: str, known: bool, gaps: bool) -> None:
    pair = Pair.apart(1e-3, forcing=swell(4, 0.02))
    seen, predicted = _monte_carlo(pair, known, 200, of, gaps)
    # 200 draws know a standard deviation to 5 %; two of those, and what windows are not: 12 %
    assert predicted == pytest.approx(seen, rel=0.12)


def test_budget_sensitivities_against_refitting() -> None:
    pair = Pair.apart(1e-3, damping=(3e-4, 1e-4))
    theta, difference = pair.elongation(0, SAMPLES), pair.difference(SAMPLES)
    envelope = sliding_envelope(SAMPLES, STEP, theta, difference, CARRIER)
    found = _fit(envelope, pair, True)
    ratio = pair.frequency[0] / pair.frequency[1]
    shares = budget(envelope, found, ratio, _apart(pair))
    nudge = 1e-6
    wider = Pair((pair.frequency[0] * (1 + nudge), pair.frequency[1]), pair.damping)
    by_ratio = (_fit(envelope, wider, True).frequency - found.frequency) / (ratio * nudge)
    assert shares.by_ratio == pytest.approx(by_ratio, rel=0.01)  # the drive's own change by the ratio is left out
    louder = replace(envelope, first=envelope.first * 1.001, first_speed=envelope.first_speed * 1.001)
    assert shares.by_gain == pytest.approx((_fit(louder, pair, True).frequency - found.frequency) / 1e-3, rel=0.01)
