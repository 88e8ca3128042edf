"""The kernels of a step for an order chosen while marching: the number of stages becomes a constant of the compiler."""

from __future__ import annotations

from typing import Any

from synth.integrators.radau_dense import differences, evaluate
from synth.integrators.radau_newton import SOLVED, collocate, prepare, project
from synth.integrators.radau_tables import FIVE, SEVEN, THREE
from synth.kernels.compiled import kernel

_S3, _S5, _S7 = (0,) * 3, (0,) * 5, (0,) * 7
_N3, _N5, _N7 = THREE.nodes, FIVE.nodes, SEVEN.nodes


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
    w: Any,
    f: Any,
    point: Any,
    slope: Any,
    stack: Any,
    exchanges: Any,
    system: Any,
) -> tuple[int, int, float]:
    """`radau_newton.collocate` for s stages."""
    if s == 3:
        return collocate(time, step, state, scale, goal, _S3, size, z, w, f, point, slope, stack, exchanges, system)
    if s == 5:
        return collocate(time, step, state, scale, goal, _S5, size, z, w, f, point, slope, stack, exchanges, system)
    return collocate(time, step, state, scale, goal, _S7, size, z, w, f, point, slope, stack, exchanges, system)


@kernel
def polynomial_of(s: int, size: Any, z: Any, out: Any) -> None:
    """`radau_dense.differences` for s stages."""
    if s == 3:
        differences(_S3, size, z, out)
    elif s == 5:
        differences(_S5, size, z, out)
    else:
        differences(_S7, size, z, out)


@kernel
def read(s: int, at: float, size: Any, polynomial: Any, out: Any) -> None:
    """`radau_dense.evaluate` for s stages."""
    for c in range(len(size)):
        if s == 3:
            out[c] = evaluate(at, c, _S3, size, polynomial)
        elif s == 5:
            out[c] = evaluate(at, c, _S5, size, polynomial)
        else:
            out[c] = evaluate(at, c, _S7, size, polynomial)


@kernel
def _spread(count: Any, old: Any, begin: float, ratio: float, size: Any, polynomial: Any, z: Any, w: Any) -> None:
    n, s = len(size), len(count)
    nodes = _N3 if s == 3 else _N5 if s == 5 else _N7
    for c in range(len(size)):
        base = evaluate(begin, c, old, size, polynomial)
        for i in range(s):
            z[i * n + c] = evaluate(begin + ratio * nodes[i], c, old, size, polynomial) - base
    project(count, size, z, w)


@kernel
def guess(s: int, old: int, begin: float, ratio: float, size: Any, polynomial: Any, z: Any, w: Any) -> None:
    """First guess of a step from the polynomial of another one of `old` stages (0: none).

    It starts at the share `begin` of that one, and is `ratio` times as long.
    """
    if old == 0:
        for i in range(s * len(size)):
            z[i] = 0.0
            w[i] = 0.0
    elif s == 3 and old == 3:
        _spread(_S3, _S3, begin, ratio, size, polynomial, z, w)
    elif s == 3:
        _spread(_S3, _S5, begin, ratio, size, polynomial, z, w)
    elif s == 5 and old == 3:
        _spread(_S5, _S3, begin, ratio, size, polynomial, z, w)
    elif s == 5 and old == 5:
        _spread(_S5, _S5, begin, ratio, size, polynomial, z, w)
    elif s == 5:
        _spread(_S5, _S7, begin, ratio, size, polynomial, z, w)
    elif old == 5:
        _spread(_S7, _S5, begin, ratio, size, polynomial, z, w)
    else:
        _spread(_S7, _S7, begin, ratio, size, polynomial, z, w)


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
    w: Any,
    f: Any,
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
    guess(s, s, 0.0, share, size, polynomial, z, w)
    outcome, turns, _ = collocate_any(
        s, time, part, state, scale, goal, size, z, w, f, point, slope, stack, exchanges, system
    )
    for c in range(len(size)):
        point[c] = z[(s - 1) * len(size) + c]
    return turns if outcome == SOLVED else 0
