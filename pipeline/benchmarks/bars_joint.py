"""Bars of the joint fit: scatter, sigma and cost on records of a plain integrator, fitted from the defaults."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from data_schemas.errors import IsochronyError
from data_schemas.scene import Scene
from pipeline.benchmarks.honesty.kinds import Case
from pipeline.benchmarks.honesty.plain import gravity_at
from pipeline.benchmarks.honesty.records import Made, of_case
from pipeline.benchmarks.scenes import linear, made, real
from pipeline.benchmarks.tables import Row, at_most, between, hilbert, of_few, progress, reported, rounds, times
from pipeline.joint.fit import reduce
from pipeline.joint.gather import gather
from pipeline.processing import process
from pipeline.summary import summaries

COUNT, QUICK = 400, 8
MGAL = 1e-5  # m s-2
BASE = Case(duration=1800.0, rate=10.0, noise=3e-5, swell=(0.015, 0.02), states_heave=True)
GAPS: Mapping[str, tuple[Case, float]] = {
    "one gap of 30 s": (replace(BASE, gap=30.0), 0.05),
    "one gap of 300 s": (replace(BASE, gap=300.0), 0.08),
    "ten gaps of 20 s": (replace(BASE, gap=20.0, gaps=10), 0.35),
    "alternate minutes": (replace(BASE, lost_of_two_minutes=60.0), 0.8),
}
"""Both traces lost; largest sigma, mGal."""
RATES = (25, 10, 5, 4, 2)  # Hz
BOUNDS: Mapping[str, tuple[float, ...]] = {
    "linear": (0.0316980921, 0.0501202281, 0.0708831895, 0.0792508909, 0.111878254),
    "real": (0.0245343721, 0.0387933829, 0.0548654326, 0.0613436888, 0.0871394364),
}
"""Cramer-Rao bound of gravity at these rates, mGal, noise 1e-4 rad: from the Fisher matrix of n2 with the first
pendulum's motion unknown, which the tests compute. It is that of linear pendulums of the same arcs and swell: what arcs
tell besides is less than the scatter of the fits."""
LOST = {"30 % of the samples": 0.3, "60 % of the samples": 0.6}
KICKS = tuple(kick for size in (1e-7, 1e-6, 1e-5) for kick in ((size, 0.0), (size, size)))
"""rad s-1/2, of either pendulum."""
COURSES = {f"gravity changing by {size:g} mGal": Case(gravity_change=size) for size in (2.0, 20.0, 100.0)} | {
    "gravity wave of 15 mGal in 20 min": Case(gravity_wave=15.0)
}
SPEEDS: Mapping[str, tuple[Case, float, float]] = {
    "linear": (Case(rate=25.0, linear=True), 4.0, 40.0),
    "real, heave recorded": (replace(BASE, rate=25.0), 8.0, 120.0),
    "real, heave not recorded": (replace(BASE, rate=25.0, states_heave=False), 25.0, 400.0),
}
"""Largest CPU time of one pass and of a whole fit, in chains of hilbert + unwrap + polyfit."""


class Fit(NamedTuple):
    """What the joint fit made of one record; mGal, s of processor time."""

    error: float
    sigma: float
    seconds: float
    band: float
    """Root mean square of the course's error over its sigma."""


def rows(*, quick: bool) -> Iterator[Row]:
    """Yield the bars; seeds are fixed."""
    count = QUICK if quick else COUNT
    for name, (case, limit) in GAPS.items():
        fits = campaign(name, case, count)
        yield at_most(f"joint, {name}: median sigma of {count}", median(fits, "sigma"), limit, "mGal")
        yield honest(f"joint, {name}", fits)
    yield from _lost(count)
    fits = campaign("heave not recorded", replace(BASE, states_heave=False), count)
    yield at_most(f"joint, heave not recorded: RMSE of {count}", rms(fit.error for fit in fits), 0.06, "mGal")
    yield honest("joint, heave not recorded", fits)
    for kick in KICKS:
        name = f"kicks of {kick[0]:g} and {kick[1]:g} rad/sqrt(s)"
        yield honest(f"joint, {name}", campaign(name, Case(kicks=kick), count))
    for name, case in COURSES.items():
        fits = campaign(name, case, count)
        farthest = max(abs(fit.error / fit.sigma) for fit in fits)
        yield at_most(f"joint, {name}: mean, farthest of {count} in sigma", farthest, 4.0)
        yield between(f"joint, {name}: band, rms z", rms(fit.band for fit in fits), 0.7, 1.2)
    yield from _efficiency(count)
    yield _interval(2000 if not quick else 5 * QUICK)
    yield from _cost(5 if quick else 15)


