"""The projection on closed-form motion: exact, and invariant under all that must not change n2."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from exact_pair import N2, Pair, milligal, swell
from scipy.integrate import cumulative_simpson
from scipy.optimize import least_squares

from data_schemas.errors import RefusedError
from pipeline.methods import method
from pipeline.observation import Observation
from pipeline.prepared import Estimate, prepare

STEP = 0.1
TIME = np.arange(1500) * STEP
EXACT = 1e-6  # mGal, the bar for noise-free records; the quadrature at 10 Hz on swell of 4 s reaches 1e-7


def run(seen: Observation) -> Estimate:
    return method("projection")(prepare(seen))


def error(pair: Pair, **changes: object) -> float:
    return milligal(run(pair.observe(TIME, step=STEP, **changes)).frequency, pair.frequency[1])


PAIRS = {
    "free": Pair.apart(1e-4),
    "swell": Pair.apart(1e-4, forcing=swell()),
    "near resonance": Pair.apart(1e-5, forcing=(*swell(), (4e-5, N2 - 0.052, 0.7))),
    "far apart": Pair.apart(1e-3, forcing=swell()),
    "second faster": Pair.apart(-3e-4, forcing=swell()),
    "damped": Pair.apart(1e-4, damping=(3e-4, 1e-4), forcing=swell()),
    "through zero": Pair.apart(1e-3, free=(0.01 + 0j, 0.01 * np.exp(0.9j)), forcing=swell()),
    "equal": Pair.apart(0.0, forcing=swell()),
    "all but equal": Pair.apart(1e-12, forcing=swell()),
    "Theta1/a = 10": Pair.apart(1e-4, free=(0.05 + 0j, 0.05 * np.exp(0.1j)), forcing=swell()),
}


@pytest.mark.parametrize("name", PAIRS)
def test_exact_on_linear_motion(name: str) -> None:
    assert abs(error(PAIRS[name])) < EXACT


@pytest.mark.parametrize("damping", [(0.0, 0.0), (2e-4, 2e-4)])
def test_damping_is_fitted_where_none_is_stated(damping: tuple[float, float]) -> None:
    pair = Pair.apart(1e-4, damping=damping, forcing=swell())
    found = run(pair.observe(TIME, step=STEP, damping_rate=None))
    assert abs(milligal(found.frequency, pair.frequency[1])) < EXACT
    assert found.damping_rate == pytest.approx(damping[1], abs=1e-11)


def test_a_nominal_period_one_per_cent_off_is_no_matter() -> None:
    pair = Pair.apart(1e-4, forcing=swell())
    for factor in (0.99, 0.998, 1.002, 1.01):
        assert abs(error(pair, frequency_reference=np.array(pair.frequency) * factor)) < 1e-4


def test_the_record_may_begin_at_any_moment() -> None:
    pair = PAIRS["damped"]
    values = [error(replace_time(pair, start)) for start in (0.0, 3.33, 41.7)]
    assert np.ptp(values) < EXACT


def replace_time(pair: Pair, start: float) -> Pair:
    """The same motion seen from a later start."""
    turn = [
        pair.free[k] * np.exp(complex(-pair.damping[k], np.sqrt(pair.frequency[k] ** 2 - pair.damping[k] ** 2)) * start)
        for k in (0, 1)
    ]
    return replace(pair, free=tuple(turn), forcing=tuple((a, m, d + m * start) for a, m, d in pair.forcing))


def noisy(seed: int = 5) -> Observation:
    random = np.random.default_rng(seed)
    seen = PAIRS["damped"].observe(TIME, step=STEP)
    noise = random.normal(0.0, 1e-5, (2, TIME.size))
    return replace(seen, theta=seen.theta + noise[0], difference=seen.difference + noise[1])


@pytest.mark.parametrize("factor", [3.0, 0.01, -1.0])
def test_a_common_scale_or_sign_is_no_matter_even_with_noise(factor: float) -> None:
    seen = noisy()
    scaled = run(replace(seen, theta=factor * seen.theta, difference=factor * seen.difference))
    plain = run(seen)
    assert abs(milligal(scaled.frequency, plain.frequency)) < 1e-7
    assert scaled.sigma == pytest.approx(plain.sigma, rel=1e-6)
    assert scaled.noise == pytest.approx(abs(factor) * plain.noise, rel=1e-6)


def test_an_offset_of_the_difference_is_no_matter() -> None:
    seen = noisy()
    assert abs(milligal(run(replace(seen, difference=seen.difference + 0.01)).frequency, run(seen).frequency)) < 1e-6


def test_any_common_motion_of_the_support_is_no_matter() -> None:
    """Whatever x'' adds, free pendulums and noise as before: n2 stays to 1e-6 mGal."""
    random = np.random.default_rng(9)
    noise = random.normal(0.0, 1e-5, TIME.size)
    found = []
    for forcing in ((), swell(20, 0.08, 1), (*swell(5, 0.1, 2), (5e-5, N2 - 0.03, 1.0))):
        pair = Pair.apart(1e-4, forcing=forcing)
        seen = pair.observe(TIME, step=STEP)
        found.append(run(replace(seen, difference=seen.difference + noise)).frequency)
    assert abs(milligal(found[1], found[0])) < EXACT
    # near resonance changes theta1, hence what noise in the difference says of n2: by second order only
    assert abs(milligal(found[2], found[0])) < 1e-2


def test_against_least_squares_on_a_directly_integrated_model() -> None:
    """Dense Simpson quadrature of the convolution, scipy's least squares on (A, B, offset, n): nothing shared."""
    fine = 8
    dense = np.arange((TIME.size - 1) * fine + 1) * (STEP / fine)
    pair = PAIRS["damped"]
    seen = noisy()
    # noise only in the difference, so that the two quadratures integrate the same function
    theta = pair.elongation(0, dense)
    seen = replace(seen, theta=pair.elongation(0, TIME))
    g1, g2 = pair.damping
    r = (pair.frequency[1] / pair.frequency[0]) ** 2

    def model(parameters: np.ndarray) -> np.ndarray:
        cos, sin, offset, n = parameters[0], parameters[1], parameters[2], N2 + parameters[3] * 1e-4
        w = np.sqrt(n * n - g2 * g2)
        lam = complex(-g2, w)
        inner = theta * np.exp(-lam * dense)
        c = np.exp(lam * dense) * (
            cumulative_simpson(inner.real, x=dense, initial=0) + 1j * cumulative_simpson(inner.imag, x=dense, initial=0)
        )
        # P = Im c / w and P' = Im(lam c) / w: the sheet's W1 and W2
        p, p_speed = c.imag / w, (lam * c).imag / w
        w1, w2 = theta - 2 * g2 * p_speed - n * n * p, p_speed
        swing = np.exp(-g2 * dense) * (cos * np.cos(w * dense) + sin * np.sin(w * dense))
        return (swing + (1 - r) * w1 + 2 * (g2 - r * g1) * w2 + offset)[::fine]

    start = [*np.linalg.lstsq(
        np.column_stack([np.cos(N2 * TIME), np.sin(N2 * TIME), np.ones(TIME.size)]), seen.difference, rcond=None
    )[0], 0.0]  # fmt: skip
    fit = least_squares(lambda p: (model(p) - seen.difference) * 1e5, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    found = run(seen)
    assert abs(milligal(found.frequency, N2 + fit.x[3] * 1e-4)) < 1e-4  # Simpson at 12.5 ms
    covariance = np.linalg.inv(fit.jac.T @ fit.jac) * 2 * fit.cost / (TIME.size - 4)
    assert found.noise == pytest.approx(1e-5 * np.sqrt(2 * fit.cost / (TIME.size - 4)), rel=1e-3)
    assert found.sigma >= 0.999 * np.sqrt(covariance[3, 3]) * 1e-4


def test_a_swing_that_is_not_there_is_refused() -> None:
    random = np.random.default_rng(1)
    noise = random.normal(0.0, 1e-3, (2, TIME.size))
    with pytest.raises(RefusedError, match="check instrument/period"):
        run(replace(PAIRS["swell"].observe(TIME, step=STEP), theta=noise[0], difference=noise[1]))


def broken(name: str) -> Observation:
    """A record with one thing that the projection does not take."""
    seen = noisy()
    if name == "coarse":
        rows = slice(None, None, 2)
        return replace(
            seen, time=seen.time[rows], step=2 * STEP, theta=seen.theta[rows], difference=seen.difference[rows]
        )
    trace, value = name.split(": ")
    series = getattr(seen, trace).copy()
    series[{"lost": 700, "wild": 700, "wild at the end": -2}[value]] += np.nan if value == "lost" else 3e-3
    return replace(seen, **{trace: series})


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("coarse", "readings a swing are fewer than eight"),
        ("theta: lost", "1 readings are missing"),
        ("difference: lost", "1 readings are missing"),
        ("theta: wild", "first pendulum has outliers"),
        ("difference: wild", "difference has outliers"),
        ("difference: wild at the end", "difference has outliers"),
    ],
)
def test_what_is_not_clean_is_refused_in_one_line(name: str, why: str) -> None:
    with pytest.raises(RefusedError, match=f"{why}.*; use --method joint"):
        run(broken(name))
