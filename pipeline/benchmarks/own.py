"""The project's propagators on any problem, by one face: a tolerance in, states and an estimated error out."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from data_schemas.errors import RefusedError
from data_schemas.scene_pendulum import StateStart
from pipeline.benchmarks.problems import Problem, Swell
from synth.motion.harmonic_sum import HarmonicSum
from synth.pendulums.linear import respond
from synth.phase import Floats
from synth.propagators.even import EvenTimes

CLOSED, PICARD, COLLOCATION = "closed form", "Picard collocation", "beam collocation"
RADAU, EXPLICIT = "Radau", "explicit"
CLOSED_FORM_ERROR = 1e-15


@dataclass(frozen=True)
class Answer:
    """What one propagation gave.

    Attributes
    ----------
    states : (k, n) or (k, judged) array
        States, or the angles alone.
    estimated_error : float
        The propagator's own.
    even : bool
        It counts readings in whole numbers: its instants are exact, not rounded to doubles.
    """

    states: Floats
    estimated_error: float
    even: bool = False


Call = Callable[[], Answer]


def _closed_form(problem: Problem, tolerance: float) -> Call:
    if problem.kind != "linear":
        raise RefusedError("closed form: linear pendulums that swing, on a support that moves sideways, have one")
    system, moved, start = problem.system, _sum(problem.horizontal), problem.start.tolist()

    def call() -> Answer:
        responses = [
            respond(
                float(n),
                float(gamma),
                StateStart(angle=start[2 * k], angular_velocity=start[2 * k + 1]),
                moved,
                system.gravity,
            )
            for k, (n, gamma) in enumerate(zip(system.natural_frequency, system.terms.damping_rate, strict=True))
        ]
        angles = EvenTimes(problem.step, problem.count).elongation(responses, moved.angular_frequency)
        return Answer(np.asarray(angles.T, np.float64), CLOSED_FORM_ERROR, even=True)

    return call


def _picard(problem: Problem, tolerance: float) -> Call:
    from synth.propagators.picard import PicardPlan

    if problem.kind != "sine":
        raise RefusedError("Picard collocation: made for pendulums with the full sine on a support moved as prescribed")
    system = problem.system
    plan = PicardPlan(
        system.natural_frequency,
        system.terms.damping_rate,
        problem.start.reshape(-1, 2),
        _sum(problem.horizontal),
        _sum(problem.vertical),
        system.gravity,
        EvenTimes(problem.step, problem.count),
    )

    def call() -> Answer:
        angles, error = plan.elongation()
        return Answer(angles.T, error, even=True)

    return call


def _sum(swell: Swell) -> HarmonicSum:
    return HarmonicSum(swell.rate, swell.amplitude * np.exp(1j * swell.phase))


def _integrator(name: str) -> Callable[[Problem, float], Call]:
    def make(problem: Problem, tolerance: float) -> Call:
        integrate: Any = importlib.import_module(f"synth.integrators.{name}").integrate

        def call() -> Answer:
            found = integrate(problem.system, problem.start, problem.times, tolerance=tolerance)
            return Answer(found.states, found.estimated_error)

        return call

    return make


OWN: Mapping[str, Callable[[Problem, float], Call]] = {
    CLOSED: _closed_form,
    PICARD: _picard,
    COLLOCATION: _integrator("collocation"),
    RADAU: _integrator("radau"),
    EXPLICIT: _integrator("explicit"),
}
"""All propagators, by the names under which rows and pictures show them: (problem, tolerance) -> call."""
AS_EXACT_AS_CAN_BE = (CLOSED, PICARD)
"""Propagators that take no tolerance."""
