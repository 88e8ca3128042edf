"""The van der Pol oscillator `y'' = mu (1 - y^2) y' - y`: the field's stiff reference problem."""

from __future__ import annotations

from typing import NamedTuple

from synth.kernels.compiled import kernel
from synth.phase import Floats
from synth.systems.dispatch import registered


class VanDerPol(NamedTuple):
    """Parameters; state (y, y')."""

    stiffness: float
    """mu."""


@registered("derivative", VanDerPol)
@kernel
def _derivative(time: float, state: Floats, system: VanDerPol, out: Floats) -> None:
    out[0] = state[1]
    out[1] = system.stiffness * (1.0 - state[0] * state[0]) * state[1] - state[0]


@registered("jacobian", VanDerPol)
@kernel
def _jacobian(time: float, state: Floats, system: VanDerPol, out: Floats) -> None:
    out[0, 0] = 0.0
    out[0, 1] = 1.0
    out[1, 0] = -2.0 * system.stiffness * state[0] * state[1] - 1.0
    out[1, 1] = system.stiffness * (1.0 - state[0] * state[0])
