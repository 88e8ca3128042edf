"""Wild readings: found, not over-found, the noise told."""

from __future__ import annotations

import numpy as np
import pytest
from exact_pair import N2, Pair, swell

from pipeline.prepared import outliers_and_noise

STEP = 0.04
TIME = np.arange(5000) * STEP
THETA = Pair.apart(1e-4, forcing=swell(12, 0.05)).elongation(0, TIME)
SIGMA = 5e-5


def noisy(seed: int = 0) -> np.ndarray:
    return THETA + np.random.default_rng(seed).normal(0.0, SIGMA, TIME.size)


def test_clean_readings_are_left_alone() -> None:
    found = [outliers_and_noise(noisy(seed), STEP, N2) for seed in range(4)]
    assert [noise for _, noise in found] == pytest.approx([SIGMA] * 4, rel=0.05)  # 5000 residuals that share neighbours
    # of 20 000 Gaussian readings 2e-9 each exceed six sigmas; the scale's own error allows one
    assert sum(wild for wild, _ in found) <= 1


@pytest.mark.parametrize("size", [20.0, -12.0])
def test_one_wild_reading_is_found(size: float) -> None:
    series = noisy()
    series[2000] += size * SIGMA
    wild, noise = outliers_and_noise(series, STEP, N2)
    assert wild
    assert noise == pytest.approx(SIGMA, rel=0.05)


def test_missing_readings_are_not_wild() -> None:
    series = noisy(3)
    series[100] = np.nan
    series[1500:1650] = np.nan
    assert not outliers_and_noise(series, STEP, N2)[0]


@pytest.mark.parametrize(
    ("series", "step"),
    [(np.ones(50), STEP), (np.random.default_rng(0).normal(size=500), 0.5), (np.full(500, np.nan), STEP)],
    ids=["too short", "too slow", "no readings"],
)
def test_where_neighbours_do_not_tell_there_is_no_noise(series: np.ndarray, step: float) -> None:
    wild, noise = outliers_and_noise(series, step, N2)
    assert not wild
    assert np.isnan(noise)


def test_noise_free_readings_are_not_wild_for_rounding() -> None:
    assert not outliers_and_noise(THETA, STEP, N2)[0]
