"""Suite `stability`: every propagator on every extreme motion.

A motion with its error, or refused with a named reason, never silently wrong. Who may refuse is written down
beforehand, in `stability_motions`. Records at the edge of what can be reduced are kinds of the suite `honesty`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple, get_args

import numpy as np
from pydantic import ValidationError

from data_schemas.errors import IsochronyError
from data_schemas.scene import Scene
from data_schemas.scene_simulation import Propagator
from pipeline.benchmarks.stability_motions import BOUND, Motion, motions
from pipeline.benchmarks.tables import Row, progress
from synth import simulate
from synth.phase import Floats

PROPAGATORS: tuple[Propagator, ...] = get_args(Propagator)
TOLERANCE = 1e-10
"""What is asked of propagators that take a tolerance."""
HONEST = 10.0
"""The error may be so many times the propagator's estimate."""
ROUNDING = 1e-13
"""Errors below it are rounding."""
ROUNDED = 4e-16
"""Of a phase: scenes give periods, whose reciprocals are rounded."""
MOST = 400
"""Readings that are compared with the truth."""
_TIGHTER = 1e-2


class Found(NamedTuple):
    """What a propagator made of a motion, angles (count, pendulums) and estimated error, or why it made nothing."""

    angles: Floats | None = None
    estimate: float = math.nan
    refusal: str = ""
    crash: str = ""


def run(*, quick: bool, folder: Path | None) -> Iterator[Row]:
    """Yield one row a motion, one cell a propagator. Quick and full are the same."""
    for motion in progress(motions(), "extreme motions"):
        yield judge(motion, {name: attempt(motion, name) for name in PROPAGATORS})


def attempt(motion: Motion, name: Propagator, tolerance: float = TOLERANCE) -> Found:
    """Simulate a motion by a propagator."""
    if name in motion.not_asked:
        return Found(refusal="not asked: it would take minutes")
    simulation = {"propagator": name, "tolerance": tolerance}
    try:
        truth = simulate(Scene.model_validate({**motion.scene, "simulation": simulation}))[1]
    except (IsochronyError, ValidationError) as refusal:
        return Found(refusal=str(refusal))
    except Exception as fault:  # whatever it is, the row shows it as the failure of this cell
        return Found(crash=f"{type(fault).__name__}: {fault}")
    estimate = next(node.attrs["estimated_error"] for node in truth.subtree if "estimated_error" in node.attrs)
    return Found(np.asarray(truth["truth/theta"].values).T[: motion.count], float(estimate))


def judge(motion: Motion, found: Mapping[Propagator, Found]) -> Row:
    """One row: cells, those that are wrong without a word, and those that declined though they must not."""
    silent, unlisted, missed = [], [], []
    cells: dict[str, str] = {}
    for name, one in found.items():
        if one.angles is None:
            cells[name] = f"crashed: {one.crash}" if one.crash else f"refused: {one.refusal}"
            if one.crash or name in motion.solvers:
                unlisted.append(name)
            continue
        error, doubt = error_of(motion, name, one.angles)
        cells[name] = f"{error:.1e} (est. {one.estimate:.0e})"
        if not error <= max(HONEST * one.estimate, ROUNDING) + doubt:
            silent.append(name)
        elif name in motion.solvers and error > motion.bounds.get(name, BOUND) + doubt:
            missed.append(name)
    return {
        "motion": motion.name,
        **cells,
        "silently_wrong": ", ".join(silent),
        "refused_unlisted": ", ".join(unlisted),
        "bound_missed": ", ".join(missed),
        "truth": motion.source,
        "pass": not (silent or unlisted or missed),
    }


def error_of(motion: Motion, name: Propagator, angles: Floats) -> tuple[float, float]:
    """Largest error relative to the largest true angle of its pendulum, and how far the truth itself may be off.

    An angle that stays zero counts in rad.
    """
    rows = compared(motion)
    instants = [motion.step * row for row in rows]
    true, doubt = (motion.true(instants), motion.apart) if motion.true is not None else _another(motion, name)
    size = np.max(np.abs(true), axis=0, initial=0.0)
    worst = float(np.max(np.abs(angles[rows] - true) / np.where(size > 0.0, size, 1.0), initial=0.0))
    fastest = 2.0 * math.pi / min(each["period"] for each in motion.scene["pendulums"])
    return (worst if math.isfinite(worst) else math.inf), doubt + ROUNDED * fastest * float(motion.step * motion.count)


def compared(motion: Motion) -> list[int]:
    """Readings that are compared."""
    spread = np.linspace(0, motion.count - 1, min(motion.count, MOST))
    return [int(row) for row in np.unique(spread.astype(np.int64))]


def _another(motion: Motion, name: Propagator) -> tuple[Floats, float]:
    """Angles by a different propagator, at a tighter tolerance; its doubt."""
    others: tuple[Propagator, ...] = ("explicit", "radau")
    for other in others:
        if other != name:
            found = attempt(motion, other, TOLERANCE * _TIGHTER)
            if found.angles is not None:
                return found.angles[compared(motion)], found.estimate
    return np.full((len(compared(motion)), len(motion.scene["pendulums"])), np.nan), math.nan
