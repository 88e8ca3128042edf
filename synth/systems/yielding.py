"""Pendulums on a support that yields: clocks on an elastic beam that moves up and down, or on a frame that moves sideways.

The beam, the full system (1) of Kanunnikov and Lamper, x counted down from the static sag at g:

    (M + sum m_i) x'' - sum m_i l_i (sin phi_i phi_i')' = -K x - (M + sum m_i) eps0 x'
    l_i phi_i'' - sin phi_i x'' = -g sin phi_i + l_i terms_i,                              K = M w_b^2

The frame (section 3 of the formula sheet), X counted from the ship:

    (M + sum m_i) X'' + B X' + K X = -sum m_i l_i (sin phi_i)'',    phi_i'' + (g/l_i) sin phi_i + cos phi_i X''/l_i = terms_i

Both are one system, with the lever e = sin phi of a beam and e = -cos phi of a frame, whose derivative is e' and its -e:

    (M + sum m_i) x'' - sum m_i l_i (e_i phi_i')' = -K x - D x',     l_i phi_i'' - e_i x'' = -g sin phi_i + l_i terms_i

Put into the first, the second gives x'' over `M + sum m_i e'_i^2`, which is never zero. On a ship g becomes g + z'', the
pendulums feel -cos phi_i x_h'', a beam (M + sum m_i) z'' more and a frame -(M + sum m_i) x_h''; these follow from
L = T - V with the bobs at (X_h + l sin phi, Z - x - l cos phi) and (X_h + X + l sin phi, Z - l cos phi).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from synth.kernels.compiled import kernel
from synth.phase import Floats
from synth.systems.dispatch import by_type, registered, taken_in
from synth.systems.terms import carried, driven, motion, weight


class ElasticBeam(NamedTuple):
    """Parameters; state (x, x', phi_1, phi_1', ...). Mirror: phi_i -> -phi_i, of each alone but for x_h''."""

    beam_mass: float  # M, effective, kg
    mass: Floats  # (pendulums,) m_i, kg
    length: Floats  # (pendulums,) l_i, m
    stiffness: float  # K, N/m
    damping_rate: float = 0.0  # eps0, 1/s
    gravity: float = 9.80665  # m/s^2
    terms: Any = None  # What drives or resists the swing, `terms.together(...)`, or None
    horizontal: Any = None  # x_h'' of the ship: `Harmonics` or None
    vertical: Any = None  # z'' of the ship, up positive: `Harmonics` or None

    @property
    def first_angle(self) -> int:
        """Place of the first pendulum's angle in the state."""
        return 2


class FlexibleFrame(NamedTuple):
    """Parameters; state (X, X', phi_1, phi_1', ...). Mirror: X, all phi_i and x_h'' change sign together."""

    frame_mass: float  # M, kg
    mass: Floats  # (pendulums,) m_i, kg
    length: Floats  # (pendulums,) l_i, m
    stiffness: float  # K, N/m
    resistance: float = 0.0  # B, N s/m
    gravity: float = 9.80665  # m/s^2
    terms: Any = None  # What drives or resists the swing, `terms.together(...)`, or None
    horizontal: Any = None  # x_h'' of the ship: `Harmonics` or None
    vertical: Any = None  # z'' of the ship, up positive: `Harmonics` or None

    @property
    def first_angle(self) -> int:
        """Place of the first pendulum's angle in the state."""
        return 2


@by_type("system")
def lever(sine: Any, cosine: Any, system: Any) -> Any:
    """e and e' of a pendulum, from sine and cosine of its angle."""


@taken_in
def own_mass(system: Any) -> Any:
    """M, kg: the first parameter of both."""
    return system[0]


@by_type("system")
def pushed(whole: float, system: Any, sideways: Any, upwards: Any) -> Any:
    """D in N s/m, and what the ship does to the support, N; `whole` is M + sum m_i."""


@registered("lever", ElasticBeam)
def _lever_of_beam(sine: Any, cosine: Any, system: ElasticBeam) -> tuple[Any, Any]:
    return sine, cosine


@registered("lever", FlexibleFrame)
def _lever_of_frame(sine: Any, cosine: Any, system: FlexibleFrame) -> tuple[Any, Any]:
    return -cosine, sine


@registered("pushed", ElasticBeam)
def _beam_pushed(whole: float, system: ElasticBeam, sideways: Any, upwards: Any) -> tuple[float, float]:
    return whole * system.damping_rate, carried(0.0, whole, upwards)


@registered("pushed", FlexibleFrame)
def _frame_pushed(whole: float, system: FlexibleFrame, sideways: Any, upwards: Any) -> tuple[float, float]:
    return system.resistance, carried(0.0, -whole, sideways)


@registered("derivative", FlexibleFrame)
@registered("derivative", ElasticBeam)
@taken_in
def _derivative(time: float, state: Floats, system: Any, out: Floats) -> None:
    masses, lengths, gravity, terms = system.mass, system.length, system.gravity, system.terms
    sideways, upwards = motion(time, system.horizontal), motion(time, system.vertical)
    whole = own_mass(system)
    inertia = whole
    force = 0.0
    for i in range(lengths.size):
        angle, rate = state[2 * i + 2], state[2 * i + 3]
        sine, cosine = math.sin(angle), math.cos(angle)
        free = driven(-weight(sine, cosine, gravity, sideways, upwards) / lengths[i], i, angle, rate, terms)
        arm, slope = lever(sine, cosine, system)
        whole += masses[i]
        inertia += masses[i] * slope * slope
        force += masses[i] * lengths[i] * (slope * rate * rate + arm * free)
        out[2 * i + 2] = arm / lengths[i]
        out[2 * i + 3] = free
    drag, push = pushed(whole, system, sideways, upwards)
    yielding = (force + push - system.stiffness * state[0] - drag * state[1]) / inertia
    out[0] = state[1]
    out[1] = yielding
    for i in range(lengths.size):
        out[2 * i + 3] = out[2 * i + 3] + out[2 * i + 2] * yielding
        out[2 * i + 2] = state[2 * i + 3]


@registered("response", FlexibleFrame)
@registered("response", ElasticBeam)
@kernel
def _response(state: Floats, index: int, system: Any, out: Floats) -> None:
    """Unit impulse (N m s) on one pendulum; the support recoils, and through it the others."""
    out[:] = 0.0
    inertia = own_mass(system)
    for i in range(system.length.size):
        arm, slope = lever(math.sin(state[2 * i + 2]), math.cos(state[2 * i + 2]), system)
        inertia += system.mass[i] * slope * slope
        out[2 * i + 3] = arm / system.length[i]
    recoil = out[2 * index + 3] / inertia
    out[1] = recoil
    for i in range(system.length.size):
        out[2 * i + 3] *= recoil
    out[2 * index + 3] += 1.0 / (system.mass[index] * system.length[index] * system.length[index])


def stiffness_of_ratio(ratio: float, system: ElasticBeam) -> float:
    """Stiffness that makes the loaded beam `ratio` times faster than a pendulum of the first length."""
    total = system.beam_mass + float(np.sum(system.mass))
    return total * ratio * ratio * system.gravity / float(system.length[0])
