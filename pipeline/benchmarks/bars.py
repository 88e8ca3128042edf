"""Suite `bars`: promised accuracy, statistics and cost as rows (bar, value, limit, pass).

Cost is that of methods beside a Hilbert transform, of the command line beside its imports, and what is imported in
vain. Times are processor times; rivals take turns in one run, and a bar is the median of the ratios, with their range.

What whole suites promise is in their own rows: `corrections`, `paper`, `stability`, `integrators`, `film`, `batch`.
"""

from __future__ import annotations

import json
import math
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import data_schemas
from data_schemas.scene import Scene
from pipeline.benchmarks import bars_joint
from pipeline.benchmarks.paper import marks_error, neglected_terms, plain_error
from pipeline.benchmarks.scenes import (
    beats_through_zero,
    linear,
    outcome,
    prepared,
    real,
    real_heave,
    reduce_all,
    resonant,
    swell,
)
from pipeline.benchmarks.tables import Row, at_most, command, hilbert, holds, reported, rounds, times
from pipeline.methods import PAIR_METHODS, method
from pipeline.observation import observe
from pipeline.prepared import prepare
from pipeline.reduction import reduce_by
from synth import simulate

DURATION = 1800.0
"""s, at 25 Hz."""
FORBIDDEN = ("scipy.signal", "matplotlib", "dask", "pydantic")
"""What no method of one difference may import."""
OF_OTHER_TERMS = ("numba", "scipy", "synth.assembly", "synth.integrators", "synth.systems", "synth.propagators.picard")
"""What a scene of linear pendulums under harmonics may not import."""
# xarray imports dask wherever it is installed, so it is hidden: ours must not
_PROBE = """\
import sys; sys.modules['dask'] = None; {}; \
import json; print(json.dumps([name for name, module in sys.modules.items() if module]))"""
_SIMULATE = "from data_schemas.scene import Scene; import synth; synth.simulate(Scene.model_validate_json(sys.argv[1]))"
_PROCESS = """\
import data_schemas; from pipeline.processing import process; from pipeline.summary import summaries; \
result = process(data_schemas.read(sys.argv[1]), method=sys.argv[2].split(',')); summaries(result); \
data_schemas.write(result, sys.argv[1] + '.result.nc', overwrite=True)"""


def run(*, quick: bool, folder: Path | None) -> Iterator[Row]:
    """Yield every bar. Quick: fewer seeds, with limits as much wider as chance asks."""
    yield from _wrong_by_nature()
    yield from _through_zero()
    yield from _nonlinear()
    yield from _browne()
    yield from bars_joint.rows(quick=quick)
    yield from costs(quick=quick)


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


def costs(*, quick: bool) -> Iterator[Row]:
    """Yield the bars of cost."""
    repeats = 7 if quick else 15
    yield from _estimation(linear(duration=DURATION), {"projection": 1.0}, 1e-6, repeats)
    yield from _estimation(real(duration=DURATION), {"shooting": 3.9, "general": 2.0}, 1e-5, repeats)
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "linear.record.nc"
        data_schemas.write(simulate(linear(duration=DURATION))[0], path)
        yield from _start_up(path, 3 if quick else 9)
        found = in_vain(modules(_PROCESS, str(path), ",".join(PAIR_METHODS)), FORBIDDEN)
        yield at_most("process, methods of one difference: imports in vain", len(found), 0.0, " ".join(found))
    found = in_vain(modules(_SIMULATE, linear(duration=60.0).model_dump_json()), OF_OTHER_TERMS)
    yield at_most("simulate, linear pendulums: imports of other terms", len(found), 0.0, " ".join(found))


def _estimation(scene: Scene, limits: dict[str, float], exact: float, repeats: int) -> Iterator[Row]:
    """Methods against hilbert + unwrap + polyfit on the same samples; the first must be exact besides."""
    seen = observe(simulate(scene)[0])
    calls: dict[str, Callable[[], Any]] = {
        name: partial(lambda name: method(name)(prepare(seen)), name) for name in limits
    }
    taken = rounds({"hilbert": partial(hilbert, seen.difference)} | calls, repeats, batch=5)
    words = f"{seen.time.size} samples"
    for name, limit in limits.items():
        yield times(f"{name}, {words}: times hilbert + unwrap + polyfit", taken[name], taken["hilbert"], limit)
    first = next(iter(limits))
    error = outcome(reduce_by(first, prepare(seen), 0.0), scene.gravity).error
    yield at_most(f"{first}, {words}: error, noise-free", abs(error), exact, "mGal")


def _start_up(path: Path, repeats: int) -> Iterator[Row]:
    """The command line from start to exit, every program in a process of its own."""
    process = ("process", str(path), "--method", "projection", "-o", str(path.with_suffix(".result")), "--force")
    for label, words, imports, limit in (
        ("isochrony --help", ("--help",), "import numpy", 3.0),
        ("isochrony process", process, "import numba, xarray, h5netcdf", 2.5),
    ):
        rivals = (command(sys.executable, *each) for each in (("-m", "pipeline.cli", *words), ("-c", imports)))
        taken = rounds(dict(zip(("own", "rival"), rivals, strict=True)), repeats)
        yield times(f'{label}, start to exit: times python -c "{imports}"', taken["own"], taken["rival"], limit)


def modules(program: str, *words: str) -> set[str]:
    """What a process of its own has imported after a program."""
    return set(json.loads(command(sys.executable, "-c", _PROBE.format(program), *words)()))


def in_vain(loaded: set[str], forbidden: Sequence[str]) -> list[str]:
    """Which forbidden modules, or packages of modules, were loaded."""
    return [name for name in forbidden if any(f"{each}.".startswith(f"{name}.") for each in loaded)]
