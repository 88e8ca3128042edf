"""From a scene that needs a general integrator to its system of `synth.systems`, its start, kicks and integrator."""

from collections.abc import Sequence
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from data_schemas.errors import RefusedError
from data_schemas.scene import Propagator, Scene, felt_gravity
from data_schemas.scene_pendulum import BeamSupport, BoardSupport, FrameSupport, FreeStart, ImpulseEscapement, Pendulum
from synth.disturbances import Kicks
from synth.motion.harmonic_sum import HarmonicSum
from synth.pendulums.linear import respond, start_state
from synth.phase import Floats
from synth.systems.driven_pendulums import DrivenPendulums, Linear, Sine
from synth.systems.resistance import terms_of
from synth.systems.terms import Harmonics, Impulses, harmonics

_DIRECTIONS = {"rising": 1, "falling": -1, "both": 0}


class Assembly(NamedTuple):
    """Equations of motion with their start."""

    system: Any  # Of `synth.systems`.
    start: Floats  # (n,) state at t = 0, in the system's own units
    kicks: Any = None
    time_scale: float = 1.0  # The system's time over seconds
    units: Floats | None = None  # (n,) physical state over the system's own; None where they are the same
    board: float | None = None  # Displacement of a rolling board by the sum of the sines, m

    def rows(self, states: Floats) -> Floats:
        """From states (k, n): angles, (pendulums, k) rad, and below them the displacement of a yielding support, m."""
        states = states if self.units is None else states * self.units
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
    kicks: Kicks | None,
    end: float,
) -> Assembly:
    """The equations of a scene until `end`, s; `RefusedError` if the reduced beam cannot hold the clocks.

    The frequencies are those at infinitesimal arc on a rigid support, rad/s.
    """
    pendulums, support, gravity = scene.pendulums, scene.support, felt_gravity(scene)
    terms, sideways, upwards = terms_of(pendulums), _harmonics(motion), _harmonics(vertical)
    own, even = np.array(frequencies), np.ones(len(frequencies))
    swing = np.array([_start(each, n, motion, gravity) for each, n in zip(pendulums, frequencies, strict=True)]).ravel()
    system: Any
    match support:
        case BoardSupport():
            from synth.systems.yielding import Metronomes

            system = Metronomes(own, support.coupling, terms, scene.gravity, upwards)
            lever = -support.coupling * float(np.mean(scene.gravity / own**2))
            return Assembly(system, swing, _kicks(system, pendulums, even), board=lever)
        case BeamSupport() | FrameSupport():
            from synth.systems.yielding import ElasticBeam, FlexibleFrame

            masses = np.array([float(each.mass or 0.0) for each in pendulums])
            lengths = np.array([scene.reference_gravity * (each.period / (2 * np.pi)) ** 2 for each in pendulums])
            given = support.mass, masses, lengths, support.stiffness
            at_sea = scene.gravity, terms, sideways, upwards
            start = np.concatenate([[support.displacement, support.velocity], swing])
            if isinstance(support, FrameSupport):
                system = FlexibleFrame(*given, support.resistance, *at_sea)
            else:
                system = ElasticBeam(*given, support.damping_rate, *at_sea)
                if support.equations == "reduced":
                    from synth.systems.reduced_beam import reduced

                    small = reduced(system)
                    return Assembly(small.system, start / small.units, None, small.time_scale, small.units)
            return Assembly(system, start, _kicks(system, pendulums, masses * lengths**2))
    impulses = None
    if kicks is not None:
        kept, angles, rates = (np.ascontiguousarray(each.T) for each in kicks.changes(0, int(end / kicks.step)))
        impulses = Impulses(float(kicks.step), kept, angles, rates * own)
    law = Sine() if scene.restoring == "sine" else Linear()
    system = DrivenPendulums(own, gravity, law, sideways, upwards, terms, impulses)
    return Assembly(system, swing, _kicks(system, pendulums, even))


def _harmonics(motion: HarmonicSum) -> Harmonics | None:
    if not motion.acceleration.any():
        return None
    return harmonics(np.abs(motion.acceleration), motion.angular_frequency, np.angle(motion.acceleration))


def _start(pendulum: Pendulum, frequency: float, motion: HarmonicSum, gravity: float) -> Floats:
    """Angle and angular velocity; of a free start, those of the linear pendulum on a rigid support."""
    start = pendulum.start
    if isinstance(start, FreeStart):
        return start_state(respond(frequency, pendulum.damping_rate, start, motion, gravity))
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

    return escapement(system, *(np.array(column) for column in zip(*kicking, strict=True)))


_MODULES: dict[Propagator, str] = {
    "beam-collocation": "synth.integrators.collocation",
    "explicit": "synth.integrators.explicit",
    "radau": "synth.integrators.radau",
}


def integrated(
    assembly: Assembly, propagators: Sequence[Propagator], seconds: Floats, tolerance: float
) -> tuple[Floats, float, Propagator]:
    """Integrate by the first of the propagators that does not refuse; `RefusedError` with every reason if all do.

    Returned are `Assembly.rows`, the estimated error of the worst component over its largest size, and the propagator.
    """
    times = seconds * assembly.time_scale
    begins = int(times[0] > 0.0)  # states are wanted from t = 0 on
    instants = np.concatenate([[0.0], times]) if begins else times
    event: dict[str, Any] = {} if assembly.kicks is None else {"event": assembly.kicks}  # of the explicit one alone
    reasons = []
    for name in propagators:
        integrate = import_module(_MODULES[name]).integrate  # one, and no other
        try:
            solution = integrate(assembly.system, assembly.start, instants, tolerance=tolerance, **event)
        except RefusedError as refusal:
            reasons.append(str(refusal))
        else:
            return assembly.rows(solution.states[begins:]), solution.estimated_error, name
    raise RefusedError("; ".join(reasons))
