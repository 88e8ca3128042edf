"""The problems on which integrators are raced: a start, instants to read at, and the equations for each side.

Equations are given twice: as the project's own system, and plainly, as a user of a general integrator would write them
with Numba. The formulas for heyoka are in `symbolic`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.benchmarks.linear_hour import GRAVITY, HARMONICS, HOUR, RATE, Task, task
from pipeline.benchmarks.plain_pendulums import PlainPendulums, Swell
from synth.phase import Floats
from synth.systems.driven_pendulums import DrivenPendulums
from synth.systems.elastic_beam import ElasticBeam, stiffness_of_ratio
from synth.systems.harmonic_motion import Harmonics, harmonics
from synth.systems.resistance import VanDerPolDrive, Viscous
from synth.systems.restoring import Linear, Sine
from synth.systems.van_der_pol import VanDerPol

BEAM_RATE = 20  # readings a second
HEAVE = 0.07  # m/s^2 of each vertical harmonic: z''/g = 0.03 r.m.s.


@dataclass(frozen=True)
class Problem:
    """One initial value problem.

    Attributes
    ----------
    name, title : str
    system, plain : NamedTuple
        The project's own system, and the one whose compiled right-hand side general integrators are given.
    start, times : (n,), (k,) arrays
    judged : tuple of int
        Components whose errors are compared: angles.
    stiff : bool
        Which peers are sensible, and which tolerances.
    horizontal, vertical : Swell or None
        Motion of the support of pendulums.
    task : Task or None
        The linear problem as the closed form and its 40-digit reference take it.
    rate : int or None
        Readings a second, where some propagator counts them in whole numbers.
    """

    name: str
    title: str
    system: Any
    plain: Any
    start: Floats
    times: Floats
    judged: tuple[int, ...]
    stiff: bool = False
    horizontal: Swell | None = None
    vertical: Swell | None = None
    task: Task | None = None
    rate: int | None = None


def problems(*, quick: bool) -> Mapping[str, Problem]:
    """All of them by name; quick ones are a tenth as long, the stiff ones alike."""
    share = 10 if quick else 1
    made = (
        linear(HOUR // share),
        nonlinear(HOUR // share),
        beam(1000 // share),
        van_der_pol(),
        stiff_beam(),
    )
    return {each.name: each for each in made}


def linear(seconds: int = HOUR) -> Problem:
    """Two linear pendulums, 33 harmonics, 20 readings a second."""
    given = task(seconds)
    return _pendulums("linear", "two linear pendulums, 33 harmonics, 20 Hz", given, None, Linear())


def nonlinear(seconds: int = HOUR) -> Problem:
    """The same with the full sine, and 33 harmonics of vertical motion."""
    chance = np.random.default_rng(66)
    heave = Swell(
        np.full(HARMONICS, HEAVE),
        2.0 * np.pi / chance.uniform(4.0, 20.0, HARMONICS),
        chance.uniform(0.0, 2.0 * np.pi, HARMONICS),
    )
    given = task(seconds)
    return _pendulums("nonlinear", "two pendulums, sine, 33 + 33 harmonics, 20 Hz", given, heave, Sine())


def _pendulums(name: str, title: str, given: Task, vertical: Swell | None, restoring: Any) -> Problem:
    horizontal = Swell(*(np.array(column, np.float64) for column in (given.amplitude, given.rate, given.phase)))
    linear_law = isinstance(restoring, Linear)
    frequency, damping = np.array(given.frequency, np.float64), np.array(given.damping_rate, np.float64)
    system = DrivenPendulums(frequency, GRAVITY, restoring, _moved(horizontal), _moved(vertical), Viscous(damping))
    still = Swell(np.zeros(0), np.zeros(0), np.zeros(0)) if vertical is None else vertical
    plain = PlainPendulums(frequency, damping, GRAVITY, horizontal, still, not linear_law)
    start = np.array([given.angle, given.speed], np.float64).T.ravel()
    return Problem(
        name,
        f"{title}, {given.seconds} s",
        system,
        plain,
        start,
        np.array(given.time, np.float64),
        (0, 2),
        horizontal=horizontal,
        vertical=vertical,
        task=given if linear_law else None,
        rate=RATE,
    )


def _moved(motion: Swell | None) -> Harmonics | None:
    return None if motion is None else harmonics(motion.amplitude, motion.rate, motion.phase)


def beam(oscillations: int = 1000) -> Problem:
    """Clocks on an elastic beam, with the parameters of reference trajectory B; about 1 s an oscillation."""
    length = np.array([0.249, 0.2484])
    drive = VanDerPolDrive(np.full(2, 0.06), 0.0138 / length)
    system = ElasticBeam(50.0, np.full(2, 0.25), length, 8000.0, 0.25, 9.81, drive)
    return Problem(
        "beam",
        f"two clocks on an elastic beam, {oscillations} oscillations",
        system,
        system,
        np.array([0.001, 0.0, 0.1, 0.0, -0.07, 0.3]),
        np.arange(oscillations * BEAM_RATE + 1) / BEAM_RATE,
        (2, 4),
    )


def van_der_pol() -> Problem:
    """The field's stiff reference: mu = 1000 to t = 2000."""
    system = VanDerPol(1000.0)
    return Problem(
        "van der Pol",
        "van der Pol, mu = 1000, at t = 2000",
        system,
        system,
        np.array([2.0, 0.0]),
        np.array([0.0, 2000.0]),
        (0,),
        stiff=True,
    )


def stiff_beam() -> Problem:
    """Two heavy pendulums on a beam a thousand times faster than they, damped at half of critical, 20 s."""
    length = np.array([1.0, 0.9])
    loose = ElasticBeam(2.0, np.full(2, 1.0), length, 0.0, 0.0, 9.81)
    stiffness = stiffness_of_ratio(1000.0, loose)
    fastest = 1000.0 * float(np.sqrt(9.81 / length[0]))
    system = loose._replace(stiffness=stiffness, damping_rate=fastest)
    return Problem(
        "stiff beam",
        "two pendulums on a beam 1000 times faster, 20 s",
        system,
        system,
        np.array([0.0, 0.0, 1.0, 0.0, -0.5, 0.0]),
        np.arange(401) / 20.0,
        (2, 4),
        stiff=True,
    )
