"""Clocks on an elastic beam that moves up and down: the full system (1) of Kanunnikov and Lamper.

    (M + sum m_i) x'' - sum m_i l_i (sin phi_i phi_i')' = -K x - (M + sum m_i) eps0 x'
    l_i phi_i'' - sin phi_i x'' = -g sin phi_i + l_i terms_i,                              K = M w_b^2

x is counted down from the static sag at g. On a ship g becomes g + z'', the beam feels (M + sum m_i) z'' more, and the
pendulums -cos phi_i x_h''; these follow from L = T - V with the bobs at (X_h + l sin phi, Z - x - l cos phi). Put into the first, the second gives x'' over `M + sum m_i cos^2 phi_i`,
which is never zero.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from synth.kernels.compiled import kernel
from synth.phase import Floats
from synth.systems.carried import carried, weight
from synth.systems.dispatch import registered
from synth.systems.terms import driven, driven_slope, motion


class ElasticBeam(NamedTuple):
    """Parameters; state (x, x', phi_1, phi_1', phi_2, phi_2', ...). Mirror: phi_i -> -phi_i, of each alone if the ship
    does not move sideways."""

    beam_mass: float
    """M, effective, kg."""
    mass: Floats
    """(pendulums,) m_i, kg."""
    length: Floats
    """(pendulums,) l_i, m."""
    stiffness: float
    """K, N/m."""
    damping_rate: float = 0.0
    """eps0, 1/s."""
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


@registered("derivative", ElasticBeam)
@kernel
def _derivative(time: float, state: Floats, system: ElasticBeam, out: Floats) -> None:
    masses, lengths, gravity, terms = system.mass, system.length, system.gravity, system.terms
    sideways, upwards = motion(time, system.horizontal), motion(time, system.vertical)
    whole = system.beam_mass
    inertia = system.beam_mass
    force = 0.0
    for i in range(lengths.size):
        angle, rate = state[2 * i + 2], state[2 * i + 3]
        sine, cosine = math.sin(angle), math.cos(angle)
        free = driven(-weight(sine, cosine, gravity, sideways, upwards) / lengths[i], i, angle, rate, terms)
        whole += masses[i]
        inertia += masses[i] * cosine * cosine
        force += masses[i] * lengths[i] * (cosine * rate * rate + sine * free)
        out[2 * i + 2] = sine / lengths[i]
        out[2 * i + 3] = free
    force = carried(force, whole, upwards)
    beam = (force - system.stiffness * state[0] - whole * system.damping_rate * state[1]) / inertia
    out[0] = state[1]
    out[1] = beam
    for i in range(lengths.size):
        out[2 * i + 3] = out[2 * i + 3] + out[2 * i + 2] * beam
        out[2 * i + 2] = state[2 * i + 3]


@registered("jacobian", ElasticBeam)
@kernel
def _jacobian(time: float, state: Floats, system: ElasticBeam, out: Floats) -> None:
    masses, lengths, gravity, terms = system.mass, system.length, system.gravity, system.terms
    sideways, upwards = motion(time, system.horizontal), motion(time, system.vertical)
    out[:] = 0.0
    whole = system.beam_mass
    inertia = system.beam_mass
    force = 0.0
    for i in range(lengths.size):
        angle, rate = state[2 * i + 2], state[2 * i + 3]
        sine, cosine = math.sin(angle), math.cos(angle)
        free = driven(-weight(sine, cosine, gravity, sideways, upwards) / lengths[i], i, angle, rate, terms)
        whole += masses[i]
        inertia += masses[i] * cosine * cosine
        force += masses[i] * lengths[i] * (cosine * rate * rate + sine * free)
    force = carried(force, whole, upwards)
    beam = (force - system.stiffness * state[0] - whole * system.damping_rate * state[1]) / inertia
    out[0, 1] = 1.0
    out[1, 0] = -system.stiffness / inertia
    out[1, 1] = -whole * system.damping_rate / inertia
    for i in range(lengths.size):
        angle, rate = state[2 * i + 2], state[2 * i + 3]
        sine, cosine = math.sin(angle), math.cos(angle)
        free = driven(-weight(sine, cosine, gravity, sideways, upwards) / lengths[i], i, angle, rate, terms)
        steeper = -weight(cosine, -sine, gravity, sideways, upwards) / lengths[i]
        by_angle, by_rate = driven_slope((steeper, 0.0), i, angle, rate, terms)
        moment = masses[i] * lengths[i]
        share = moment * (cosine * free + sine * by_angle - sine * rate * rate)
        out[1, 2 * i + 2] = (share + 2.0 * masses[i] * sine * cosine * beam) / inertia
        out[1, 2 * i + 3] = moment * (2.0 * cosine * rate + sine * by_rate) / inertia
        out[2 * i + 2, 2 * i + 3] = 1.0
        out[2 * i + 3, 2 * i + 2] = by_angle + cosine * beam / lengths[i]
        out[2 * i + 3, 2 * i + 3] = by_rate
    for i in range(lengths.size):
        lever = math.sin(state[2 * i + 2]) / lengths[i]
        for column in range(state.size):
            out[2 * i + 3, column] += lever * out[1, column]


@registered("energy", ElasticBeam)
@kernel
def _energy(state: Floats, system: ElasticBeam) -> float:
    """J; pendulums at rest count -m g l."""
    total = 0.5 * (system.beam_mass * state[1] * state[1] + system.stiffness * state[0] * state[0])
    for i in range(system.length.size):
        swing = system.length[i] * state[2 * i + 3]
        sine, cosine = math.sin(state[2 * i + 2]), math.cos(state[2 * i + 2])
        speed = state[1] * state[1] - 2.0 * sine * state[1] * swing + swing * swing
        total += system.mass[i] * (0.5 * speed - system.gravity * system.length[i] * cosine)
    return total


@registered("response", ElasticBeam)
@kernel
def _response(state: Floats, index: int, system: ElasticBeam, out: Floats) -> None:
    """Unit impulse (N m s) on one pendulum; the beam recoils, and through it the others."""
    inertia = system.beam_mass
    for i in range(system.length.size):
        cosine = math.cos(state[2 * i + 2])
        inertia += system.mass[i] * cosine * cosine
    out[:] = 0.0
    recoil = math.sin(state[2 * index + 2]) / (system.length[index] * inertia)
    out[1] = recoil
    for i in range(system.length.size):
        out[2 * i + 3] = math.sin(state[2 * i + 2]) * recoil / system.length[i]
    out[2 * index + 3] += 1.0 / (system.mass[index] * system.length[index] * system.length[index])


def stiffness_of_ratio(ratio: float, system: ElasticBeam) -> float:
    """Stiffness that makes the loaded beam `ratio` times faster than a pendulum of the first length."""
    total = system.beam_mass + float(np.sum(system.mass))
    return total * ratio * ratio * system.gravity / float(system.length[0])
