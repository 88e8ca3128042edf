"""The projection on closed-form motion: exact, and invariant under all that must not change n2."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from exact_pair import N2, Pair, milligal, swell
from made_records import GRAVITY, RESONANT, SWELL, row, simulate
from scipy.integrate import cumulative_simpson
from scipy.optimize import least_squares

from data_schemas.errors import RefusedError
from pipeline.estimate import Estimate
from pipeline.methods import method
from pipeline.observation import Observation
from pipeline.prepared import prepare
from pipeline.projection.upsample import upsample

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


def test_gaps_of_the_difference_are_dropped_not_filled() -> None:
    """What stands in a gap cannot matter, and a record with gaps stays exact."""
    pair = PAIRS["swell"]
    seen = pair.observe(TIME, step=STEP)
    difference = seen.difference.copy()
    difference[200:260] = np.nan
    difference[::60] = np.nan
    noise = np.random.default_rng(3).normal(0.0, 1e-6, TIME.size)
    found = run(replace(seen, difference=difference + noise))
    assert abs(found.frequency - N2) < 4.0 * found.sigma
    assert found.noise == pytest.approx(1e-6, rel=0.1)
    assert found.samples >= 0.995 * int(np.isfinite(difference).sum())  # of white noise 6e-5 exceed four sigmas


@pytest.mark.parametrize("length", [1, 5, 20, 30])
def test_gaps_of_the_first_pendulum_are_bridged(length: int) -> None:
    """Up to 3 s lost three times in heavy swell: right within its sigma, at most twice the whole record's."""
    random = np.random.default_rng(1)
    pair = Pair.apart(1e-4, forcing=swell(12, 0.03))
    seen = pair.observe(TIME, step=STEP)
    seen = replace(
        seen,
        theta=seen.theta + random.normal(0, 1e-4, TIME.size),
        difference=seen.difference + random.normal(0, 1e-4, TIME.size),
    )
    theta = seen.theta.copy()
    for start in (150, 600, 1100):
        theta[start : start + length] = np.nan
    found = run(replace(seen, theta=theta))
    assert abs(found.frequency - N2) < 3.0 * found.sigma
    assert found.sigma < 2.0 * run(seen).sigma


def test_wild_readings_are_left_out() -> None:
    seen = noisy()
    difference = seen.difference.copy()
    wild = np.random.default_rng(2).choice(TIME.size, 12, replace=False)
    difference[wild] += 3e-3 * np.where(np.arange(12) % 2, 1, -1)
    plain, found = run(seen), run(replace(seen, difference=difference))
    assert abs(found.frequency - plain.frequency) < 0.5 * plain.sigma
    assert found.noise == pytest.approx(plain.noise, rel=0.05)


@pytest.mark.parametrize(("rate", "limit"), [(25.0, 1e-4), (10.0, 0.03)])
@pytest.mark.parametrize("drop", [0.0, 0.2])
def test_uneven_times(drop: float, rate: float, limit: float) -> None:
    """A quarter step of jitter (10 ms at 25 Hz) and a fifth of the samples dropped; the bar is 0.01 mGal at 25 Hz."""
    random = np.random.default_rng(7)
    pair = PAIRS["damped"]
    time = (np.arange(3000) + random.uniform(-0.25, 0.25, 3000)) / rate
    time = np.sort(time[random.random(3000) >= drop])
    time -= time[0]
    assert abs(milligal(run(pair.observe(time)).frequency, N2)) < limit


def test_uneven_on_a_uniform_grid_is_uniform() -> None:
    """Jitter 0: the form for uneven times gives what the uniform one gives, noise and all."""
    seen = noisy()
    even = run(replace(seen, theta=PAIRS["damped"].elongation(0, TIME)))
    uneven = run(replace(seen, theta=PAIRS["damped"].elongation(0, TIME), step=None))
    assert abs(uneven.frequency - even.frequency) < 0.1 * even.sigma
    clean = PAIRS["damped"].observe(TIME)
    assert abs(milligal(run(clean).frequency, N2)) < 1e-3


def test_uneven_refuses_what_it_cannot_follow() -> None:
    random = np.random.default_rng(7)
    slow = np.cumsum(random.uniform(0.4, 0.8, 300))
    with pytest.raises(RefusedError, match="four a swing"):
        run(PAIRS["swell"].observe(slow - slow[0]))


@pytest.mark.parametrize("length", [10, 60, 100, 300])
def test_uneven_gaps_of_the_first_pendulum_are_paid_for_or_refused(length: int) -> None:
    random = np.random.default_rng(7)
    time = (np.arange(1500) + random.uniform(-0.2, 0.2, 1500)) * STEP
    time -= time[0]
    seen = PAIRS["swell"].observe(time)
    theta = seen.theta + random.normal(0.0, 2e-5, 1500)
    theta[300 : 300 + length] = np.nan
    seen = replace(seen, difference=seen.difference + random.normal(0.0, 2e-5, 1500))
    try:
        found = run(replace(seen, theta=theta))
    except RefusedError:
        return
    assert abs(found.frequency - N2) < 5.0 * found.sigma


