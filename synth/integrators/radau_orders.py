"""The kernels of a step for an order chosen while marching: the number of stages becomes a constant of the compiler."""

from __future__ import annotations

from typing import Any

from synth.integrators.radau_dense import extrapolate
from synth.integrators.radau_newton import SOLVED, collocate, prepare
from synth.kernels.compiled import kernel

_S3, _S5, _S7 = (0,) * 3, (0,) * 5, (0,) * 7


@kernel
def prepare_any(s: int, step: float, jacobian: Any, size: Any, stack: Any, exchanges: Any) -> bool:
    """`radau_newton.prepare` for s stages."""
    if s == 3:
        return prepare(step, jacobian, _S3, size, stack, exchanges)
    if s == 5:
        return prepare(step, jacobian, _S5, size, stack, exchanges)
    return prepare(step, jacobian, _S7, size, stack, exchanges)


@kernel
def collocate_any(
    s: int,
    time: float,
    step: float,
    state: Any,
    scale: Any,
    goal: float,
    size: Any,
    z: Any,
    f: Any,
    g: Any,
    point: Any,
    slope: Any,
    stack: Any,
    exchanges: Any,
    system: Any,
) -> tuple[int, int, float]:
    """`radau_newton.collocate` for s stages."""
    if s == 3:
        return collocate(time, step, state, scale, goal, _S3, size, z, f, g, point, slope, stack, exchanges, system)
    if s == 5:
        return collocate(time, step, state, scale, goal, _S5, size, z, f, g, point, slope, stack, exchanges, system)
    return collocate(time, step, state, scale, goal, _S7, size, z, f, g, point, slope, stack, exchanges, system)


@kernel
def guess(s: int, old: int, begin: float, ratio: float, size: Any, polynomial: Any, z: Any, point: Any) -> None:
    """First guess of a step from the polynomial of another one of `old` stages (0: none).

    It starts at the share `begin` of that one, and is `ratio` times as long.
    """
    if old == 0:
        for i in range(s * len(size)):
            z[i] = 0.0
    else:
        extrapolate(s, old, begin, ratio, size, polynomial, z, point)


@kernel
def part_step(
    s: int,
    time: float,
    part: float,
    share: float,
    state: Any,
    scale: Any,
    goal: float,
    jacobian: Any,
    size: Any,
    polynomial: Any,
    z: Any,
    f: Any,
    g: Any,
    point: Any,
    slope: Any,
    stack: Any,
    exchanges: Any,
    system: Any,
) -> int:
    """Solve the first `share` of a step by itself: increments in `point`, with the order of the end of a step.

    Returns the corrections made, or 0 where it could not be solved; `point` then holds nothing of use.
    """
    if not prepare_any(s, part, jacobian, size, stack, exchanges):
        return 0
    guess(s, s, 0.0, share, size, polynomial, z, point)
    outcome, turns, _ = collocate_any(
        s, time, part, state, scale, goal, size, z, f, g, point, slope, stack, exchanges, system
    )
    for c in range(len(size)):
        point[c] = z[(s - 1) * len(size) + c]
    return turns if outcome == SOLVED else 0
