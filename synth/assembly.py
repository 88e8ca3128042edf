"""From a scene to equations of motion and their states: a system of `synth.systems`, its start, kicks, an integrator.

Only scenes that need a general integrator come here, and only here are systems and their compiler imported.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from data_schemas.errors import RefusedError
from data_schemas.scene import Propagator, Scene
from data_schemas.scene_conditions import felt_gravity
from data_schemas.scene_pendulum import (
    BeamSupport,
    BoardSupport,
    FrameSupport,
    FreeStart,
    ImpulseEscapement,
    Pendulum,
    VanDerPolEscapement,
)
from synth.kicks import Kicks
from synth.motion.harmonic_sum import HarmonicSum
from synth.pendulums.linear import respond, start_state
from synth.phase import Floats
from synth.systems.driven_pendulums import Linear, Sine
from synth.systems.harmonic_motion import Harmonics, harmonics
from synth.systems.resistance import VanDerPolDrive, resistances
from synth.systems.terms import Impulses, together

_DIRECTIONS = {"rising": 1, "falling": -1, "both": 0}


@dataclass(frozen=True)
class Assembly:
    """Equations of motion with their start."""

    system: Any
    """Of `synth.systems`."""
    start: Floats
    """(n,) state at t = 0, in the system's own units."""
    kicks: Any = None
    time_scale: float = 1.0
    """The system's time over seconds."""
    units: Floats | None = None
    """(n,) physical state over the system's own; None where they are the same."""
    board: float | None = None
    """Displacement of a rolling board by the sum of the sines, m."""

    def rows(self, states: Floats) -> Floats:
        """Angles of the pendulums, and below them the displacement of a support that yields.

        Parameters
        ----------
        states : (k, n) float64
            In the system's own units.

        Returns
        -------
        (pendulums or pendulums + 1, k) float64
            rad, and m
        """
        if self.units is not None:
            states = states * self.units
        first = self.system.first_angle
        angles = states[:, first::2].T
        if self.board is not None:
            return np.vstack([angles, self.board * np.sin(angles).sum(axis=0)])
        return np.vstack([angles, states[:, 0]]) if first else angles


def assemble(
    scene: Scene,
    frequencies: Sequence[float],
    motion: HarmonicSum,
    vertical: HarmonicSum,
    kicks: Kicks | None = None,
    end: float = 0.0,
) -> Assembly:
    """Build the equations of a scene.

    `RefusedError` if the reduced beam cannot hold the clocks.

    Parameters
    ----------
    scene
        What is to move.
    frequencies : (pendulums,)
        At infinitesimal arc on a rigid support, rad/s.
    motion, vertical : HarmonicSum
        Horizontal and vertical acceleration of the ship.
    kicks : Kicks or None
        Random impulses of pendulums on a fixed support.
    end : float
        Until when they are wanted, s.
    """
    pendulums = scene.pendulums
    terms = _terms(pendulums)
    sideways, upwards = _harmonics(motion), _harmonics(vertical)
    own = np.array(frequencies)
    gravity = felt_gravity(scene)
    swing = np.array([_start(each, n, motion, gravity) for each, n in zip(pendulums, frequencies, strict=True)]).ravel()
    support = scene.support
    if isinstance(support, BoardSupport):
        from synth.systems.metronomes import Metronomes

        system: Any = Metronomes(own, support.coupling, terms, scene.gravity, upwards)
        lever = -support.coupling * float(np.mean(scene.gravity / own**2))
        return Assembly(system, swing, _kicks(system, pendulums, np.ones(own.size)), board=lever)
    if not isinstance(support, BeamSupport | FrameSupport):
        from synth.systems.driven_pendulums import DrivenPendulums

        law = Sine() if scene.restoring == "sine" else Linear()
        system = DrivenPendulums(own, gravity, law, sideways, upwards, terms, _impulses(kicks, own, end))
        return Assembly(system, swing, _kicks(system, pendulums, np.ones(own.size)))
    masses = np.array([float(each.mass or 0.0) for each in pendulums])
    lengths = np.array([scene.reference_gravity * (each.period / (2 * np.pi)) ** 2 for each in pendulums])
    start = np.concatenate([[support.displacement, support.velocity], swing])
    if isinstance(support, FrameSupport):
        from synth.systems.yielding import FlexibleFrame

        resistance = support.resistance
        system = FlexibleFrame(
            support.mass, masses, lengths, support.stiffness, resistance, scene.gravity, terms, sideways, upwards
        )
        return Assembly(system, start, _kicks(system, pendulums, masses * lengths**2))
    from synth.systems.yielding import ElasticBeam

    damping = support.damping_rate
    system = ElasticBeam(
        support.mass, masses, lengths, support.stiffness, damping, scene.gravity, terms, sideways, upwards
    )
    if support.equations == "full":
        return Assembly(system, start, _kicks(system, pendulums, masses * lengths**2))
    from synth.systems.reduced_beam import reduced

    made = reduced(system)
    units = made.physical(np.ones(start.size))
    return Assembly(made.system, start / units, None, made.time_scale, units)


