"""One step of Radau IIA: the collocation equations solved by Newton's method in the eigenvectors of A^-1.

Unknowns are the increments z_i of the state at the s nodes, z = h A f(state + z) (Hairer and Wanner 1996, IV.8). What
is left of f - A^-1 z/h is taken before the change to eigenvectors, which for 7 stages would cost two digits of the sums
and leave a method with weights off by 2e-15 in one direction. The iteration goes on until its remainder is below the
goal, or until rounding alone moves it. Stages come as the length of a tuple, so that each order is compiled with its
coefficients as constants.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from synth.integrators.radau_linear import factor, factor_pair, solve, solve_pair
from synth.integrators.radau_tables import FIVE, SEVEN, THREE
from synth.kernels.compiled import kernel, summing_kernel
from synth.systems.dispatch import derivative

SOLVED, DIVERGED, NOT_FINITE = 0, 1, 2

_ROUNDING, _NOISY = 1e-14, 0.3  # of the state: corrections below this that hardly shrink are rounding
_SLOWEST = 0.9  # contraction from which an iteration is not worth its evaluations

_S3, _S5, _S7 = (0,) * 3, (0,) * 5, (0,) * 7
_N3, _N5, _N7 = THREE.nodes, FIVE.nodes, SEVEN.nodes
_A3, _A5, _A7 = THREE.inverse, FIVE.inverse, SEVEN.inverse
_M3, _M5, _M7 = THREE.modes, FIVE.modes, SEVEN.modes
_P3, _P5, _P7 = THREE.projection, FIVE.projection, SEVEN.projection
_R3, _R5, _R7 = THREE.rates, FIVE.rates, SEVEN.rates


class Work(NamedTuple):
    """Working space of a step of s stages: addresses (`radau_memory`), but for the last two, which are arrays (n,)."""

    z: Any
    """(s, n) increments."""
    f: Any
    """(s, n)."""
    g: Any
    """(s, n)."""
    stack: Any
    """(s, n, n) factored matrices,"""
    exchanges: Any
    """(s, n) with their exchanges, see `radau_linear`."""
    point: Any
    slope: Any


@kernel
def prepare(step: float, jacobian: Any, count: Any, size: Any, work: Work) -> bool:
    """Factor all matrices for a step; False if one is singular or not finite."""
    s = len(count)
    rates = _R3 if s == 3 else _R5 if s == 5 else _R7
    inverse = 1.0 / step
    good = factor(rates[0].real * inverse, jacobian, size, work.stack, work.exchanges)
    for k in range(1, (s + 1) // 2):
        good &= factor_pair(
            2 * k - 1, rates[k].real * inverse, rates[k].imag * inverse, jacobian, size, work.stack, work.exchanges
        )
    return good


@summing_kernel
def _correct(step: float, count: Any, size: Any, work: Work) -> None:
    """Correct the increments z by Newton's method from the slopes f; g becomes the amplitudes of the correction."""
    n, s, z, f, g = len(size), len(count), work.z, work.f, work.g
    matrix = _A3 if s == 3 else _A5 if s == 5 else _A7
    inverse = 1.0 / step
    for i in range(s):
        for c in range(n):
            total = 0.0
            for j in range(s):
                total += matrix[i, j] * z[j * n + c]
            f[i * n + c] -= inverse * total
    matrix = _P3 if s == 3 else _P5 if s == 5 else _P7
    for i in range(s):
        for c in range(n):
            total = 0.0
            for j in range(s):
                total += matrix[i, j] * f[j * n + c]
            g[i * n + c] = total
    solve(size, work.stack, work.exchanges, g)
    for k in range(1, (s + 1) // 2):
        solve_pair(2 * k - 1, size, work.stack, work.exchanges, g)
    matrix = _M3 if s == 3 else _M5 if s == 5 else _M7
    for i in range(s):
        for c in range(n):
            total = 0.0
            for j in range(s):
                total += matrix[i, j] * g[j * n + c]
            z[i * n + c] += total


@summing_kernel
def _moved(count: Any, size: Any, scale: Any, g: Any) -> float:
    """Weighted mean square of a correction."""
    n, s = len(size), len(count)
    total = 0.0
    for i in range(s):
        for c in range(n):
            total += (g[i * n + c] * scale[c]) * (g[i * n + c] * scale[c])
    return total / (n * s)


@kernel
def _lower(state: Any, count: Any, size: Any, z: Any, scale: Any) -> None:
    """Lower the inverse sizes of components that end larger than thought: one that starts at zero, above all."""
    n, s = len(size), len(count)
    for c in range(n):
        ended = state[c] + z[(s - 1) * n + c]
        if abs(ended) * scale[c] > 2.0:
            scale[c] = 1.0 / abs(ended)


@kernel
def collocate(
    time: float, step: float, state: Any, scale: Any, goal: float, count: Any, size: Any, work: Work, system: Any
) -> tuple[int, int, float]:
    """Solve one step.

    Parameters
    ----------
    time, step : float
    state : (n,) array
    scale : (n,) array
        Inverse sizes of the components; lowered where a component turns out larger.
    goal : float
        Remainder of the iteration to reach, relative to the sizes.
    count, size : tuples of length s and n
    work : Work
        Made ready by `prepare` for this step; z holds a first guess of the increments, the solution on return.
    system : NamedTuple

    Returns
    -------
    outcome, corrections, contraction
        SOLVED, DIVERGED or NOT_FINITE; contraction -1 where one correction was enough.
    """
    n, s = len(size), len(count)
    z, f, point, slope = work.z, work.f, work.point, work.slope
    nodes = _N3 if s == 3 else _N5 if s == 5 else _N7
    most = 2 * s + 2
    contraction, before, quotient, moved = -1.0, 0.0, 0.0, 0.0
    remainder = 1.0  # of the iteration over its last correction; unknown after the first
    for turn in range(1, most + 1):
        for i in range(s):
            for c in range(n):
                point[c] = state[c] + z[i * n + c]
            derivative(time + nodes[i] * step, point, system, slope)
            for c in range(n):
                f[i * n + c] = slope[c]
        _correct(step, count, size, work)
        if turn == 1:  # before it is measured: a ratio of corrections measured by different sizes would say nothing
            _lower(state, count, size, z, scale)
        moved = math.sqrt(_moved(count, size, scale, work.g))
        if not moved < 1e100:
            return NOT_FINITE, turn, 1.0
        if turn > 1:
            present = moved / before
            if present >= _NOISY and moved <= _ROUNDING:
                return SOLVED, turn, max(contraction, 0.0)  # this ratio says nothing
            contraction = present if turn == 2 else math.sqrt(present * quotient)
            quotient = present
            if present >= _SLOWEST or contraction >= _SLOWEST:
                return DIVERGED, turn, contraction
            remainder = contraction / (1.0 - contraction)
        if remainder * moved <= goal or moved == 0.0:
            return SOLVED, turn, contraction
        before = moved
    return SOLVED if moved <= _ROUNDING else DIVERGED, most, contraction


@kernel
def prepare_any(s: int, step: float, jacobian: Any, size: Any, work: Work) -> bool:
    """`prepare` for a number of stages chosen while marching: it becomes a constant of the compiler."""
    if s == 3:
        return prepare(step, jacobian, _S3, size, work)
    if s == 5:
        return prepare(step, jacobian, _S5, size, work)
    return prepare(step, jacobian, _S7, size, work)


@kernel
def collocate_any(
    s: int, time: float, step: float, state: Any, scale: Any, goal: float, size: Any, work: Work, system: Any
) -> tuple[int, int, float]:
    """`collocate` for s stages."""
    if s == 3:
        return collocate(time, step, state, scale, goal, _S3, size, work, system)
    if s == 5:
        return collocate(time, step, state, scale, goal, _S5, size, work, system)
    return collocate(time, step, state, scale, goal, _S7, size, work, system)
