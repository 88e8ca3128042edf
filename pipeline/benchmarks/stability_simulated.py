"""The extreme motions as scenes: what a person gets who lets the simulator choose."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from data_schemas.errors import RefusedError
from data_schemas.scene import Scene
from pipeline.benchmarks.own import Answer
from pipeline.benchmarks.problems import GRAVITY, Swell
from pipeline.benchmarks.stability_motions import SIMULATE, SUITED, Case
from synth import simulate
from synth.systems.restoring import Linear

ROUNDED = 4e-16
"""Of a phase: scenes give periods and rates, whose reciprocals are rounded."""


def simulated(case: Case, tolerance: float) -> Answer:
    """Angles at the case's readings, and the truth's estimated error."""
    if SIMULATE not in SUITED[case.problem.kind]:
        raise RefusedError("simulate: no scene has this system")
    with tempfile.TemporaryDirectory() as folder:
        try:
            scene = Scene.model_validate(scene_of(case, Path(folder)))
        except ValidationError as fault:
            where = ".".join(str(part) for part in fault.errors()[0]["loc"])
            raise RefusedError(f"scene: {where}: {fault.errors()[0]['msg']}") from None
        _, truth = simulate(scene)
    theta = np.asarray(truth["truth/theta"].values)
    estimate = next(node.attrs["estimated_error"] for node in truth.subtree if "estimated_error" in node.attrs)
    return Answer(theta.T[: case.problem.count], float(estimate))


def scene_of(case: Case, folder: Path) -> dict[str, Any]:
    """The case as a scene's fields; a table is written into the folder."""
    problem = case.problem
    beam, system = problem.kind == "beam", problem.system
    periods = 2.0 * np.pi * np.sqrt(system.length / GRAVITY) if beam else 2.0 * np.pi / system.natural_frequency
    first = system.first_angle
    pendulums = []
    for k, period in enumerate(periods.tolist()):
        angle, speed = problem.start[first + 2 * k : first + 2 * k + 2].tolist()
        pendulum = {
            "label": str(k + 1),
            "period": period,
            "start": {"kind": "state", "angle": angle, "angular_velocity": speed},
        }
        pendulum |= {"mass": float(system.mass[k])} if beam else {"damping_rate": float(system.terms.damping_rate[k])}
        pendulums.append(pendulum)
    scene: dict[str, Any] = {
        "record_id": "extreme",
        "duration": float(problem.step * problem.count),
        "gravity": GRAVITY,
        "reference_gravity": GRAVITY,
        "restoring": "linear" if not beam and isinstance(system.restoring, Linear) else "sine",
        "pendulums": pendulums,
        "motion": [*_moved(problem.horizontal, "horizontal"), *_moved(problem.vertical, "vertical")],
        "recording": {"sampling_rate": str(1 / problem.step)},
    }
    if beam:
        scene["support"] = {
            "kind": "beam",
            "mass": system.beam_mass,
            "stiffness": system.stiffness,
            "damping_rate": system.damping_rate,
            "displacement": float(problem.start[0]),
            "velocity": float(problem.start[1]),
        }
    if case.table is not None:
        np.savetxt(folder / "motion.csv", np.column_stack(case.table), delimiter=",")
        scene["motion"] = [{"kind": "tabulated", "file": str(folder / "motion.csv"), "time": 1, "value": 2}]
    return scene


def _moved(swell: Swell, axis: str) -> list[dict[str, Any]]:
    if not np.any(swell.amplitude):
        return []
    return [
        {
            "kind": "harmonics",
            "axis": axis,
            "amplitude": swell.amplitude.tolist(),
            "angular_frequency": swell.rate.tolist(),
            "phase": swell.phase.tolist(),
        }
    ]


def rounding(case: Case) -> float:
    """How far a scene's rounded periods put the angles off by the end, relative."""
    problem = case.problem
    if case.table is not None:
        return 0.0
    system = problem.system
    fastest = np.sqrt(GRAVITY / system.length) if problem.kind == "beam" else system.natural_frequency
    return ROUNDED * float(np.max(fastest) * problem.step * problem.count)
