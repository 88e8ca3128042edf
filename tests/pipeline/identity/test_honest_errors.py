"""The stated uncertainty of `shooting`: numerics and noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from heavy_pair import observe
from test_shooting import error, thinned


@pytest.mark.parametrize("every", [1, 2, 3])
def test_numerical_error_is_stated(every: int) -> None:
    """Noise-free, heave recorded, 25 to 8 Hz: the error grows a ten-thousandfold, and sigma with it."""
    seen = observe(300.0, 0.04, heave=True)
    found = seen if every == 1 else thinned(seen, slice(None, None, every), 0.04 * every)
    off, sigma, _ = error(found)
    assert abs(off) < 4.0 * sigma
    assert sigma < (2e-3, 2e-2, 0.4)[every - 1]


@pytest.mark.compiled
@pytest.mark.parametrize("count", [25, pytest.param(100, marks=pytest.mark.campaign)])
def test_95_per_cent_of_short_records(count: int) -> None:
    """Binomial, at most three sigmas off."""
    hits, ratios = [], []
    for heave in (True, False):
        seen = observe(600.0, 0.1, heave=heave)
        for seed in range(count):
            random = np.random.default_rng([seed, 13, heave])
            theta, difference = (s + random.normal(0.0, 1e-4, s.size) for s in (seen.theta, seen.difference))
            off, sigma, _ = error(replace(seen, theta=theta, difference=difference))
            hits.append(abs(off) < 1.96 * sigma)
            ratios.append(off / sigma)
    assert abs(np.mean(hits) - 0.95) < 3.0 * np.sqrt(0.95 * 0.05 / len(hits))
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1.0, abs=3.0 / np.sqrt(2.0 * len(hits)))
    assert abs(np.mean(ratios)) < 3.0 / np.sqrt(len(hits))
