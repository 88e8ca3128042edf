"""Suite `bars`: promised accuracy, statistics and cost as rows (bar, value, limit, pass).

Cost is that of methods beside a Hilbert transform, and of the command line beside its imports, in processor time:
medians of the ratios of rivals that take turns. Of the joint fit: its scatter over the Cramer-Rao bound.
"""

import math
import statistics
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import data_schemas
from data_schemas.scene import Scene
from pipeline.arrays import Floats
from pipeline.benchmarks import scenes
from pipeline.benchmarks.honesty import reduced
from pipeline.benchmarks.kinds import Case
from pipeline.benchmarks.records import of_case
from pipeline.benchmarks.tables import Row, at_most, command, progress, rounds, times
from pipeline.joint.fit import reduce
from pipeline.joint.gather import gather
from pipeline.observation import observe
from pipeline.processing import process
from synth import simulate

COUNT, QUICK_COUNT = 400, 8
RATES = (25, 10, 5, 4, 2)  # Hz
BOUNDS: Mapping[str, tuple[float, ...]] = {
    "linear": (0.0316980921, 0.0501202281, 0.0708831895, 0.0792508909, 0.111878254),
    "real": (0.0245343721, 0.0387933829, 0.0548654326, 0.0613436888, 0.0871394364),
}
"""Cramer-Rao bound of gravity at these rates, mGal, noise 1e-4 rad: from the Fisher matrix of n2 with the first
pendulum's motion unknown, which the tests compute. It is that of linear pendulums of the same arcs and swell: what arcs
tell besides is less than the scatter of the fits."""
BASE = Case(duration=1800.0, rate=25.0, noise=3e-5, swell=(0.015, 0.02), states_heave=True)
FITS: Mapping[str, tuple[Case, float, float, float]] = {
    "linear": (Case(rate=25.0, linear=True), 4.0, 40.0, 250.0),
    "heave recorded": (BASE, 8.0, 120.0, 800.0),
    "heave not recorded": (replace(BASE, states_heave=False), 25.0, 400.0, 2300.0),
}  # Largest CPU time of one pass and of a whole fit, in chains of hilbert + unwrap + polyfit; of a whole record, ms
DURATION = 1800.0  # s, at 25 Hz


def run(*, quick: bool, folder: Path | None) -> Iterator[Row]:
    """Yield every bar. Quick: fewer seeds, with limits as much wider as chance asks."""
    yield from accuracy()
    yield from efficiency(QUICK_COUNT if quick else COUNT)
    yield from costs(quick=quick)


def accuracy() -> Iterator[Row]:
    """One harmonic of 0.1 m/s2 at 10 s moves gravity of a linear reduction by what Browne says; shooting removes it."""
    rest = scenes.errors(scenes.real(motion=[]), "projection")["projection"]
    for axis, expected in (("horizontal", 25.48), ("vertical", -12.78)):
        shifts, left = [], []
        for phase in (0.0, math.pi):  # what a wave does at the ends of the record has its sign
            wave = {"kind": "harmonics", "axis": axis, "amplitude": [0.1], "period": [10.0], "phase": [phase]}
            scene = scenes.real(motion=[wave], vertical_acceleration=True)
            errors = scenes.errors(scene, "projection", "shooting")
            shifts.append(errors["projection"] - rest)
            left.append(abs(errors["shooting"]))
        shift, bar = float(np.mean(shifts)), f"Browne, 0.1 m/s2 at 10 s, {axis}"
        yield at_most(f"{bar}: observed {shift:.3f} mGal, off {expected} by", abs(shift - expected), 0.02, "mGal")
        yield at_most(f"{bar}: left by shooting", max(left), 0.02, "mGal")


def efficiency(count: int) -> Iterator[Row]:
    """Scatter of `joint` over the Cramer-Rao bound, from 25 readings a swing to half-second marks; refusals count."""
    for words, make in (("linear", scenes.linear), ("real", scenes.real)):
        for rate, bound in zip(RATES, BOUNDS[words], strict=True):
            scene, errors = make(1e-5, noise=1e-4, sampling_rate=rate), []
            for seed in progress(range(count), f"{words} at {rate} Hz"):
                drawn = int(np.random.default_rng([seed, 1958]).integers(2**31))
                row = reduced(scenes.made(scene.model_copy(update={"seed": drawn})), "auto")
                errors.append(math.inf if row["refused"] else row["error_mgal"])
            rmse = math.sqrt(statistics.fmean(error**2 for error in errors))
            bar = f"joint, {words} pendulums, {rate} Hz: RMSE/CRLB ({bound:.4f} mGal) of {count}"
            yield at_most(bar, rmse / bound, of_few(1.1, count, COUNT))


