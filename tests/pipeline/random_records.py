"""Random noisy observations of two kinds, from the closed form, for the tests of stated uncertainties."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from exact_pair import G, Pair, swell

from pipeline.observation import Observation
from pipeline.prepared import prepare
from pipeline.reduction import reduce_by

SIGMA = 2e-5  # rad
KINDS = ("plain", "damped")


def observation(kind: str, eps: float, seed: int) -> Observation:
    """`plain` 300 s at 10 Hz; `damped`, stated."""
    random = np.random.default_rng([seed, KINDS.index(kind)])
    step, count = 0.1, 3000
    time = np.arange(count) * step
    damping = (3e-4, 2e-4) if kind == "damped" else (0.0, 0.0)
    # one amplitude of the difference for all, so that RMSE over mean sigma means what it says
    one, difference = 0.012 * np.exp(2j * np.pi * random.random(2))
    two = one - difference
    pair = Pair.apart(eps, damping=damping, free=(one, two), forcing=swell(8, 0.02, int(random.integers(1 << 30))))
    seen = pair.observe(time, step=step, sigma_theta=SIGMA, sigma_difference=SIGMA)
    series = [values + random.normal(0.0, SIGMA, count) for values in (seen.theta, seen.difference)]
    return pair.observe(
        time, step=step, theta=series[0], difference=series[1], sigma_theta=SIGMA, sigma_difference=SIGMA
    )


@dataclass(frozen=True)
class Outcome:
    """Errors and stated sigmas, mGal, and how many carried which flag."""

    errors: np.ndarray
    sigmas: np.ndarray
    flags: dict[str, int]

    @property
    def coverage(self) -> float:
        return float(np.mean(np.abs(self.errors) <= 1.959964 * self.sigmas))

    @property
    def ratio(self) -> float:
        """RMS of error over its own sigma: RMSE over mean sigma where all records say alike.

        Sigmas of records that beat through zero differ by ten times; a ratio of means would be that of a few of them.
        """
        return float(np.sqrt(np.mean(np.square(self.errors / self.sigmas))))


def many(kind: str, eps: float, methods: tuple[str, ...], count: int, first: int = 0) -> dict[str, Outcome]:
    found: dict[str, list[tuple[float, float]]] = {method: [] for method in methods}
    flags: dict[str, dict[str, int]] = {method: {} for method in methods}
    for seed in range(first, first + count):
        prepared = prepare(observation(kind, eps, seed))
        for method in methods:
            reduced = reduce_by(method, prepared, 0.0)
            assert reduced.gravity is not None, (seed, reduced.error)
            found[method].append(((reduced.gravity.gravity - G) * 1e5, reduced.gravity.sigma))
            for flag in reduced.flags:
                flags[method][flag] = flags[method].get(flag, 0) + 1
    return {
        method: Outcome(*(np.array(column) for column in zip(*rows, strict=True)), flags[method])
        for method, rows in found.items()
    }
