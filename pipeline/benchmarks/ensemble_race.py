"""Many clocks on beams, no two alike: the project's ensemble against heyoka's batch mode, on one thread each."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.benchmarks.own import Answer
from pipeline.benchmarks.problems import Problem, beam
from pipeline.benchmarks.references import Reference, reference
from pipeline.benchmarks.symbolic import equations
from pipeline.benchmarks.work_precision import Point, Runner, cpu, raced
from synth.phase import Floats
from synth.systems.elastic_beam import ElasticBeam

NAME = "ensemble"
OWN, BATCH = "beam collocation", "heyoka, batch"
OSCILLATIONS, QUICK_OSCILLATIONS = 500, 50
MEMBERS = 32
TOLERANCES = (1e-6, 1e-8, 1e-9, 1e-10, 1e-12)
_CHECKED = (0, MEMBERS // 2, MEMBERS - 1)  # members whose errors are looked at


def members(oscillations: int) -> list[Problem]:
    """Clocks that differ in length by up to a thousandth, and in how they start."""
    model = beam(oscillations)
    chance = np.random.default_rng(7)
    found = []
    for _ in range(MEMBERS):
        length = model.system.length * (1.0 + 1e-3 * chance.uniform(-1.0, 1.0, 2))
        drive = model.system.terms._replace(angle=0.0138 / length)
        system = model.system._replace(length=length, terms=drive)
        start = model.start * (1.0 + 0.1 * chance.uniform(-1.0, 1.0, model.start.size))
        found.append(replace(model, system=system, plain=system, start=start))
    return found


def race(*, quick: bool) -> tuple[str, str, list[Point]]:
    """Title, source of the reference, and points; times are of all members together."""
    each = members(QUICK_OSCILLATIONS if quick else OSCILLATIONS)
    title = f"{MEMBERS} beams of two clocks, {QUICK_OSCILLATIONS if quick else OSCILLATIONS} oscillations"
    truths = {index: reference(each[index]) for index in _CHECKED}
    points, runners = [], []
    makers: dict[str, Callable[[list[Problem], float], Callable[[], Floats]]] = {OWN: _own, BATCH: _batch}
    for method, make in makers.items():
        for tolerance in TOLERANCES:
            point = Point(NAME, method, method == OWN, tolerance)
            try:
                call = make(each, tolerance)
                states = call()
            except ImportError:
                points.append(replace(point, note="not installed: extra 'peers'"))
                break
            except RefusedError as refusal:
                points.append(replace(point, note=f"refused: {refusal}"))
                break
            worst = max(_error(each[index], truths[index], states[index]) for index in _CHECKED)
            runners.append(Runner(replace(point, error=worst, whole_error=worst, seconds=(cpu(call),)), call))
    return title, truths[0].source, points + raced(runners)


def _error(problem: Problem, truth: Reference, states: Floats) -> float:
    return truth.error(problem, Answer(states, math.nan), problem.judged)


def _own(each: list[Problem], tolerance: float) -> Callable[[], Floats]:
    from synth.integrators.collocation_ensemble import integrate_ensemble

    systems, starts = [problem.system for problem in each], np.array([problem.start for problem in each])
    return lambda: integrate_ensemble(systems, starts, each[0].times, tolerance=tolerance, workers=1)


def _batch(each: list[Problem], tolerance: float) -> Callable[[], Floats]:
    """As many members at a time as fill a vector register; lengths are parameters."""
    import heyoka as hy

    width = int(hy.recommended_simd_size())
    model: ElasticBeam = each[0].plain
    parameters = hy.par[0], hy.par[1]
    lengths = np.array([problem.plain.length for problem in each])
    terms = model.terms._replace(angle=[0.0138 / parameters[0], 0.0138 / parameters[1]])
    symbolic = model._replace(length=list(parameters), terms=terms)  # type: ignore[arg-type]  # formulas for numbers
    starts = np.array([problem.start for problem in each])
    integrator = hy.taylor_adaptive_batch(
        equations(symbolic, _kept), np.ascontiguousarray(starts[:width].T), tol=tolerance, compact_mode=False,
        pars=np.ascontiguousarray(lengths[:width].T),
    )  # fmt: skip
    times = each[0].times
    grid = np.repeat(times[:, None], width, axis=1)

    def call() -> Floats:
        found = np.empty((len(each), times.size, starts.shape[1]))
        for first in range(0, len(each), width):
            some = slice(first, first + width)
            integrator.set_time(0.0)
            integrator.state[:] = starts[some].T
            integrator.pars[:] = lengths[some].T
            states = integrator.propagate_grid(grid)
            found[some] = np.moveaxis(np.asarray(states[-1] if isinstance(states, tuple) else states), 2, 0)
        return found

    return call


def _kept(value: object) -> object:
    """Numbers as they are, formulas too."""
    import heyoka as hy

    return value if isinstance(value, hy.expression) else float(value)  # type: ignore[arg-type]  # all else is a number
