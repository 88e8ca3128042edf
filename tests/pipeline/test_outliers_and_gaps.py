"""Wild readings: found, not over-found, the noise told; gaps of an input: bridged by what stands beside them."""

from __future__ import annotations

import numpy as np
import pytest
from exact_pair import N2, Pair, swell

from pipeline.gaps import bridge
from pipeline.outliers import reject_outliers

STEP = 0.04
TIME = np.arange(5000) * STEP
THETA = Pair.apart(1e-4, forcing=swell(12, 0.05)).elongation(0, TIME)
SIGMA = 5e-5


def noisy(seed: int = 0) -> np.ndarray:
    return THETA + np.random.default_rng(seed).normal(0.0, SIGMA, TIME.size)


def test_clean_readings_are_left_alone() -> None:
    total = 0
    for seed in range(4):
        series = noisy(seed)
        cleaned, count, noise = reject_outliers(series, STEP, N2)
        total += count
        assert noise == pytest.approx(SIGMA, rel=0.05)  # 5000 residuals that share neighbours
        if count == 0:
            assert cleaned is series
    assert total <= 1  # of 20 000 Gaussian readings 2e-9 each exceed six sigmas; the scale's own error allows one


def test_wild_readings_are_found_and_nothing_else() -> None:
    random = np.random.default_rng(5)
    series = noisy()
    wild = np.sort(random.choice(np.arange(20, TIME.size - 20), 60, replace=False))
    series[wild] += random.choice([-1.0, 1.0], 60) * 20.0 * SIGMA
    cleaned, count, noise = reject_outliers(series, STEP, N2)
    found = np.flatnonzero(np.isnan(cleaned))
    assert count == found.size
    assert np.isin(wild, found).mean() > 0.97  # two wild ones side by side may hide each other
    assert (~np.isin(found, wild)).sum() <= 2
    assert noise == pytest.approx(SIGMA, rel=0.08)
    assert np.array_equal(cleaned[~np.isnan(cleaned)], series[~np.isnan(cleaned)])


@pytest.mark.parametrize("length", [5, 25, 75, 150])
def test_readings_beside_a_gap_are_not_wild(length: int) -> None:
    """A bridge errs by more than a reading; its neighbours must not be blamed."""
    series = noisy(3)
    for start in (400, 1500, 3300):
        series[start : start + length] = np.nan
    _, count, _ = reject_outliers(series, STEP, N2)
    assert count <= 1


def test_missing_readings_stay_missing_and_are_not_counted() -> None:
    series = noisy()
    series[100] = np.nan
    series[2000] += 1e-2
    cleaned, count, _ = reject_outliers(series, STEP, N2)
    assert count == 1
    assert np.flatnonzero(np.isnan(cleaned)).tolist() == [100, 2000]


def test_too_short_or_too_slow_a_series_is_left_alone() -> None:
    short = np.ones(50)
    assert reject_outliers(short, STEP, N2)[0] is short
    marks = np.random.default_rng(0).normal(size=500)
    cleaned, count, noise = reject_outliers(marks, 0.5, N2)
    assert cleaned is marks
    assert count == 0
    assert np.isnan(noise)


def test_a_series_without_readings_has_no_noise() -> None:
    cleaned, count, noise = reject_outliers(np.full(500, np.nan), STEP, N2)
    assert np.isnan(cleaned).all()
    assert count == 0
    assert np.isnan(noise)


def test_noise_free_readings_are_not_rejected_for_rounding() -> None:
    assert reject_outliers(THETA, STEP, N2)[1] == 0


# gaps -----------------------------------------------------------------------------------------------------------


def test_a_whole_series_is_returned_itself() -> None:
    assert bridge(THETA, STEP, N2)[0] is THETA


def test_what_lies_in_the_basis_is_restored_exactly() -> None:
    tau = TIME - 100.0
    inside = 0.01 * (1 + 1e-3 * tau) * np.cos(N2 * TIME + 0.3) + 0.02 + 1e-3 * tau
    for start, length in ((0, 20), (1000, 30), (2000, 300), (4980, 20)):
        broken = inside.copy()
        broken[start : start + length] = np.nan
        filled = bridge(broken, STEP, N2)[0]
        assert np.abs(filled - inside).max() < 1e-10
        assert np.array_equal(filled[np.isfinite(broken)], broken[np.isfinite(broken)])


@pytest.mark.parametrize(("seconds", "limit"), [(0.1, 3e-6), (0.5, 8e-5), (1.0, 1.6e-3), (2.0, 2.5e-2)])
def test_short_gaps_in_swell(seconds: float, limit: float) -> None:
    """Noise-free, swell of 50 mrad: a gap of 0.1 s costs microradians, one of 2 s ten milliradians."""
    broken, length = THETA.copy(), round(seconds / STEP)
    for start in (700, 2100, 4000):
        broken[start : start + length] = np.nan
    assert np.abs(bridge(broken, STEP, N2)[0] - THETA).max() < limit


def test_a_gap_without_neighbours_stays_a_gap() -> None:
    length = 5
    series = np.full(400, np.nan)
    series[200 : 200 + length] = 0.01
    filled = bridge(series, STEP, N2)[0]
    assert np.isnan(filled).sum() == 400 - length
    assert np.isnan(bridge(np.full(100, np.nan), STEP, N2)[0]).all()


def test_a_long_gap_is_bridged_by_the_swing_without_a_polynomial_swinging_across() -> None:
    free = 0.01 * np.cos(N2 * TIME) + 0.01 * np.cos(2 * np.pi * TIME / 9.0)
    broken = free.copy()
    broken[2000:2500] = np.nan
    assert np.abs(bridge(broken, STEP, N2)[0][2000:2500]).max() < 0.1
