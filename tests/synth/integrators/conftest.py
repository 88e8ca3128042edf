"""Systems that the tests of integrators need and the simulator does not."""

from __future__ import annotations

from typing import NamedTuple

from synth.kernels.compiled import kernel
from synth.phase import Floats
from synth.systems.dispatch import registered


class Linear(NamedTuple):
    """`y' = A y`, the state as long as A is wide."""

    matrix: Floats


@registered("derivative", Linear)
@kernel
def _linear(time: float, state: Floats, system: Linear, out: Floats) -> None:
    for i in range(state.size):
        out[i] = 0.0
        for j in range(state.size):
            out[i] += system.matrix[i, j] * state[j]


class Cliff(NamedTuple):
    """`y' = -1` before `edge`, not a number from there on."""

    edge: float


@registered("derivative", Cliff)
@kernel
def _cliff(time: float, state: Floats, system: Cliff, out: Floats) -> None:
    out[0] = -1.0 if time < system.edge else float("nan")
