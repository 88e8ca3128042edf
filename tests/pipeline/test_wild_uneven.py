"""Wild readings at uneven times: those alone are out, and the grid is as without them."""

from __future__ import annotations

import numpy as np
import pytest
from exact_pair import Pair, swell

from pipeline.prepared import prepare
from pipeline.uneven_grid import grid_step, reject_uneven, to_grid

N = 6.22


def record(noise: float) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(3)
    time = np.arange(6000) * 0.05 + 0.008 * random.uniform(-1.0, 1.0, 6000)
    time -= time[0]
    theta = Pair.apart(1e-4, forcing=swell(8, 0.03)).elongation(0, time)
    return time, theta + noise * random.normal(size=time.size)


def test_wild_readings_alone_are_out() -> None:
    time, theta = record(1e-5)
    step = grid_step(time, N)
    clean, grid, none, noise = reject_uneven(time, theta, step, N)
    assert clean is theta
    assert none == 0
    assert noise == pytest.approx(1e-5, rel=0.06)
    assert np.array_equal(grid, to_grid(time, theta, step, N))
    places = np.array([100, 103, 2500, 4000, 5990])
    wild = theta.copy()
    wild[places] += np.array([2e-3, -1e-3, 5e-4, -2e-2, 1e-3])
    cleaned, found, count, _ = reject_uneven(time, wild, step, N)
    assert count == 5
    assert np.array_equal(np.flatnonzero(np.isnan(cleaned)), places)
    assert np.nanmax(np.abs(found - grid)) < 1e-4


def test_the_wild_reading_is_to_blame_not_those_that_a_fit_through_it_misses() -> None:
    """61 pairs of wild readings: they once took four hundred others along, and some were kept themselves."""
    random = np.random.default_rng(4)
    time, theta = record(1e-6)
    step = grid_step(time, N)
    first = np.arange(60, 5900, 97)
    places = np.sort(np.concatenate([first, first + random.integers(1, 5, first.size)]))
    wild = theta.copy()
    wild[places] += 0.04 * random.choice([-1.0, 1.0], places.size)
    cleaned, _, count, noise = reject_uneven(time, wild, step, N)
    assert count == places.size
    assert np.array_equal(np.flatnonzero(np.isnan(cleaned)), places)
    assert noise == pytest.approx(1e-6, rel=0.1)


def test_few_readings_a_swing_tell_no_noise() -> None:
    time, theta = record(1e-5)
    time, theta = time[::4], theta[::4]
    assert np.isnan(reject_uneven(time, theta, grid_step(time, N), N)[3])


def test_a_record_is_prepared_without_them() -> None:
    time, theta = record(1e-5)
    pair = Pair.apart(1e-4, forcing=swell(8, 0.03))
    wild = theta.copy()
    wild[[700, 3000]] += 0.01
    difference = pair.difference(time)
    seen = pair.observe(time, theta=wild, difference=difference)
    ready = prepare(seen)
    assert np.isnan(ready.observation.theta).sum() == 2
    assert np.nanmax(np.abs(ready.whole - prepare(pair.observe(time, theta=theta, difference=difference)).whole)) < 1e-4
