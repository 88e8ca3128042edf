"""Suite `speed`: the estimator against a Hilbert transform, and the command line against its own imports.

Rivals take turns in one run, kernels compiled; figures that are promised are ratios.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import data_schemas
from pipeline.benchmarks.clock import command, median_ratio, rounds
from pipeline.benchmarks.scenes import GRAVITY, linear
from pipeline.benchmarks.scenes_real import real
from pipeline.benchmarks.trials import outcome
from pipeline.estimate import Estimate
from pipeline.methods import method
from pipeline.observation import Observation, observe
from pipeline.prepared import prepare
from pipeline.reduction import Reduction, reduce_by
from synth import simulate

SIZES = (45000, 45001)
"""30 minutes at 25 Hz; the second is 11 x 4091, a slow length for a Fourier transform."""


def run(*, quick: bool, folder: Path | None) -> Iterator[dict[str, Any]]:
    """Yield one row a timed thing: ms, its rival's ms, and their ratio."""
    yield from estimation(quick=quick)
    yield from inversion(quick=quick)
    yield from start_up(quick=quick)


def estimation(*, quick: bool) -> Iterator[dict[str, Any]]:
    """Projection, warm and in process, against hilbert + unwrap + polyfit on the same samples."""
    scene = linear(duration=1800.04)
    whole = observe(simulate(scene)[0])
    for size in SIZES:
        seen = replace(whole, time=whole.time[:size], theta=whole.theta[:size], difference=whole.difference[:size])
        calls: dict[str, Callable[[], Any]] = {
            "rival": hilbert(seen),
            "projection": partial(_estimate, seen),
            "prepare alone": partial(prepare, seen),
            "with gravity, error budget and flags": partial(_reduce, seen),
        }
        taken = rounds(calls, repeats=5 if quick else 15, batch=5)
        error = abs(outcome(_reduce(seen), GRAVITY).error)
        for name in tuple(calls)[1:]:
            label = name if name == "projection" else f"projection, {name}"
            row = _row(f"{label}, {size} samples", "hilbert + unwrap + polyfit", taken[name], taken["rival"])
            yield row | {"error_mgal": error if name == "projection" else None}


def inversion(*, quick: bool) -> Iterator[dict[str, Any]]:
    """Nonlinear inversion and its closed form on real pendulums in swell, against the same rival."""
    scene = real()
    whole = observe(simulate(scene)[0])
    size = SIZES[0]
    seen = replace(whole, time=whole.time[:size], theta=whole.theta[:size], difference=whole.difference[:size])
    names = ("shooting", "general")
    calls: dict[str, Callable[[], Any]] = {"rival": hilbert(seen)}
    calls |= {name: partial(_estimate, seen, name) for name in names}
    taken = rounds(calls, repeats=7 if quick else 15, batch=5)
    for name in names:
        row = _row(f"{name}, {size} samples", "hilbert + unwrap + polyfit", taken[name], taken["rival"])
        yield row | {"error_mgal": abs(outcome(reduce_by(name, prepare(seen), 0.0), scene.gravity).error)}


def _estimate(seen: Observation, name: str = "projection") -> Estimate:
    return method(name)(prepare(seen))


def _reduce(seen: Observation) -> Reduction:
    return reduce_by("projection", prepare(seen), 0.0)


def hilbert(seen: Observation) -> Callable[[], float]:
    """What a user of scipy would write: slope of the difference's phase, uncorrected, rad s-1."""
    from scipy.signal import hilbert as analytic

    def call() -> float:
        phase = np.unwrap(np.angle(analytic(seen.difference)))
        return float(np.polyfit(seen.time, phase, 1)[0])

    return call


def start_up(*, quick: bool) -> Iterator[dict[str, Any]]:
    """The command line from start to exit, every program in a process of its own."""
    python = sys.executable
    repeats = 3 if quick else 9
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "linear.record.nc"
        data_schemas.write(simulate(linear())[0], path)
        out = str(Path(name) / "linear.result.nc")
        process = ("process", str(path), "--method", "projection", "-o", out, "--force")
        pairs = {
            "isochrony --help": (("-m", "pipeline.cli", "--help"), "import numpy"),
            "isochrony process, 45000 samples": (("-m", "pipeline.cli", *process), "import numba, xarray, h5netcdf"),
        }
        for label, (words, imports) in pairs.items():
            calls = {"own": command(python, *words), "rival": command(python, "-c", imports)}
            taken = rounds(calls, repeats)
            yield _row(label, f'python -c "{imports}"', taken["own"], taken["rival"]) | {"error_mgal": None}


def _row(what: str, rival: str, own: list[float], other: list[float]) -> dict[str, Any]:
    return {
        "what": what,
        "ms": 1e3 * statistics.median(own),
        "rival": rival,
        "rival_ms": 1e3 * statistics.median(other),
        "share_of_rival": median_ratio(own, other),
    }
