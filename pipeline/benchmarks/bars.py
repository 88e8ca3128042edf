"""Suite `bars`: promised accuracy, statistics and cost as rows (bar, value, limit, pass).

What whole suites promise is in their own rows: `corrections`, `paper`, `stability`, `integrators`, `film`, `batch`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pipeline.benchmarks import bars_joint, bars_speed
from pipeline.benchmarks.bar import at_most, holds, reported
from pipeline.benchmarks.paper import marks_error, neglected_terms, plain_error
from pipeline.benchmarks.scenes import beats_through_zero, linear, real, real_heave, resonant, swell
from pipeline.benchmarks.tables import Row
from pipeline.benchmarks.trials import outcome, prepared, reduce_all
from pipeline.reduction import reduce_by


def run(*, quick: bool, folder: Path | None) -> Iterator[Row]:
    """Yield every bar. Quick: fewer seeds, with limits as much wider as chance asks."""
    yield from _wrong_by_nature()
    yield from _through_zero()
    yield from _nonlinear()
    yield from _browne()
    yield from bars_joint.rows(quick=quick)
    yield from bars_speed.rows(quick=quick)


def _wrong_by_nature() -> Iterator[Row]:
    """Methods that are wrong must be wrong by what physics says, within 1 %."""
    scene = linear()
    found = reduce_all(scene, ("vening-meinesz", "uncorrected"))
    for name, expected, source in (
        ("vening-meinesz", marks_error(scene), "(14) on truth"),
        ("uncorrected", plain_error(scene), "the true phase's slope"),
    ):
        off = abs(found[name].error / expected - 1.0)
        yield at_most(f"linear: {name} {found[name].error:.4g} mGal, off {source} {expected:.4g} by", off, 0.01)
    ready = prepared(linear(damping_rates=(0.0, 0.0), write_restoring=False, write_damping=False))
    error = outcome(reduce_by("general", ready, 0.0), scene.gravity).error
    expected = -neglected_terms(ready)["finite_arc"]
    off = abs(error / expected - 1.0)
    yield at_most(f"linear, nothing stated: general {error:.4g} mGal, off its arc terms {expected:.4g} by", off, 0.01)


def _through_zero() -> Iterator[Row]:
    found = reduce_all(beats_through_zero(), ("projection", "panteleev"))
    yield at_most("beats through zero: projection", abs(found["projection"].error), 1e-2, "mGal")
    flagged = "beats-through-zero" in found["projection"].flags
    yield holds("beats through zero: projection carries the flag", flagged, "flag beats-through-zero")
    yield holds("beats through zero: panteleev declines", bool(found["panteleev"].refusal), "refused")


def _nonlinear() -> Iterator[Row]:
    """Real pendulums in heavy swell and near-resonant vibration, and in heave that is recorded."""
    found = reduce_all(real(motion=[swell(), resonant(1e-5)]), ("shooting", "general"))
    yield at_most("nonlinear: shooting", abs(found["shooting"].error), 0.005, "mGal")
    yield at_most("nonlinear: general", abs(found["general"].error), 0.1, "mGal")
    found = reduce_all(real_heave(), ("shooting", "general"))
    yield at_most("nonlinear, heave recorded: shooting", abs(found["shooting"].error), 0.005, "mGal")
    yield reported("nonlinear, heave recorded: general", abs(found["general"].error), "mGal")


def _browne() -> Iterator[Row]:
    """One harmonic of 0.1 m/s2 at 10 s moves gravity of a linear reduction by what Browne says; shooting removes it."""
    rest = reduce_all(real(motion=[]), ("projection",))["projection"].error
    for axis, expected in (("horizontal", 25.48), ("vertical", -12.78)):
        shifts, left = [], []
        for phase in (0.0, math.pi):  # what a wave does at the ends of the record has its sign
            wave = {"kind": "harmonics", "axis": axis, "amplitude": [0.1], "period": [10.0], "phase": [phase]}
            found = reduce_all(real(motion=[wave], vertical_acceleration=True), ("projection", "shooting"))
            shifts.append(found["projection"].error - rest)
            left.append(abs(found["shooting"].error))
        shift, bar = float(np.mean(shifts)), f"Browne, 0.1 m/s2 at 10 s, {axis}"
        yield at_most(f"{bar}: seen {shift:.3f} mGal, off {expected} by", abs(shift - expected), 0.02, "mGal")
        yield at_most(f"{bar}: left by shooting", max(left), 0.02, "mGal")
