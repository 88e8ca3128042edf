"""Metronomes on a board that rolls freely (Pantaleone 2002, Am. J. Phys. 70, 992), in physical time.

    th_i'' + n_i^2 (1 + zeta) sin th_i - b cos th_i sum (sin th_j)'' = terms_i,      zeta = z''/g

Pantaleone's own form, `th'' + (1 +- D) sin th + mu ((th/th0)^2 - 1) th' - b cos th sum (sin th)'' = 0` in radians of
the mean metronome, is `n_i = sqrt(1 +- D)` with a `VanDerPolDrive` of rate mu and angle th0. Solved for
`sum (sin th)''`, the factor `1 - b sum cos^2 th` appears, positive as long as b times the number of metronomes is
below 1, as it is for every real board (b = m x (lever)/(total mass)). A horizontal motion of the ship changes
nothing: the board rolls and stays behind, metronomes with it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from synth.kernels.compiled import kernel
from synth.phase import Floats
from synth.systems.dispatch import registered
from synth.systems.terms import driven, motion, weight


class Metronomes(NamedTuple):
    """Parameters; state (th_1, th_1', th_2, th_2', ...). Mirror: all angles change sign together."""

    natural_frequency: Floats  # (metronomes,) n_i on a board held fast, rad/s
    coupling: float  # b
    terms: Any = None  # What drives or resists the swing, `terms.together(...)`, or None
    gravity: float = 9.80665  # m/s^2; only the ratio of z'' to it matters
    vertical: Any = None  # z'' of the ship, up positive: `Harmonics` or None

    def difficulty(self, state: Floats) -> str | None:
        """Why there is no motion, or None."""
        if self.coupling * self.natural_frequency.size < 1.0:
            return None
        return "the coupling of the metronomes exceeds 1/number, so that the board would weigh nothing; make it smaller"

    @property
    def first_angle(self) -> int:
        """Place of the first pendulum's angle in the state."""
        return 0


@registered("derivative", Metronomes)
@kernel
def _derivative(time: float, state: Floats, system: Metronomes, out: Floats) -> None:
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
def _response(state: Floats, index: int, system: Metronomes, out: Floats) -> None:
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