def test_marks_twice_a_swing() -> None:
    """Read at half-second marks a pendulum of 1.01 s is followed through the spline: 0.01 mGal in half an hour."""
    time = np.arange(2400) * 0.5
    pair = Pair.apart(1e-4, forcing=swell(12, 0.02))
    found = run(pair.observe(time, step=0.5))
    assert abs(milligal(found.frequency, N2)) < 0.01


@pytest.mark.parametrize("missing", [False, True])
def test_upsample_finds_the_motion_between_marks(missing: bool) -> None:
    time = np.arange(1200) * 0.5
    pair = Pair.apart(0.0, forcing=swell(12, 0.02))
    theta = pair.elongation(0, time)
    if missing:
        theta[::120] = np.nan
    fine, *_ = upsample(theta, 0.5, N2, 5)
    at = np.arange(fine.size) * 0.1
    exact = pair.elongation(0, at)
    inner = (at > 60.0) & (at < 540.0)
    # of swell of 20 mrad 3 % is taken for the swing's image near the ends, and less the further from them
    assert np.abs(fine - exact)[inner].max() < (3e-3 if missing else 1e-3)
    assert np.sqrt(np.mean((fine - exact)[inner] ** 2)) < (6e-4 if missing else 2e-4)
    assert np.abs(fine[::5] - theta)[np.isfinite(theta)][120:1080].max() < 1e-3


def test_missing_marks_are_guessed_from_the_swell_and_their_errors_told() -> None:
    """A straight line between the marks beside a missing one errs by a tenth of a swell of 20 mrad, unseen."""
    time = np.arange(1200) * 0.5
    pair = Pair.apart(0.0, forcing=swell(12, 0.02))
    exact = pair.elongation(0, time)
    turned = np.exp(1j * N2 * time)
    pulls = []
    for seed in range(12):
        random = np.random.default_rng(seed)
        theta = exact + random.normal(0.0, 1e-5, time.size)
        missing = random.random(time.size) < 0.1
        for start in random.integers(0, time.size, 12):
            missing[start : start + 6] = True
        theta[missing] = np.nan
        fine, spread, _ = upsample(theta, 0.5, N2, 5)
        error = (fine[::5] - exact) * missing
        assert np.median(np.abs(error[missing])) < 5e-5
        pulls.append(abs(error @ turned) / spread)
        assert spread < 0.01
    assert np.sqrt(np.mean(np.square(pulls))) < 1.5


def test_upsample_follows_a_beat() -> None:
    """Near-resonant forcing of a two-minute beat turns the envelope at 0.05 rad/s, half as far as its image lies."""
    time = np.arange(1200) * 0.5
    pair = Pair.apart(0.0, forcing=((4e-5, N2 - 0.052, 0.7),))
    fine, *_ = upsample(pair.elongation(0, time), 0.5, N2, 5)
    at = np.arange(fine.size) * 0.1
    inner = (at > 60.0) & (at < 540.0)
    beat = np.abs(pair.slow(0, at)).max()
    assert np.abs(fine - pair.elongation(0, at))[inner].max() < 0.2 * beat  # the stiffness takes a seventh


def test_a_swing_that_is_not_there_is_refused() -> None:
    random = np.random.default_rng(1)
    noise = random.normal(0.0, 1e-3, (2, TIME.size))
    with pytest.raises(RefusedError, match="check instrument/period"):
        run(replace(PAIRS["swell"].observe(TIME, step=STEP), theta=noise[0], difference=noise[1]))


@pytest.mark.parametrize("beat", [4e-5, 4e-4])
def test_marks_give_gravity_whatever_the_beat(beat: float) -> None:
    """What the readings between marks are taken to be costs little: 0.02 mGal at a relative difference of 1e-4."""
    motion = [SWELL, RESONANT | {"amplitude": beat}]
    record, _ = simulate(eps=1e-4, duration=1200.0, marks=True, motion=motion)
    assert abs(row(record, "projection")["gravity_m_s2"] - GRAVITY) * 1e5 < 0.02


def test_auto_looks_between_marks_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """`auto` fits the identity several times, the method once more; the first pendulum is the same for all of them."""
    calls = []

    def counted(*given: Any) -> tuple[np.ndarray, float]:
        calls.append(given)
        return upsample(*given)

    monkeypatch.setattr("pipeline.projection.upsample.upsample", counted)
    record, _ = simulate(eps=1e-4, duration=600.0, marks=True)
    record["instrument"].attrs.pop("restoring", None)  # else nothing needs to be found out
    assert "gravity_m_s2" in row(record, "auto")
    assert len(calls) == 1
