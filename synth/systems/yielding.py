"""Pendulums on a support that yields: an elastic beam that moves up and down, a frame that moves sideways, a rolling board.

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

Metronomes on a board that rolls freely (Pantaleone 2002, Am. J. Phys. 70, 992), in physical time:

    th_i'' + n_i^2 (1 + zeta) sin th_i - b cos th_i sum (sin th_j)'' = terms_i,      zeta = z''/g

Pantaleone's own form, `th'' + (1 +- D) sin th + mu ((th/th0)^2 - 1) th' - b cos th sum (sin th)'' = 0` in radians of
the mean metronome, is `n_i = sqrt(1 +- D)` with a `VanDerPolDrive` of rate mu and angle th0. Solved for
`sum (sin th)''`, the factor `1 - b sum cos^2 th` appears, positive as long as b times the number of metronomes is
below 1, as it is for every real board (b = m x (lever)/(total mass)). A horizontal motion of the ship changes
nothing: the board rolls and stays behind, metronomes with it.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from synth.kernels.compiled import kernel
from synth.phase import Floats
from synth.systems.dispatch import by_type, registered, taken_in
from synth.systems.terms import carried, driven, motion, weight


class ElasticBeam(NamedTuple):
    """Parameters; state (x, x', phi_1, phi_1', ...). Mirror: phi_i -> -phi_i, of each alone but for x_h''."""

    own_mass: float  # M, effective, kg
    mass: Floats  # (pendulums,) m_i, kg
    length: Floats  # (pendulums,) l_i, m
    stiffness: float  # K, N/m
    damping_rate: float = 0.0  # eps0, 1/s
    gravity: float = 9.80665  # m/s^2
    terms: Any = None  # What drives or resists the swing, `terms.together(...)`, or None
    horizontal: Any = None  # x_h'' of the ship: `Harmonics` or None
    vertical: Any = None  # z'' of the ship, up positive: `Harmonics` or None
    first_angle: int = 2  # Place of the first pendulum's angle in the state


class FlexibleFrame(NamedTuple):
    """Parameters; state (X, X', phi_1, phi_1', ...). Mirror: X, all phi_i and x_h'' change sign together."""

    own_mass: float  # M, kg
    mass: Floats  # (pendulums,) m_i, kg
    length: Floats  # (pendulums,) l_i, m
    stiffness: float  # K, N/m
    resistance: float = 0.0  # B, N s/m
    gravity: float = 9.80665  # m/s^2
    terms: Any = None  # What drives or resists the swing, `terms.together(...)`, or None
    horizontal: Any = None  # x_h'' of the ship: `Harmonics` or None
    vertical: Any = None  # z'' of the ship, up positive: `Harmonics` or None
    first_angle: int = 2  # Place of the first pendulum's angle in the state


@by_type("system")
def lever(sine: Any, cosine: Any, system: Any) -> Any:
    """e and e' of a pendulum, from sine and cosine of its angle."""


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
    whole = system.own_mass
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
    inertia = system.own_mass
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
    total = system.own_mass + float(np.sum(system.mass))
    return total * ratio * ratio * system.gravity / float(system.length[0])


class Metronomes(NamedTuple):
    """Parameters; state (th_1, th_1', th_2, th_2', ...). Mirror: all angles change sign together."""

    natural_frequency: Floats  # (metronomes,) n_i on a board held fast, rad/s
    coupling: float  # b
    terms: Any = None  # What drives or resists the swing, `terms.together(...)`, or None
    gravity: float = 9.80665  # m/s^2; only the ratio of z'' to it matters
    vertical: Any = None  # z'' of the ship, up positive: `Harmonics` or None
    first_angle: int = 0  # Place of the first pendulum's angle in the state

    def difficulty(self, state: Floats) -> str | None:
        """Why there is no motion, or None."""
        if self.coupling * self.natural_frequency.size < 1.0:
            return None
        return "the coupling of the metronomes exceeds 1/number, so that the board would weigh nothing; make it smaller"


@registered("derivative", Metronomes)
@kernel
def _derivative_of_board(time: float, state: Floats, system: Metronomes, out: Floats) -> None:
    """Accelerations as if the board were held, then what its own, of sum (sin th_j), adds."""
    frequencies, coupling, gravity, terms = system.natural_frequency, system.coupling, system.gravity, system.terms
    upwards = motion(time, system.vertical)
    force = 0.0
    inertia = 1.0
    for i in range(frequencies.size):
        angle, rate = state[2 * i], state[2 * i + 1]
        cosine, sine = math.cos(angle), math.sin(angle)
        square = frequencies[i] * frequencies[i] / gravity
        free = driven(-square * weight(sine, cosine, gravity, None, upwards), i, angle, rate, terms)
        force += cosine * free - sine * rate * rate
        inertia -= coupling * cosine * cosine
        out[2 * i] = cosine
        out[2 * i + 1] = free
    board = force / inertia if inertia > 0.0 else math.nan
    for i in range(frequencies.size):
        out[2 * i + 1] += coupling * out[2 * i] * board
        out[2 * i] = state[2 * i + 1]


@registered("response", Metronomes)
@kernel
def _response_of_board(state: Floats, index: int, system: Metronomes, out: Floats) -> None:
    """Unit impulse on one metronome, per m l^2; the board recoils, and through it the others."""
    inertia = 1.0
    for i in range(system.natural_frequency.size):
        cosine = math.cos(state[2 * i])
        inertia -= system.coupling * cosine * cosine
    recoil = system.coupling * math.cos(state[2 * index]) / (inertia if inertia > 0.0 else math.nan)
    out[:] = 0.0
    for i in range(system.natural_frequency.size):
        out[2 * i + 1] = math.cos(state[2 * i]) * recoil
    out[2 * index + 1] += 1.0
