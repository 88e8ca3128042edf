"""Extreme motions by every propagator: an error, or refused with a named reason, never silently wrong."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from data_schemas.errors import IsochronyError, RefusedError
from data_schemas.scene_pendulum import StateStart
from pipeline.benchmarks import stability_expected as expected
from pipeline.benchmarks.plain_pendulums import Swell
from pipeline.benchmarks.progress import progress
from pipeline.benchmarks.stability_cases import GRAVITY, Case, cases
from pipeline.benchmarks.stability_scenes import rounding, simulated
from pipeline.benchmarks.stability_truth import ANOTHER
from synth.motion.harmonic_sum import HarmonicSum
from synth.pendulums.linear import respond
from synth.phase import Floats
from synth.propagators.even import EvenTimes

HONEST = 10.0
"""The error may be so many times the propagator's estimate."""
ROUNDING = 1e-13
"""Errors below it are nobody's lie."""
_TIGHTER = 1e-2


@dataclass(frozen=True)
class Found:
    """What a propagator made of a case: states or the judged components, and its estimated error; or why not."""

    states: Floats | None = None
    estimate: float = math.nan
    refusal: str = ""
    crash: str = ""


def rows() -> Iterator[dict[str, Any]]:
    """Yield one row a case, one cell a propagator."""
    every = cases()
    for case in progress(every, "extreme motions", len(every)):
        yield judge(case, {name: attempt(case, name) for name in expected.PROPAGATORS})


def attempt(case: Case, name: str, tolerance: float = expected.TOLERANCE) -> Found:
    """Ask a propagator for a case."""
    if (case.name, name) in expected.NOT_ASKED:
        return Found(refusal=f"not asked: {expected.NOT_ASKED[case.name, name]}")
    if case.kind == "table" and name != expected.SIMULATE:
        return Found(refusal=f"{name}: reads no tables; the simulator does")
    try:
        states, estimate = CALLS[name](case, tolerance)
    except IsochronyError as refusal:
        return Found(refusal=str(refusal))
    except Exception as fault:  # whatever it is, the matrix shows it as the failure of this cell
        return Found(crash=f"{type(fault).__name__}: {fault}")
    return Found(states, estimate)


def judge(case: Case, found: Mapping[str, Found]) -> dict[str, Any]:
    """One row: cells, those that are wrong without a word, and those that declined though they must not."""
    silent, unlisted, missed = [], [], []
    cells = {}
    for name, one in found.items():
        if one.states is None:
            cells[name] = f"crashed: {one.crash}" if one.crash else f"refused: {one.refusal}"
            if one.crash or not may_refuse(case, name):
                unlisted.append(name)
            continue
        error, doubt = error_of(case, name, one.states)
        cells[name] = f"{error:.1e} (est. {one.estimate:.0e})"
        if case.name in expected.MUST_REFUSE or not error <= max(HONEST * one.estimate, ROUNDING) + doubt:
            silent.append(name)
        elif not may_refuse(case, name) and error > expected.bound(case.name, name) + doubt:
            missed.append(name)
    return {
        "motion": case.name,
        **cells,
        "silently_wrong": ", ".join(silent),
        "refused_unlisted": ", ".join(unlisted),
        "bound_missed": ", ".join(missed),
        "truth": case.source,
        "pass": not (silent or unlisted or missed),
    }


def may_refuse(case: Case, name: str) -> bool:
    """Whether the cell was named beforehand as one that may decline."""
    return (
        name not in expected.SUITED[case.kind]
        or case.name in expected.MUST_REFUSE
        or (case.name, name) in expected.MAY_REFUSE
    )


def error_of(case: Case, name: str, states: Floats) -> tuple[float, float]:
    """Largest error relative to the largest true value of its component, and how far the truth itself may be off.

    An angle that stays zero counts in rad.
    """
    true, doubt = (case.true(), case.apart) if case.source != ANOTHER else _another(case, name)
    if case.figure is not None:
        given = case.figure(states)
    else:
        given = states if states.shape[1] == len(case.judged) else states[:, list(case.judged)]
    size = np.max(np.abs(true), axis=0, where=np.isfinite(true), initial=0.0)  # rates may be unknown
    difference = np.abs(given - true) / np.where(size > 0.0, size, 1.0)
    worst = float(np.max(difference[np.isfinite(true)], initial=0.0))
    if name == expected.SIMULATE:
        doubt += rounding(case)
    return (worst if math.isfinite(worst) else math.inf), doubt


def _another(case: Case, name: str) -> tuple[Floats, float]:
    """The judged components by a different propagator that is made for the case, at a tighter tolerance; its doubt."""
    for other in (expected.EXPLICIT, expected.RADAU):
        if other != name:
            found = attempt(case, other, expected.TOLERANCE * _TIGHTER)
            if found.states is not None:
                return found.states[:, list(case.judged)], found.estimate
    return np.full((case.count, len(case.judged)), np.nan), math.nan


def _closed_form(case: Case, tolerance: float) -> tuple[Floats, float]:
    if case.kind != "linear":
        raise RefusedError("closed form: linear pendulums that swing, on a support that moves sideways, have one")
    system, moved = case.system, _sum(case.horizontal)
    responses = [
        respond(
            float(n),
            float(gamma),
            StateStart(angle=float(case.start[2 * k]), angular_velocity=float(case.start[2 * k + 1])),
            moved,
            GRAVITY,
        )
        for k, (n, gamma) in enumerate(zip(system.natural_frequency, system.terms.damping_rate, strict=True))
    ]
    return EvenTimes(case.step, case.count).elongation(responses, moved.angular_frequency).T, 1e-15


def _picard(case: Case, tolerance: float) -> tuple[Floats, float]:
    from synth.propagators.picard import PicardPlan

    if case.kind != "sine":
        raise RefusedError("Picard collocation: made for pendulums with the full sine on a support that moves as told")
    system = case.system
    plan = PicardPlan(
        system.natural_frequency,
        system.terms.damping_rate,
        case.start.reshape(-1, 2),
        _sum(case.horizontal),
        _sum(case.vertical),
        GRAVITY,
        EvenTimes(case.step, case.count),
    )
    angles, error = plan.elongation()
    return angles.T, error


def _sum(swell: Swell) -> HarmonicSum:
    return HarmonicSum(swell.rate, swell.amplitude * np.exp(1j * swell.phase))


def _integrator(module: str) -> Callable[[Case, float], tuple[Floats, float]]:
    def call(case: Case, tolerance: float) -> tuple[Floats, float]:
        integrate: Any = importlib.import_module(f"synth.integrators.{module}").integrate
        found = integrate(case.system, case.start, case.times, tolerance=tolerance)
        return found.states, found.estimated_error

    return call


CALLS: Mapping[str, Callable[[Case, float], tuple[Floats, float]]] = {
    expected.CLOSED: _closed_form,
    expected.PICARD: _picard,
    expected.COLLOCATION: _integrator("collocation"),
    expected.RADAU: _integrator("radau"),
    expected.EXPLICIT: _integrator("explicit"),
    expected.SPLITTING: _integrator("splitting"),
    expected.SIMULATE: simulated,
}
"""Propagators by their names."""
