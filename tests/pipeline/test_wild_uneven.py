"""Wild readings at uneven times: those alone are out, and the grid is as without them."""

from __future__ import annotations

import numpy as np
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
    clean, grid, none = reject_uneven(time, theta, step, N)
    assert clean is theta
    assert none == 0
    assert np.array_equal(grid, to_grid(time, theta, step, N))
    places = np.array([100, 103, 2500, 4000, 5990])
    wild = theta.copy()
    wild[places] += np.array([2e-3, -1e-3, 5e-4, -2e-2, 1e-3])
    cleaned, found, count = reject_uneven(time, wild, step, N)
    assert count == 5
    assert np.array_equal(np.flatnonzero(np.isnan(cleaned)), places)
    assert np.nanmax(np.abs(found - grid)) < 1e-4


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
