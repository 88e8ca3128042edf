"""Metronomes on a board that rolls freely (Pantaleone 2002, Am. J. Phys. 70, 992).

    th_i'' + (1 + D_i) sin th_i + mu ((th_i/th0)^2 - 1) th_i' - b cos th_i sum (sin th_j)'' = 0

Time in radians of the mean metronome. With C = sum (sin th)'' the factor `1 - b sum cos^2 th` appears, positive as
long as b times the number of metronomes is below 1, as it is for every real board (b = m x (lever)/(total mass)).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from synth.kernels.compiled import kernel
from synth.phase import Floats
from synth.systems.dispatch import registered


class Metronomes(NamedTuple):
    """Parameters; state (th_1, th_1', th_2, th_2', ...). Mirror: all angles change sign together."""

    detuning: Floats
    """(metronomes,) D_i."""
    drive: float
    """mu."""
    drive_angle: float
    """th0, rad."""
    coupling: float
    """b."""

    def difficulty(self, state: Floats) -> str | None:
        """Why there is no motion, or None."""
        if self.coupling * self.detuning.size < 1.0:
            return None
        return "the coupling of the metronomes exceeds 1/number, so that the board would weigh nothing; make it smaller"

    @property
    def first_angle(self) -> int:
        """Place of the first pendulum's angle in the state."""
        return 0


@kernel
def _free(index: int, state: Floats, system: Metronomes) -> float:
    angle, rate = state[2 * index], state[2 * index + 1]
    share = angle / system.drive_angle
    return system.drive * (1.0 - share * share) * rate - (1.0 + system.detuning[index]) * math.sin(angle)


@kernel
def _inertia(state: Floats, system: Metronomes) -> float:
    inertia = 1.0
    for i in range(system.detuning.size):
        cosine = math.cos(state[2 * i])
        inertia -= system.coupling * cosine * cosine
    return inertia if inertia > 0.0 else math.nan


@kernel
def _board(state: Floats, system: Metronomes) -> float:
    """C, the sum of (sin th)''."""
    force = 0.0
    for i in range(system.detuning.size):
        angle, rate = state[2 * i], state[2 * i + 1]
        force += math.cos(angle) * _free(i, state, system) - math.sin(angle) * rate * rate
    return force / _inertia(state, system)


@registered("derivative", Metronomes)
@kernel
def _derivative(time: float, state: Floats, system: Metronomes, out: Floats) -> None:
    detuning, drive, drive_angle, coupling = system.detuning, system.drive, system.drive_angle, system.coupling
    force = 0.0
    inertia = 1.0
    for i in range(detuning.size):
        angle, rate = state[2 * i], state[2 * i + 1]
        cosine, sine = math.cos(angle), math.sin(angle)
        share = angle / drive_angle
        free = drive * (1.0 - share * share) * rate - (1.0 + detuning[i]) * sine
        force += cosine * free - sine * rate * rate
        inertia -= coupling * cosine * cosine
        out[2 * i] = cosine
        out[2 * i + 1] = free
    board = force / inertia if inertia > 0.0 else math.nan
    for i in range(detuning.size):
        out[2 * i + 1] += coupling * out[2 * i] * board
        out[2 * i] = state[2 * i + 1]


@registered("jacobian", Metronomes)
@kernel
def _jacobian(time: float, state: Floats, system: Metronomes, out: Floats) -> None:
    inertia = _inertia(state, system)
    board = _board(state, system)
    for i in range(system.detuning.size):
        lever = system.coupling * math.cos(state[2 * i])
        out[2 * i, :] = 0.0
        out[2 * i, 2 * i + 1] = 1.0
        for j in range(system.detuning.size):
            by_angle, by_rate = _board_slope(j, state, system, board)
            out[2 * i + 1, 2 * j] = lever * by_angle / inertia
            out[2 * i + 1, 2 * j + 1] = lever * by_rate / inertia
        own_angle, own_rate = _free_slope(i, state, system)
        out[2 * i + 1, 2 * i] += own_angle - system.coupling * math.sin(state[2 * i]) * board
        out[2 * i + 1, 2 * i + 1] += own_rate


@kernel
def _free_slope(index: int, state: Floats, system: Metronomes) -> tuple[float, float]:
    angle, rate = state[2 * index], state[2 * index + 1]
    share = angle / system.drive_angle
    by_angle = -2.0 * system.drive * share / system.drive_angle * rate - (1.0 + system.detuning[index]) * math.cos(
        angle
    )
    return by_angle, system.drive * (1.0 - share * share)


@kernel
def _board_slope(index: int, state: Floats, system: Metronomes, board: float) -> tuple[float, float]:
    """Partial derivatives of C, times the inertia."""
    angle, rate = state[2 * index], state[2 * index + 1]
    sine, cosine = math.sin(angle), math.cos(angle)
    by_angle, by_rate = _free_slope(index, state, system)
    own = -sine * _free(index, state, system) + cosine * by_angle - cosine * rate * rate
    return own - 2.0 * system.coupling * sine * cosine * board, cosine * by_rate - 2.0 * sine * rate


@registered("energy", Metronomes)
@kernel
def _energy(state: Floats, system: Metronomes) -> float:
    """Kept when mu = 0; per m l^2 w^2."""
    total = 0.0
    board = 0.0
    for i in range(system.detuning.size):
        angle, rate = state[2 * i], state[2 * i + 1]
        total += 0.5 * rate * rate - (1.0 + system.detuning[i]) * math.cos(angle)
        board += math.cos(angle) * rate
    return total - 0.5 * system.coupling * board * board


@registered("response", Metronomes)
@kernel
def _response(state: Floats, index: int, system: Metronomes, out: Floats) -> None:
    """Unit impulse on one metronome, per m l^2; the board recoils, and through it the others."""
    recoil = system.coupling * math.cos(state[2 * index]) / _inertia(state, system)
    out[:] = 0.0
    for i in range(system.detuning.size):
        out[2 * i + 1] = math.cos(state[2 * i]) * recoil
    out[2 * index + 1] += 1.0