def _terms(pendulums: Sequence[Pendulum]) -> Any:
    """What resists or drives, only what some pendulum has."""
    drives = [each.escapement if isinstance(each.escapement, VanDerPolEscapement) else None for each in pendulums]
    # one without the drive that another has: nothing of it, at any angle
    rows = [(each.rate, each.angle) if each else (0.0, 1.0) for each in drives]
    return together(*resistances(pendulums), VanDerPolDrive(*_columns(rows)) if any(drives) else None)


def _impulses(kicks: Kicks | None, own: Floats, end: float) -> Impulses | None:
    if kicks is None:
        return None
    kept, angles, rates = (np.ascontiguousarray(each.T) for each in kicks.changes(0, int(end / kicks.step)))
    return Impulses(float(kicks.step), kept, angles, rates * own)


def _columns(rows: list[tuple[float, float]]) -> Floats:
    return np.ascontiguousarray(np.array(rows).T)


def _harmonics(motion: HarmonicSum) -> Harmonics | None:
    if not motion.acceleration.any():
        return None
    return harmonics(np.abs(motion.acceleration), motion.angular_frequency, np.angle(motion.acceleration))


def _start(pendulum: Pendulum, frequency: float, motion: HarmonicSum, gravity: float) -> Floats:
    """Angle and angular velocity; of a free start, those of the linear pendulum on a rigid support."""
    start = pendulum.start
    if isinstance(start, FreeStart):
        response = respond(frequency, pendulum.damping_rate, start, motion, gravity)
        return start_state(response, motion.angular_frequency)
    return np.array([start.angle, start.angular_velocity])


def _kicks(system: Any, pendulums: Sequence[Pendulum], inertias: Floats) -> Any:
    """Impulse escapements; `inertias` turn energy per m l^2 into the system's."""
    kicking = [
        (number, kick.angle, kick.energy * inertias[number], _DIRECTIONS[kick.direction])
        for number, kick in enumerate(each.escapement for each in pendulums)
        if isinstance(kick, ImpulseEscapement)
    ]
    if not kicking:
        return None
    from synth.integrators.events import escapement

    number, angle, energy, direction = (np.array(column) for column in zip(*kicking, strict=True))
    return escapement(system, number, angle, energy, direction)


_MODULES: dict[Propagator, str] = {
    "beam-collocation": "synth.integrators.collocation",
    "explicit": "synth.integrators.explicit",
    "radau": "synth.integrators.radau",
}


def integrated(
    assembly: Assembly, propagators: Sequence[Propagator], seconds: Floats, tolerance: float
) -> tuple[Floats, float, Propagator]:
    """Integrate by the first of the propagators that does not refuse.

    `RefusedError` if all refuse; the message holds every reason.

    Parameters
    ----------
    assembly
        What moves.
    propagators
        In the order to be tried.
    seconds : (k,)
        The moments, increasing, none before t = 0, s.
    tolerance : float
        Error wanted, relative.

    Returns
    -------
    rows : (pendulums or pendulums + 1, k) float64
        As `Assembly.rows` gives them.
    estimated_error : float
        Of the worst component, relative to its largest size.
    propagator : str
        Who did it.
    """
    times = seconds * assembly.time_scale
    begins = int(times[0] > 0.0)  # states are wanted from t = 0 on
    instants = np.concatenate([[0.0], times]) if begins else times
    event: dict[str, Any] = {} if assembly.kicks is None else {"event": assembly.kicks}  # of the explicit one alone
    reasons = []
    for name in propagators:
        integrate = import_module(_MODULES[name]).integrate  # one, and no other
        try:
            found = integrate(assembly.system, assembly.start, instants, tolerance=tolerance, **event)
        except RefusedError as refusal:
            reasons.append(str(refusal))
        else:
            return assembly.rows(found.states[begins:]), found.estimated_error, name
    raise RefusedError("; ".join(reasons))