def of_few(limit: float, count: int, full: int) -> float:
    """Limit on a ratio of scatter 1/sqrt(2 count), widened by three times what that exceeds 1/sqrt(2 full) by."""
    return limit * (1.0 + 3.0 * max(math.sqrt(0.5 / count) - math.sqrt(0.5 / full), 0.0))


def costs(*, quick: bool) -> Iterator[Row]:
    """Yield the bars of cost."""
    repeats = 7 if quick else 15
    yield from _estimation(scenes.linear(duration=DURATION), 1e-6, repeats)
    yield from _estimation(scenes.real(duration=DURATION), 1e-5, repeats)
    yield from _fits(5 if quick else 15)
    with tempfile.TemporaryDirectory() as name:
        path, record = Path(name) / "linear.record.nc", simulate(scenes.linear(duration=DURATION))[0]
        yield _whole(record, "projection", "linear", 60.0, repeats)
        data_schemas.write(record, path)
        yield from _start_up(path, 3 if quick else 9)


def _estimation(scene: Scene, exact: float, repeats: int) -> Iterator[Row]:
    """`process` by the exact method, gravity alone and all of a result, against hilbert + unwrap + polyfit."""
    name = "shooting" if scene.restoring == "sine" else "projection"
    record = simulate(scene)[0]
    seen = observe(record)
    calls: dict[str, Callable[[], Any]] = {"chain": partial(hilbert, seen.difference)}
    calls |= {of: partial(process, record, method=name, quantities=of) for of in ("gravity", "all")}
    taken = rounds(calls, repeats, batch=5)
    for of, limit in (("gravity", 2.0), ("all", 6.0)):
        bar = f"process by {name}, {of}, {seen.time.size} samples: chains of hilbert + unwrap + polyfit"
        yield times(bar, taken[of], taken["chain"], limit if name == "projection" else None)
    error = scenes.errors(scene, name)[name]
    yield at_most(f"{name}, {seen.time.size} samples: error, noise-free", abs(error), exact, "mGal")


def _fits(repeats: int) -> Iterator[Row]:
    """A pass of the joint fit and a whole one, beside hilbert + unwrap + polyfit on as many samples; a whole record."""
    for name, (case, one, whole, spent) in FITS.items():
        record = of_case(case, np.random.default_rng(1958), name).tree
        gathered = gather(record)
        best = reduce(gathered).fit
        model = best.model
        calls: dict[str, Callable[[], object]] = {
            "chain": partial(hilbert, model.problem.lattice.value[:45000]),
            "pass": partial(model.problem.run, model.assumed, model.constants, about=best.path),
            "fit": partial(reduce, gathered),
        }
        taken = rounds(calls, repeats)
        for key, limit in (("pass", one), ("fit", whole)):
            yield times(f"joint, {name}, 45000 samples: {key}, chains", taken[key], taken["chain"], limit)
        yield _whole(record, "joint", name, spent, repeats)


def _whole(record: Any, method: str, name: str, limit: float, repeats: int) -> Row:
    """Processor time of a record as a batch has it: read, reduced, written."""
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder) / "a.record.nc", Path(folder) / "a.result.nc"
        data_schemas.write(record, source)

        def once() -> None:
            data_schemas.write(process(data_schemas.read(source), method=method), target, overwrite=True)

        taken = [1e3 * each for each in rounds({"own": once}, repeats)["own"]]
    bar = f"{method}, {name}: a record read, reduced, written"
    return at_most(bar, statistics.median(taken), limit, f"ms, {min(taken):.3g} to {max(taken):.3g}")


def _start_up(path: Path, repeats: int) -> Iterator[Row]:
    """The command line from start to exit, every program in a process of its own."""
    process = ("process", str(path), "--method", "projection", "-o", str(path.with_suffix(".result")), "--force")
    for label, words, imports, limit in (
        ("isochrony --help", ("--help",), "import numpy", 3.0),
        ("isochrony process", process, "import numba, xarray, scipy.signal", 0.6),
    ):
        rivals = (command(sys.executable, *each) for each in (("-m", "pipeline.cli", *words), ("-c", imports)))
        taken = rounds(dict(zip(("own", "rival"), rivals, strict=True)), repeats)
        yield times(f'{label}, start to exit: times python -c "{imports}"', taken["own"], taken["rival"], limit)


def hilbert(values: Floats) -> float:
    """Slope of the phase, rad a sample, by scipy at a fast length of its FFT: the yardstick of methods' times."""
    from scipy.fft import next_fast_len
    from scipy.signal import hilbert as analytic

    phase = np.unwrap(np.angle(analytic(values, next_fast_len(values.size))[: values.size]))
    return float(np.polyfit(np.arange(values.size), phase, 1)[0])
