"""Energies of the systems, without drive and damping, and the pendulum counted from the top."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from synth.kernels.compiled import kernel
from synth.phase import Floats
from synth.systems.dispatch import by_type, registered
from synth.systems.driven_pendulums import DrivenPendulums, Linear, Sine
from synth.systems.reduced_beam import ReducedBeam
from synth.systems.yielding import ElasticBeam, FlexibleFrame, Metronomes, lever


class SineFromTop(NamedTuple):
    """The sine law, its angle counted from the upward vertical; no motion of the support.

    Near the top the sine of theta is the small difference of theta and pi, lost in rounding; from there it is exact.
    """

    power: float = 1.0
    """Unused: a tuple without fields does not compile."""


@registered("slant", SineFromTop)
def _slant_at_top(angle: float, restoring: SineFromTop) -> tuple[float, float]:
    return -math.sin(angle), -math.cos(angle)


@by_type("system")
def energy(state: Any, system: Any) -> Any:
    """Energy of a conservative system (without drive and damping)."""


@by_type("restoring")
def height(angle: float, restoring: Any) -> Any:
    """Potential energy over m l^2 n^2; `1 - cos` without its cancellation."""


@registered("height", Sine)
def _height(angle: float, restoring: Sine) -> float:
    return 2.0 * math.sin(0.5 * angle) * math.sin(0.5 * angle)


@registered("height", SineFromTop)
def _height_at_top(angle: float, restoring: SineFromTop) -> float:
    return 2.0 * math.cos(0.5 * angle) * math.cos(0.5 * angle)


@registered("height", Linear)
def _height_linear(angle: float, restoring: Linear) -> float:
    return 0.5 * angle * angle


@registered("energy", DrivenPendulums)
@kernel
def _pendulums(state: Floats, system: DrivenPendulums) -> float:
    """Sum over pendulums of energy per m l^2, rad^2/s^2, zero at rest."""
    total = 0.0
    for i in range(system.natural_frequency.size):
        square = system.natural_frequency[i] * system.natural_frequency[i]
        total += 0.5 * state[2 * i + 1] * state[2 * i + 1] + square * height(state[2 * i], system.restoring)
    return total


@registered("energy", Metronomes)
@kernel
def _metronomes(state: Floats, system: Metronomes) -> float:
    """Per m l^2; kept without terms and without a ship."""
    total = 0.0
    board = 0.0
    for i in range(system.natural_frequency.size):
        angle, rate = state[2 * i], state[2 * i + 1]
        total += 0.5 * rate * rate - system.natural_frequency[i] * system.natural_frequency[i] * math.cos(angle)
        board += math.cos(angle) * rate
    return total - 0.5 * system.coupling * board * board


@registered("energy", ReducedBeam)
@kernel
def _reduced(state: Floats, system: ReducedBeam) -> float:
    """Kept when d = d0 = 0; in units of the beam's motion."""
    total = 0.5 * state[1] * state[1] + 2.0 * state[0] * state[0]
    for i in range(system.detuning.size):
        y, rate = state[2 * i + 2], state[2 * i + 3]
        swing = rate * rate + (1.0 + system.detuning[i]) * y * y - 2.0 * y * rate * state[1]
        total += system.coupling * swing
    return total


@registered("energy", FlexibleFrame)
@registered("energy", ElasticBeam)
@kernel
def energy_yielding(state: Floats, system: Any) -> float:
    """J; pendulums at rest count -m g l."""
    total = 0.5 * (system.own_mass * state[1] * state[1] + system.stiffness * state[0] * state[0])
    for i in range(system.length.size):
        swing = system.length[i] * state[2 * i + 3]
        cosine = math.cos(state[2 * i + 2])
        arm, _ = lever(math.sin(state[2 * i + 2]), cosine, system)
        speed = state[1] * state[1] - 2.0 * arm * state[1] * swing + swing * swing
        total += system.mass[i] * (0.5 * speed - system.gravity * system.length[i] * cosine)
    return total
