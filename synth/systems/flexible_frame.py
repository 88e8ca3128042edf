"""Pendulums on a frame that yields sideways.

    (M + sum m_i) X'' + B X' + K X = -sum m_i l_i (sin phi_i)'',    phi_i'' + (g/l_i) sin phi_i + cos phi_i X''/l_i = terms_i

(section 3 of the formula sheet). Solved for X'', the factor is `M + sum m_i sin^2 phi_i`: never zero. On a ship X counts
from the ship, g becomes g + z'', the frame feels -(M + sum m_i) x_h'' more, and the pendulums -cos phi_i x_h''.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from synth.kernels.compiled import kernel
from synth.phase import Floats
from synth.systems.carried import carried, weight
from synth.systems.dispatch import registered
from synth.systems.terms import driven, driven_slope, motion


class FlexibleFrame(NamedTuple):
    """Parameters; state (X, X', phi_1, phi_1', ...). Mirror: X, all phi_i and x_h'' change sign together."""

    frame_mass: float
    """M, kg."""
    mass: Floats
    """(pendulums,) m_i, kg."""
    length: Floats
    """(pendulums,) l_i, m."""
    stiffness: float
    """K, N/m."""
    resistance: float = 0.0
    """B, N s/m."""
    gravity: float = 9.80665
    """m/s^2."""
    terms: Any = None
    """What drives or resists the swing, `terms.together(...)`, or None."""
    horizontal: Any = None
    """x_h'' of the ship: `Harmonics` or None."""
    vertical: Any = None
    """z'' of the ship, up positive: `Harmonics` or None."""

    @property
    def first_angle(self) -> int:
        """Place of the first pendulum's angle in the state."""
        return 2


@registered("derivative", FlexibleFrame)
@kernel
def _derivative(time: float, state: Floats, system: FlexibleFrame, out: Floats) -> None:
    masses, lengths, gravity, terms = system.mass, system.length, system.gravity, system.terms
    sideways, upwards = motion(time, system.horizontal), motion(time, system.vertical)
    whole = system.frame_mass
    inertia = system.frame_mass
    force = 0.0
    for i in range(lengths.size):
        angle, rate = state[2 * i + 2], state[2 * i + 3]
        sine, cosine = math.sin(angle), math.cos(angle)
        free = driven(-weight(sine, cosine, gravity, sideways, upwards) / lengths[i], i, angle, rate, terms)
        whole += masses[i]
        inertia += masses[i] * sine * sine
        force += masses[i] * lengths[i] * (sine * rate * rate - cosine * free)
        out[2 * i + 2] = cosine / lengths[i]
        out[2 * i + 3] = free
    force = carried(force, -whole, sideways)
    frame = (force - system.stiffness * state[0] - system.resistance * state[1]) / inertia
    out[0] = state[1]
    out[1] = frame
    for i in range(lengths.size):
        out[2 * i + 3] = out[2 * i + 3] - out[2 * i + 2] * frame
        out[2 * i + 2] = state[2 * i + 3]


@registered("jacobian", FlexibleFrame)
@kernel
def _jacobian(time: float, state: Floats, system: FlexibleFrame, out: Floats) -> None:
    masses, lengths, gravity, terms = system.mass, system.length, system.gravity, system.terms
    sideways, upwards = motion(time, system.horizontal), motion(time, system.vertical)
    out[:] = 0.0
    whole = system.frame_mass
    inertia = system.frame_mass
    force = 0.0
    for i in range(lengths.size):
        angle, rate = state[2 * i + 2], state[2 * i + 3]
        sine, cosine = math.sin(angle), math.cos(angle)
        free = driven(-weight(sine, cosine, gravity, sideways, upwards) / lengths[i], i, angle, rate, terms)
        whole += masses[i]
        inertia += masses[i] * sine * sine
        force += masses[i] * lengths[i] * (sine * rate * rate - cosine * free)
    force = carried(force, -whole, sideways)
    frame = (force - system.stiffness * state[0] - system.resistance * state[1]) / inertia
    out[0, 1] = 1.0
    out[1, 0] = -system.stiffness / inertia
    out[1, 1] = -system.resistance / inertia
    for i in range(lengths.size):
        angle, rate = state[2 * i + 2], state[2 * i + 3]
        sine, cosine = math.sin(angle), math.cos(angle)
        free = driven(-weight(sine, cosine, gravity, sideways, upwards) / lengths[i], i, angle, rate, terms)
        steeper = -weight(cosine, -sine, gravity, sideways, upwards) / lengths[i]
        by_angle, by_rate = driven_slope((steeper, 0.0), i, angle, rate, terms)
        moment = masses[i] * lengths[i]
        share = moment * (cosine * rate * rate + sine * free - cosine * by_angle)
        out[1, 2 * i + 2] = (share - 2.0 * masses[i] * sine * cosine * frame) / inertia
        out[1, 2 * i + 3] = moment * (2.0 * sine * rate - cosine * by_rate) / inertia
        out[2 * i + 2, 2 * i + 3] = 1.0
        out[2 * i + 3, 2 * i + 2] = by_angle + sine * frame / lengths[i]
        out[2 * i + 3, 2 * i + 3] = by_rate
    for i in range(lengths.size):
        lever = -math.cos(state[2 * i + 2]) / lengths[i]
        for column in range(state.size):
            out[2 * i + 3, column] += lever * out[1, column]


@registered("energy", FlexibleFrame)
@kernel
def _energy(state: Floats, system: FlexibleFrame) -> float:
    """J; pendulums at rest count -m g l."""
    total = 0.5 * (system.frame_mass * state[1] * state[1] + system.stiffness * state[0] * state[0])
    for i in range(system.length.size):
        swing = system.length[i] * state[2 * i + 3]
        cosine = math.cos(state[2 * i + 2])
        speed = state[1] * state[1] + 2.0 * cosine * state[1] * swing + swing * swing
        total += system.mass[i] * (0.5 * speed - system.gravity * system.length[i] * cosine)
    return total


@registered("response", FlexibleFrame)
@kernel
def _response(state: Floats, index: int, system: FlexibleFrame, out: Floats) -> None:
    """Unit impulse (N m s) on one pendulum; the frame recoils, and through it the others."""
    inertia = system.frame_mass
    for i in range(system.length.size):
        sine = math.sin(state[2 * i + 2])
        inertia += system.mass[i] * sine * sine
    out[:] = 0.0
    recoil = -math.cos(state[2 * index + 2]) / (system.length[index] * inertia)
    out[1] = recoil
    for i in range(system.length.size):
        out[2 * i + 3] = -math.cos(state[2 * i + 2]) * recoil / system.length[i]
    out[2 * index + 3] += 1.0 / (system.mass[index] * system.length[index] * system.length[index])
