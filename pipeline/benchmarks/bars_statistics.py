"""Bars over many noise seeds: efficiency against the Cramer-Rao bound, honest uncertainty, rare flags."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from data_schemas.scene import Scene
from pipeline.benchmarks.bar import Row, at_most, between, of_few
from pipeline.benchmarks.fisher import gravity_bound
from pipeline.benchmarks.scenes import linear, real, real_heave
from pipeline.benchmarks.trials import campaign

NOISE = 1e-4  # rad
EFFICIENCY, COVERAGE, CLEAN, DAMPED = 400, 2000, 200, 30
QUICK_EFFICIENCY, QUICK_COVERAGE = 60, 200


def rows(*, quick: bool) -> Iterator[Row]:
    """Yield the statistical bars; their seeds are fixed. Quick: fewer, with limits as much wider as chance asks."""
    seeds = QUICK_EFFICIENCY if quick else EFFICIENCY
    for eps in (1e-5, 3e-6):
        for rate in (25, 10):
            scene = linear(eps, noise=NOISE, sampling_rate=rate)
            yield from _efficiency(f"linear, eps {eps:g}, {rate} Hz", scene, ("projection", "complex"), seeds)
    # the bound is that of linear pendulums of the same arcs, in the same swell: the arcs carry no more than that
    yield from _efficiency("real, eps 1e-5, 25 Hz", real(1e-5, noise=NOISE), ("shooting",), seeds)
    yield from _damped()
    records = QUICK_COVERAGE if quick else COVERAGE
    yield from _uncertainty("linear", kinds_linear(), "projection", records, 10_000)
    yield from _uncertainty("real", kinds(), "shooting", records, 30_000)
    yield from _flags()


def _efficiency(words: str, scene: Scene, methods: Sequence[str], seeds: int) -> Iterator[Row]:
    bound = gravity_bound(scene)
    for name, each in campaign(scene, methods, seeds).items():
        bar = f"efficiency, {words}: {name}, RMSE/CRLB ({bound:.4f} mGal) of {seeds}"
        yield at_most(bar, each.rmse / bound, of_few(1.1, seeds, EFFICIENCY))


def _damped() -> Iterator[Row]:
    found = campaign(linear(noise=NOISE), ("shooting",), DAMPED)["shooting"]
    bar = f"linear with damping, noise 1e-4: shooting, {{}} of {DAMPED}"
    yield at_most(bar.format("r.m.s."), found.rmse, 0.08, "mGal")
    yield at_most(bar.format("bias"), abs(float(found.errors.mean())), 0.03, "mGal")


def kinds_linear() -> dict[str, Scene]:
    """Two kinds of linear records whose uncertainty has different sources."""
    return {
        "eps 1e-5, noise of the difference": linear(1e-5, noise=NOISE),
        "eps 1e-3, noise of the first pendulum": linear(1e-3, noise=NOISE),
    }


def kinds() -> dict[str, Scene]:
    """Three kinds of real records whose uncertainty has different sources."""
    return {
        "swell": real(noise=NOISE),
        "eps 1e-3": real(1e-3, noise=NOISE),
        "heave recorded": real_heave(noise=NOISE),
    }


def _uncertainty(words: str, scenes: dict[str, Scene], method: str, records: int, first_seed: int) -> Iterator[Row]:
    """The root mean square error over the mean sigma in each kind, and the 95 % interval over all kinds together."""
    count = records // len(scenes)
    margin = max(0.1, 3.0 / math.sqrt(2 * count))  # scatter of a root mean square
    hits = []
    for name, scene in scenes.items():
        found = campaign(scene, (method,), count, first_seed)[method]
        hits.append(found.covered())
        ratio = found.rmse / float(np.mean(found.sigmas))
        yield between(f"{words}, {name}: RMSE/mean sigma of {count}", ratio, 1.0 - margin, 1.0 + margin)
    half = 0.015 if records >= COVERAGE else 3.0 * math.sqrt(0.95 * 0.05 / records)
    bar = f"{words} pendulums: 95 % interval holds the truth, share of {records}"
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
