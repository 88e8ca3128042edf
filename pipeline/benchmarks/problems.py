"""Initial value problems: a system, its start and the instants to read at; those on which integrators are compared."""

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from data_schemas.errors import RefusedError
from data_schemas.scene_pendulum import StateStart
from synth.motion.harmonic_sum import HarmonicSum
from synth.pendulums.linear import respond
from synth.phase import Floats
from synth.propagators.times import EvenTimes
from synth.systems.driven_pendulums import DrivenPendulums, Linear, Sine
from synth.systems.resistance import VanDerPol, VanDerPolDrive, Viscous
from synth.systems.terms import harmonics
from synth.systems.yielding import ElasticBeam, stiffness_of_ratio

GRAVITY = 9.81
HOUR = 3600  # s
RATE = 20  # readings a second
HARMONICS = 33
HEAVE = 0.07  # m/s^2 of each vertical harmonic: z''/g = 0.03 r.m.s.
CLOSED, PICARD = "closed form", "Picard collocation"  # propagators that take no tolerance
CLOSED_FORM_ERROR = 1e-15


class Swell(NamedTuple):
    """Acceleration of a support, `sum a cos(w t + phase)`."""

    amplitude: Floats  # m/s^2
    rate: Floats  # rad/s
    phase: Floats  # rad


STILL = Swell(np.zeros(1), np.ones(1), np.zeros(1))


@dataclass(frozen=True)
class Problem:
    """One initial value problem, read `count` times, every `step` s, the start among them."""

    name: str
    system: Any  # of the project's own; general integrators are given its compiled right-hand side
    start: Floats
    step: Fraction
    count: int
    judged: tuple[int, ...] = (0,)  # components of the state that are compared: angles
    horizontal: Swell = STILL
    vertical: Swell = STILL  # motion of the support of pendulums
    stiff: bool = False  # which general integrators are sensible, and which tolerances

    @property
    def times(self) -> Floats:
        """Readings, s, as doubles."""
        return np.array([float(self.step * k) for k in range(self.count)])

    def angles(self, states: Floats) -> Floats:
        """What is compared of states (k, n)."""
        return np.asarray(states[:, self.judged], dtype=np.float64)


