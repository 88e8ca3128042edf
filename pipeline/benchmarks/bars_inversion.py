"""Bars of the nonlinear inversion: accuracy, efficiency, honest uncertainty, speed."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from data_schemas.scene import Scene
from pipeline.benchmarks import speed
from pipeline.benchmarks.bar import Row, at_most, between, of_few, reported
from pipeline.benchmarks.efficiency import gravity_bound
from pipeline.benchmarks.scenes import linear, resonant, swell
from pipeline.benchmarks.scenes_real import real, real_heave
from pipeline.benchmarks.trials import campaign, reduce_all

NOISE = 1e-4  # rad
EFFICIENCY, COVERAGE, DAMPED = 400, 2000, 30
QUICK_EFFICIENCY, QUICK_COVERAGE = 60, 200
BROWNE_AMPLITUDE, BROWNE_PERIOD = 0.1, 10.0  # m s-2, s


def rows(*, quick: bool) -> Iterator[Row]:
    """Yield the bars; quick: fewer records, with limits as much wider as chance asks."""
    yield from _exact()
    yield from _browne()
    yield from _efficiency(QUICK_EFFICIENCY if quick else EFFICIENCY)
    yield from _uncertainty(QUICK_COVERAGE if quick else COVERAGE)
    yield from _speed(quick=quick)


def nonlinear() -> Scene:
    """Real pendulums in heavy swell and near-resonant vibration."""
    return real(motion=[swell(), resonant(1e-5)])


def _exact() -> Iterator[Row]:
    found = reduce_all(nonlinear(), ("shooting", "general"))
    yield at_most("nonlinear: shooting", abs(found["shooting"].error), 0.005, "mGal")
    yield at_most("nonlinear: general", abs(found["general"].error), 0.1, "mGal")
    found = reduce_all(real_heave(), ("shooting", "general"))
    yield at_most("nonlinear, heave recorded: shooting", abs(found["shooting"].error), 0.005, "mGal")
    yield reported("nonlinear, heave recorded: general", abs(found["general"].error), "mGal")


def _browne() -> Iterator[Row]:
    """One harmonic of 0.1 m/s2 at 10 s moves gravity of a linear reduction by what Browne says; shooting removes it."""
    for axis, expected in (("horizontal", 25.48), ("vertical", -12.78)):
        rest = reduce_all(real(motion=[]), ("projection",))["projection"].error
        shifts, left = [], []
        for phase in (0.0, math.pi):  # what a wave does at the ends of the record has its sign
            wave = {
                "kind": "harmonics",
                "axis": axis,
                "amplitude": [BROWNE_AMPLITUDE],
                "period": [BROWNE_PERIOD],
                "phase": [phase],
            }
            found = reduce_all(real(motion=[wave], vertical_acceleration=True), ("projection", "shooting"))
            shifts.append(found["projection"].error - rest)
            left.append(abs(found["shooting"].error))
        shift, bar = float(np.mean(shifts)), f"Browne, 0.1 m/s2 at 10 s, {axis}"
        yield at_most(f"{bar}: seen {shift:.3f} mGal, off {expected} by", abs(shift - expected), 0.02, "mGal")
        yield at_most(f"{bar}: left by shooting", max(left), 0.02, "mGal")


def _efficiency(seeds: int) -> Iterator[Row]:
    """The bound is that of linear pendulums of the same arcs, in the same swell: the arcs carry no more than that."""
    scene = real(1e-5, noise=NOISE)
    bound = gravity_bound(scene)
    found = campaign(scene, ("shooting",), seeds)["shooting"]
    bar = f"psi 0.03 rad, noise 1e-4: shooting, RMSE/CRLB ({bound:.4f} mGal) of {seeds}"
    yield at_most(bar, found.rmse / bound, of_few(1.1, seeds, EFFICIENCY))
    damped = campaign(linear(noise=NOISE), ("shooting",), DAMPED)["shooting"]
    yield at_most(f"linear with damping, noise 1e-4: shooting, r.m.s. of {DAMPED}", damped.rmse, 0.08, "mGal")
    yield at_most(
        f"linear with damping, noise 1e-4: shooting, bias of {DAMPED}", abs(float(damped.errors.mean())), 0.03, "mGal"
    )


def kinds() -> dict[str, Scene]:
    """Three kinds of real records whose uncertainty has different sources."""
    return {
        "swell": real(noise=NOISE),
        "eps 1e-3": real(1e-3, noise=NOISE),
        "heave recorded": real_heave(noise=NOISE),
    }


def _uncertainty(records: int) -> Iterator[Row]:
    hits = [
        campaign(scene, ("shooting",), records // 3, first_seed=30_000)["shooting"].covered()
        for scene in kinds().values()
    ]
    half = 0.015 if records >= COVERAGE else 3.0 * math.sqrt(0.95 * 0.05 / records)
    bar = f"real pendulums: 95 % interval holds the truth, share of {records}"
    yield between(bar, float(np.mean(hits)), 0.95 - half, min(0.95 + half, 1.0))


def _speed(*, quick: bool) -> Iterator[Row]:
    limits = {"shooting": 3.9, "general": 2.0}
    for row in speed.inversion(quick=quick):
        name = row["what"].split(",")[0]
        yield at_most(f"{row['what']}: share of the time of {row['rival']}", row["share_of_rival"], limits[name])
        if name == "shooting":
            yield at_most(f"{row['what']}: error, noise-free", row["error_mgal"], 1e-5, "mGal")
