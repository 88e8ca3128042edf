"""Bars on cost: methods beside a Hilbert transform, the command line beside its imports, what is imported in vain.

Times are processor times; rivals take turns in one run, and a bar is the median of the ratios, with their range.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import data_schemas
from data_schemas.scene import Scene
from pipeline.benchmarks.bar import at_most
from pipeline.benchmarks.clock import command, hilbert, rounds, times
from pipeline.benchmarks.scenes import linear, real
from pipeline.benchmarks.tables import Row
from pipeline.benchmarks.trials import outcome
from pipeline.methods import PAIR_METHODS, method
from pipeline.observation import Observation, observe
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


def rows(*, quick: bool) -> Iterator[Row]:
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
    calls: dict[str, Callable[[], Any]] = {name: partial(_estimate, seen, name) for name in limits}
    taken = rounds({"hilbert": partial(hilbert, seen.difference)} | calls, repeats, batch=5)
    words = f"{seen.time.size} samples"
    for name, limit in limits.items():
        yield times(f"{name}, {words}: times hilbert + unwrap + polyfit", taken[name], taken["hilbert"], limit)
    first = next(iter(limits))
    error = outcome(reduce_by(first, prepare(seen), 0.0), scene.gravity).error
    yield at_most(f"{first}, {words}: error, noise-free", abs(error), exact, "mGal")


def _estimate(seen: Observation, name: str) -> Any:
    return method(name)(prepare(seen))


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
