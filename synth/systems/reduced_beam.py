"""Clocks on an elastic beam at small arcs: the reduced system (2) of Kanunnikov and Lamper.

    u'' + 2 d0 u' + 4 u = m0 sum (y_i^2)'' ,      y_i'' + (1 + tau_i - u'') y_i = d (1 - y_i^2) y_i'

Time s = w0 t/2, u = x/l, y = S/S0. Solved for u'', the factor `1 - 2 m0 sum y_i^2` appears, that is
`1 - m sum phi_i^2/(M + 2 m)`: printed as it is, the mass matrix is singular where it vanishes and not positive
beyond. There the derivative is NaN, and integrators refuse with `difficulty`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from synth.kernels.compiled import kernel
from synth.phase import Floats
from synth.systems.dispatch import registered


class ReducedBeam(NamedTuple):
    """Parameters; state (u, u', y_1, y_1', y_2, y_2', ...). Mirror: y_i -> -y_i, of each alone."""

    beam_damping: float
    """d0 = eps0/w0."""
    drive: float
    """d = 2 eps/w0."""
    coupling: float
    """m0 = m S0^2/(2 l^2 (M + 2 m))."""
    detuning: Floats
    """(pendulums,) tau_i, from 4 w_i^2 = w0^2 (1 + tau_i)."""

    def difficulty(self, state: Floats) -> str | None:
        """Why there is no motion from this state on, or None."""
        left = 1.0 - 2.0 * self.coupling * float((state[2::2] ** 2).sum())
        if left > 1e-3:
            return None
        return "the mass matrix of the reduced beam is singular: m sum phi^2 reaches M + 2 m; use the full system (1), a heavier beam, or a smaller arc"

    @property
    def first_angle(self) -> int:
        """Place of the first pendulum's angle in the state."""
        return 2


@registered("derivative", ReducedBeam)
@kernel
def _derivative(time: float, state: Floats, system: ReducedBeam, out: Floats) -> None:
    detuning, drive, coupling = system.detuning, system.drive, 2.0 * system.coupling
    inertia = 1.0
    force = 0.0
    for i in range(detuning.size):
        y, rate = state[2 * i + 2], state[2 * i + 3]
        free = drive * (1.0 - y * y) * rate - (1.0 + detuning[i]) * y
        inertia -= coupling * (y * y)
        force += rate * rate + y * free
        out[2 * i + 2] = rate
        out[2 * i + 3] = free
    force = coupling * force - 2.0 * system.beam_damping * state[1] - 4.0 * state[0]
    beam = force / inertia if inertia > 0.0 else math.nan
    out[0] = state[1]
    out[1] = beam
    for i in range(detuning.size):
        out[2 * i + 3] += beam * state[2 * i + 2]


@registered("jacobian", ReducedBeam)
@kernel
def _jacobian(time: float, state: Floats, system: ReducedBeam, out: Floats) -> None:
    detuning, drive, coupling = system.detuning, system.drive, 2.0 * system.coupling
    inertia = 1.0
    force = 0.0
    for i in range(detuning.size):
        y, rate = state[2 * i + 2], state[2 * i + 3]
        inertia -= coupling * (y * y)
        force += rate * rate + y * (drive * (1.0 - y * y) * rate - (1.0 + detuning[i]) * y)
    force = coupling * force - 2.0 * system.beam_damping * state[1] - 4.0 * state[0]
    beam = force / inertia if inertia > 0.0 else math.nan
    out[:] = 0.0
    out[0, 1] = 1.0
    out[1, 0] = -4.0 / inertia
    out[1, 1] = -2.0 * system.beam_damping / inertia
    for i in range(detuning.size):
        y, rate = state[2 * i + 2], state[2 * i + 3]
        free = drive * (1.0 - y * y) * rate - (1.0 + detuning[i]) * y
        by_angle = -2.0 * drive * y * rate - (1.0 + detuning[i])
        by_rate = drive * (1.0 - y * y)
        out[1, 2 * i + 2] = coupling * (free + y * by_angle + 2.0 * y * beam) / inertia
        out[1, 2 * i + 3] = coupling * (2.0 * rate + y * by_rate) / inertia
        out[2 * i + 2, 2 * i + 3] = 1.0
        out[2 * i + 3, 2 * i + 2] = by_angle + beam
        out[2 * i + 3, 2 * i + 3] = by_rate
    for i in range(detuning.size):
        for column in range(state.size):
            out[2 * i + 3, column] += state[2 * i + 2] * out[1, column]


@registered("energy", ReducedBeam)
@kernel
def _energy(state: Floats, system: ReducedBeam) -> float:
    """Kept when d = d0 = 0; in units of the beam's motion."""
    total = 0.5 * state[1] * state[1] + 2.0 * state[0] * state[0]
    for i in range(system.detuning.size):
        y, rate = state[2 * i + 2], state[2 * i + 3]
        swing = rate * rate + (1.0 + system.detuning[i]) * y * y - 2.0 * y * rate * state[1]
        total += system.coupling * swing
    return total