def raced(*, quick: bool) -> Mapping[str, Problem]:
    """The problems on which integrators are compared, by name; quick ones are a tenth as long, the stiff ones alike."""
    share = 10 if quick else 1
    hours = hour(HOUR // share), hour(HOUR // share, linear=False)
    every = (*hours, beam(200 // share, "short beam"), beam(1000 // share), van_der_pol(), stiff_beam())
    return {each.name: each for each in every}


def hour(seconds: int = HOUR, *, linear: bool = True) -> Problem:
    """Two pendulums under 33 harmonics of 4 to 20 s, one near their own; with the sine under 33 vertical ones too."""
    frequency = 2.0 * np.pi / np.array([1.0099, 1.01])
    swell = _sea(33, 0.03)
    swell.rate[-1], swell.amplitude[-1] = frequency[0] - 2.0 * 0.026, 4e-4
    heave = STILL if linear else _sea(66, HEAVE)
    law, lifted = (Linear(), None) if linear else (Sine(), harmonics(*heave))
    system = DrivenPendulums(frequency, GRAVITY, law, harmonics(*swell), lifted, Viscous(np.array([1e-4, 1.2e-4])))
    name, start = "linear" if linear else "nonlinear", np.array([0.015, 0.03, -0.01, 0.05])
    return Problem(name, system, start, Fraction(1, RATE), seconds * RATE, (0, 2), swell, heave)


def _sea(seed: int, amplitude: float) -> Swell:
    chance = np.random.default_rng(seed)
    rate = 2.0 * np.pi / chance.uniform(4.0, 20.0, HARMONICS)
    return Swell(np.full(HARMONICS, amplitude), rate, chance.uniform(0.0, 2.0 * np.pi, HARMONICS))


def beam(oscillations: int = 1000, name: str = "beam") -> Problem:
    """Clocks on an elastic beam, with the parameters of reference trajectory B; about 1 s an oscillation."""
    length = np.array([0.249, 0.2484])
    drive = VanDerPolDrive(np.full(2, 0.06), 0.0138 / length)
    system = ElasticBeam(50.0, np.full(2, 0.25), length, 8000.0, 0.25, GRAVITY, drive)
    start = np.array([0.001, 0.0, 0.1, 0.0, -0.07, 0.3])
    return Problem(name, system, start, Fraction(1, RATE), oscillations * RATE + 1, (2, 4))


def van_der_pol() -> Problem:
    """The field's stiff reference: mu = 1000 to t = 2000."""
    return Problem("van der Pol", VanDerPol(1000.0), np.array([2.0, 0.0]), Fraction(2000), 2, stiff=True)


def stiff_beam() -> Problem:
    """Two heavy pendulums on a beam a thousand times faster than they, damped at half of critical, 20 s."""
    length = np.array([1.0, 0.9])
    loose = ElasticBeam(2.0, np.full(2, 1.0), length, 0.0, 0.0, GRAVITY)
    fastest = 1000.0 * float(np.sqrt(GRAVITY / length[0]))
    system = loose._replace(stiffness=stiffness_of_ratio(1000.0, loose), damping_rate=fastest)
    start = np.array([0.0, 0.0, 1.0, 0.0, -0.5, 0.0])
    return Problem("stiff beam", system, start, Fraction(1, RATE), 401, (2, 4), stiff=True)


Answer = tuple[Floats, float]
"""Angles (k, judged), and the propagator's own estimate of their error: NaN for peers."""
Call = Callable[[], Answer]
Make = Callable[[Problem, float], Call]  # from problem and tolerance to a call, compiling done


def _closed_form(problem: Problem, tolerance: float) -> Call:
    system, moved = problem.system, _sum(problem.horizontal)
    if not isinstance(system, DrivenPendulums) or isinstance(system.restoring, Sine):
        raise RefusedError("closed form: linear pendulums that swing, on a support that moves sideways, have one")

    def call() -> Answer:
        responses = []
        starts = problem.start.reshape(-1, 2).tolist()
        for n, gamma, (angle, speed) in zip(system.natural_frequency, system.terms.damping_rate, starts, strict=True):
            begun = StateStart(angle=angle, angular_velocity=speed)
            responses.append(respond(float(n), float(gamma), begun, moved, system.gravity))
        return EvenTimes(problem.step, problem.count).elongation(responses).T, CLOSED_FORM_ERROR

    return call


def _picard(problem: Problem, tolerance: float) -> Call:
    from synth.propagators.picard import PicardPlan

    system, even = problem.system, EvenTimes(problem.step, problem.count)
    if not isinstance(system, DrivenPendulums) or isinstance(system.restoring, Linear):
        raise RefusedError("Picard collocation: made for pendulums with the full sine on a support moved as prescribed")
    motion, damping = (_sum(problem.horizontal), _sum(problem.vertical)), system.terms.damping_rate
    plan = PicardPlan(system.natural_frequency, damping, problem.start.reshape(-1, 2), *motion, system.gravity, even)

    def call() -> Answer:
        angles, error = plan.elongation()
        return angles.T, error

    return call


def _sum(swell: Swell) -> HarmonicSum:
    return HarmonicSum(swell.rate, swell.amplitude * np.exp(1j * swell.phase))


def _integrator(problem: Problem, tolerance: float, name: str) -> Call:
    integrate: Any = importlib.import_module(f"synth.integrators.{name}").integrate
    times = problem.times

    def call() -> Answer:
        found = integrate(problem.system, problem.start, times, tolerance=tolerance)
        return problem.angles(found.states), found.estimated_error

    return call


OWN: Mapping[str, Make] = {
    CLOSED: _closed_form,
    PICARD: _picard,
    "beam collocation": partial(_integrator, name="collocation"),
    "Radau": partial(_integrator, name="radau"),
    "explicit": partial(_integrator, name="explicit"),
}  # All propagators, by the names under which rows and pictures show them: (problem, tolerance) -> call
