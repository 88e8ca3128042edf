"""The project's propagators on the problems, by one face: a tolerance in, states and an estimated error out."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.benchmarks.linear_hour import GRAVITY, RATE, closed_form, motion
from pipeline.benchmarks.plain_pendulums import Swell
from pipeline.benchmarks.problems import Problem
from synth.motion.harmonic_sum import HarmonicSum
from synth.phase import Floats
from synth.systems.driven_pendulums import DrivenPendulums
from synth.systems.restoring import Sine

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


@dataclass(frozen=True)
class Own:
    """A propagator: how to set it up, and whether it takes a tolerance."""

    make: Callable[[Problem, float], Call]
    tunable: bool = True


def _closed_form(problem: Problem, tolerance: float) -> Call:
    given = problem.task
    if given is None:
        raise RefusedError("closed form: linear pendulums alone have one")
    moved = motion(given)
    return lambda: Answer(np.asarray(closed_form(given, moved).T, np.float64), CLOSED_FORM_ERROR, even=True)


def _picard(problem: Problem, tolerance: float) -> Call:
    from synth.propagators.even import EvenTimes
    from synth.propagators.picard import PicardPlan

    system = problem.system
    if not isinstance(system, DrivenPendulums) or not isinstance(system.restoring, Sine):
        raise RefusedError("Picard collocation: made for pendulums with the full sine on a support that moves as told")
    plan = PicardPlan(
        system.natural_frequency,
        system.terms.damping_rate,
        problem.start.reshape(-1, 2),
        _sum(problem.horizontal),
        _sum(problem.vertical),
        GRAVITY,
        EvenTimes(Fraction(1, RATE), problem.times.size),
    )

    def call() -> Answer:
        angles, error = plan.elongation()
        return Answer(angles.T, error, even=True)

    return call


def _sum(swell: Swell | None) -> HarmonicSum:
    if swell is None:
        return HarmonicSum(np.zeros(0), np.zeros(0, dtype=np.complex128))
    return HarmonicSum(swell.rate, swell.amplitude * np.exp(1j * swell.phase))


def _integrator(name: str) -> Callable[[Problem, float], Call]:
    def make(problem: Problem, tolerance: float) -> Call:
        integrate: Any = importlib.import_module(f"synth.integrators.{name}").integrate

        def call() -> Answer:
            found = integrate(problem.system, problem.start, problem.times, tolerance=tolerance)
            return Answer(found.states, found.estimated_error)

        return call

    return make


OWN: Mapping[str, Own] = {
    "closed form": Own(_closed_form, tunable=False),
    "Picard collocation": Own(_picard, tunable=False),
    "beam collocation": Own(_integrator("collocation")),
    "Radau": Own(_integrator("radau")),
    "explicit": Own(_integrator("explicit")),
    "splitting": Own(_integrator("splitting")),
}
"""All propagators by the names under which rows and pictures show them."""
