"""Suite `stability`: every method of one difference on every extreme record, every propagator on every extreme motion.

A value with its error, or refused with a named reason, never silently wrong. Which cells may refuse is written down
beforehand, in `stability_records` and `stability_motions`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from data_schemas.errors import IsochronyError
from pipeline.benchmarks import stability_records
from pipeline.benchmarks.csv_table import write
from pipeline.benchmarks.own import EXPLICIT, OWN, RADAU, Answer
from pipeline.benchmarks.progress import progress
from pipeline.benchmarks.stability_motions import BOUND, PROPAGATORS, SIMULATE, Case, cases
from pipeline.benchmarks.stability_simulated import rounding, simulated
from synth.phase import Floats

TOLERANCE = 1e-10
"""What is asked of propagators that take a tolerance."""
HONEST = 10.0
"""The error may be so many times the propagator's estimate."""
ROUNDING = 1e-13
"""Errors below it are nobody's lie."""
MOST = 400
"""Readings that are compared with the truth."""
_TIGHTER = 1e-2


@dataclass(frozen=True)
class Found:
    """What a propagator made of a case, or why it made nothing."""

    answer: Answer | None = None
    refusal: str = ""
    crash: str = ""


def run(*, quick: bool, folder: Path | None) -> Iterator[dict[str, Any]]:
    """Yield one row a record, one cell a method (errors in mGal); then one row a motion, one cell a propagator.

    Quick and full are the same. With a folder: both tables as CSV.
    """
    records, motions = [], []
    for row in stability_records.rows():
        records.append(row)
        yield row
    every = cases()
    for case in progress(every, "extreme motions", len(every)):
        motions.append(judge(case, {name: attempt(case, name) for name in PROPAGATORS}))
        yield motions[-1]
    if folder is not None:
        write(folder / "stability-records.csv", records)
        write(folder / "stability-motions.csv", motions)


CALLS: Mapping[str, Callable[[Case, float], Answer]] = {SIMULATE: simulated} | {
    name: lambda case, tolerance, own=own: own.make(case.problem, tolerance)()  # type: ignore[misc]  # bound now
    for name, own in OWN.items()
}
"""Propagators by their names."""


def attempt(case: Case, name: str, tolerance: float = TOLERANCE) -> Found:
    """Ask a propagator for a case."""
    if name in case.not_asked:
        return Found(refusal=f"not asked: {case.may_refuse[name]}")
    if case.table is not None and name != SIMULATE:
        return Found(refusal=f"{name}: reads no tables; the simulator does")
    try:
        return Found(CALLS[name](case, tolerance))
    except IsochronyError as refusal:
        return Found(refusal=str(refusal))
    except Exception as fault:  # whatever it is, the row shows it as the failure of this cell
        return Found(crash=f"{type(fault).__name__}: {fault}")


def judge(case: Case, found: Mapping[str, Found]) -> dict[str, Any]:
    """One row: cells, those that are wrong without a word, and those that declined though they must not."""
    silent, unlisted, missed = [], [], []
    cells = {}
    for name, one in found.items():
        if one.answer is None:
            cells[name] = f"crashed: {one.crash}" if one.crash else f"refused: {one.refusal}"
            if one.crash or not case.may_decline(name):
                unlisted.append(name)
            continue
        estimate = one.answer.estimated_error
        error, doubt = error_of(case, name, one.answer.states)
        cells[name] = f"{error:.1e} (est. {estimate:.0e})"
        if case.must_refuse or not error <= max(HONEST * estimate, ROUNDING) + doubt:
            silent.append(name)
        elif not case.may_decline(name) and error > case.bounds.get(name, BOUND) + doubt:
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


def error_of(case: Case, name: str, states: Floats) -> tuple[float, float]:
    """Largest error relative to the largest true value of its component, and how far the truth itself may be off.

    An angle that stays zero counts in rad.
    """
    rows = compared(case)
    true, doubt = (case.true(instants(case)), case.apart) if case.true is not None else _another(case, name)
    if case.figure is not None:
        given = case.figure(states)
    else:
        judged = case.problem.judged
        given = (states if states.shape[1] == len(judged) else states[:, list(judged)])[rows]
    size = np.max(np.abs(true), axis=0, initial=0.0)
    worst = float(np.max(np.abs(given - true) / np.where(size > 0.0, size, 1.0), initial=0.0))
    if name == SIMULATE:
        doubt += rounding(case)
    return (worst if math.isfinite(worst) else math.inf), doubt


def compared(case: Case) -> Any:
    """Readings that are compared."""
    count = case.problem.count
    return np.unique(np.linspace(0, count - 1, min(count, MOST)).astype(np.int64))


def instants(case: Case) -> list[Fraction]:
    """Of the readings that are compared, exact."""
    return [case.problem.step * row for row in compared(case).tolist()]


def _another(case: Case, name: str) -> tuple[Floats, float]:
    """The judged components by a different propagator that is made for the case, at a tighter tolerance; its doubt."""
    judged = list(case.problem.judged)
    for other in (EXPLICIT, RADAU):
        if other != name:
            found = attempt(case, other, TOLERANCE * _TIGHTER).answer
            if found is not None:
                return found.states[compared(case)][:, judged], found.estimated_error
    return np.full((compared(case).size, len(judged)), np.nan), math.nan
