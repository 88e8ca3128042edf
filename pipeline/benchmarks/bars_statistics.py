"""Bars over many noise seeds: efficiency against the Cramer-Rao bound, honest uncertainty, rare flags."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from data_schemas.scene import Scene
from pipeline.benchmarks.bar import Row, at_most, between, of_few
from pipeline.benchmarks.efficiency import gravity_bound
from pipeline.benchmarks.scenes import linear
from pipeline.benchmarks.trials import campaign

NOISE = 1e-4  # rad
EFFICIENCY, COVERAGE, CLEAN = 400, 2000, 200
QUICK_EFFICIENCY, QUICK_COVERAGE = 60, 200


def rows(*, quick: bool) -> Iterator[Row]:
    """Yield the statistical bars; their seeds are fixed."""
    seeds = QUICK_EFFICIENCY if quick else EFFICIENCY
    yield from _efficiency(seeds)
    yield from _uncertainty(QUICK_COVERAGE if quick else COVERAGE)
    yield from _flags()


def _efficiency(seeds: int) -> Iterator[Row]:
    limit = of_few(1.1, seeds, EFFICIENCY)
    for eps in (1e-5, 3e-6):
        for rate in (25, 10):
            scene = linear(eps, noise=NOISE, sampling_rate=rate)
            bound = gravity_bound(scene)
            found = campaign(scene, ("projection", "complex"), seeds)
            for name, each in found.items():
                bar = f"efficiency, eps {eps:g}, {rate} Hz: {name}, RMSE/CRLB ({bound:.4f} mGal) of {seeds}"
                yield at_most(bar, each.rmse / bound, limit)


def kinds() -> dict[str, Scene]:
    """Two kinds of records whose uncertainty has different sources."""
    return {
        "eps 1e-5, noise of the difference": linear(1e-5, noise=NOISE),
        "eps 1e-3, noise of the first pendulum": linear(1e-3, noise=NOISE),
    }


def _uncertainty(records: int) -> Iterator[Row]:
    """The 95 % interval over all kinds together, and the root mean square error over the mean sigma in each."""
    each_kind = records // 2
    hits = []
    scatter = 3.0 / math.sqrt(2 * each_kind)  # of a root mean square
    margin = max(0.1, scatter)
    for words, scene in kinds().items():
        found = campaign(scene, ("projection",), each_kind, first_seed=10_000)["projection"]
        hits.append(found.covered())
        ratio = found.rmse / float(np.mean(found.sigmas))
        yield between(f"uncertainty, {words}: RMSE/mean sigma of {each_kind}", ratio, 1.0 - margin, 1.0 + margin)
    half = 0.015 if records >= COVERAGE else 3.0 * math.sqrt(0.95 * 0.05 / records)
    bar = f"uncertainty: 95 % interval holds the truth, share of {records}"
    yield between(bar, float(np.mean(hits)), 0.95 - half, min(0.95 + half, 1.0))


def _flags() -> Iterator[Row]:
    clean = (
        linear(1e-5, noise=NOISE),
        linear(1e-4, noise=NOISE, sampling_rate=10),
        linear(1e-5, noise=NOISE, damping_rates=(0.0, 0.0), write_damping=False),
    )
    found = [
        campaign(scene, ("projection",), CLEAN // len(clean), first_seed=20_000 + 1000 * number)["projection"]
        for number, scene in enumerate(clean)
    ]
    share = float(np.mean([each.flagged for each in found]))
    names = sorted({name for each in found for name in each.raised})
    yield at_most(f"clean records that carry a flag, share of {CLEAN}", share, 0.01, " ".join(names))