def campaign(name: str, case: Case | Callable[[np.random.Generator], Case | Made], count: int) -> list[Fit]:
    """Fit records of a case that differ in all that is drawn; a refused one has an infinite error."""
    found = []
    for seed in progress(range(count), name, count):
        random = np.random.default_rng([seed, 1958])
        drawn = case if isinstance(case, Case) else case(random)
        found.append(fitted(of_case(drawn, random, f"{name} {seed}") if isinstance(drawn, Case) else drawn))
    return found


def fitted(record: Made) -> Fit:
    """Fit one record as a user would."""
    row: Row = {"status": "refused"}
    began = time.process_time()
    try:
        result = process(record.tree)
        (row,) = summaries(result)
    except IsochronyError:
        pass
    took = time.process_time() - began
    if row["status"] != "ok":
        return Fit(math.inf, math.nan, took, math.nan)
    band = math.nan
    if "course" in result.children:
        course = result["course"].dataset
        truth = np.array([gravity_at(each, record.law) for each in np.asarray(result["time"].values)])
        off = (course["gravity_course"].values - truth) / MGAL / course["gravity_course_sigma"].values
        band = float(np.sqrt(np.mean(off**2)))
    return Fit((row["gravity_m_s2"] - record.gravity) / MGAL, row["gravity_sigma_mgal"], took, band)


def rms(values: Iterator[float]) -> float:
    """Root mean square."""
    return math.sqrt(statistics.fmean(value**2 for value in values))


def median(fits: list[Fit], name: str) -> float:
    """Of one figure of the fits."""
    return float(statistics.median(getattr(fit, name) for fit in fits))


def honest(name: str, fits: list[Fit]) -> Row:
    """Root mean square of error over sigma, between .85 and 1.2, wider by three times the scatter that few have."""
    more = of_few(1.0, len(fits), COUNT) - 1.0
    value = rms(fit.error / fit.sigma for fit in fits)
    return between(f"{name}: rms z of {len(fits)}", value, 0.85 * (1.0 - more), 1.2 * (1.0 + more))


def _efficiency(count: int) -> Iterator[Row]:
    """Scatter over the Cramer-Rao bound, from four readings a swing and half-second marks up."""
    for words, make in (("linear", linear), ("real", real)):
        for rate, bound in zip(RATES, BOUNDS[words], strict=True):
            scene = make(1e-5, noise=1e-4, sampling_rate=rate)

            def case(random: np.random.Generator, scene: Scene = scene) -> Made:
                return made(scene.model_copy(update={"seed": int(random.integers(2**31))}))

            fits = campaign(f"{words} at {rate} Hz", case, count)
            bar = f"joint, {words} pendulums, {rate} Hz: RMSE/CRLB ({bound:.4f} mGal) of {count}"
            yield at_most(bar, rms(fit.error for fit in fits) / bound, of_few(1.1, count, COUNT))


def _lost(count: int) -> Iterator[Row]:
    """Random samples lost: sigma within 1.3 of what fewer samples allow, time within 5 times the whole record's."""
    whole = campaign("no sample lost", BASE, count)
    for name, share in LOST.items():
        fits = campaign(f"{name} lost", replace(BASE, lost=share), count)
        allowed = median(whole, "sigma") / math.sqrt(1.0 - share)
        bar = f"joint, {name} lost"
        yield at_most(f"{bar}: sigma over what so many samples allow", median(fits, "sigma") / allowed, 1.3)
        yield at_most(f"{bar}: times the whole record's time", median(fits, "seconds") / median(whole, "seconds"), 5.0)


def _interval(count: int) -> Row:
    """Random records, heave and damping stated or not: share whose 95 % interval holds the truth."""

    def case(random: np.random.Generator) -> Case:
        stated = bool(random.random() < 0.5)
        return replace(
            BASE,
            duration=900.0,
            noise=10.0 ** random.uniform(-6.0, -4.0),
            damping=10.0 ** random.uniform(-5.0, -3.5),
            states_damping=bool(random.random() < 0.5),
            states_heave=stated,
            swell=(random.uniform(0.0, 0.03), random.uniform(0.0, 0.05)),
        )

    fits = campaign("95 % interval", case, count)
    share = statistics.fmean(abs(fit.error) < 1.96 * fit.sigma for fit in fits)
    half = 0.015 if count >= 2000 else 3.0 * math.sqrt(0.95 * 0.05 / count)
    return between(f"joint: 95 % interval holds the truth, share of {count}", share, 0.95 - half, min(0.95 + half, 1.0))


def _cost(repeats: int) -> Iterator[Row]:
    """CPU time of a pass and of a whole fit, beside hilbert + unwrap + polyfit on as many samples; compiled before."""
    for name, (case, one, whole) in SPEEDS.items():
        gathered = gather(of_case(case, np.random.default_rng(1958), name).tree)
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
        yield reported(f"joint, {name}: a whole fit", statistics.median(taken["fit"]), "s")
