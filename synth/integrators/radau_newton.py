"""One step of Radau IIA: the collocation equations solved by Newton's method in the eigenvectors of A^-1.

Unknowns are the increments z_i of the state at the s nodes, z = h A f(state + z), and their amplitudes w = M^-1 z
(Hairer and Wanner 1996, IV.8.1). The iteration goes on until its remainder is below the goal, or until rounding
alone moves it.
"""

from __future__ import annotations

import math
from typing import Any

from synth.integrators.radau_linear import factor, factor_pair, solve, solve_pair
from synth.integrators.radau_tables import FIVE, SEVEN, THREE
from synth.kernels.compiled import kernel, summing_kernel
from synth.systems.dispatch import derivative

_ROUNDING = 2e-14  # of the largest increment: Newton corrections below this that no longer shrink are rounding

NODES = (THREE.nodes, FIVE.nodes, SEVEN.nodes)
_N3, _N5, _N7 = THREE.nodes, FIVE.nodes, SEVEN.nodes
_M3, _M5, _M7 = THREE.modes, FIVE.modes, SEVEN.modes
_P3, _P5, _P7 = THREE.projection, FIVE.projection, SEVEN.projection
_R3, _R5, _R7 = THREE.rates, FIVE.rates, SEVEN.rates


@kernel
def prepare(step: float, jacobian: Any, count: Any, size: Any, stack: Any, exchanges: Any) -> bool:
    """Factor all matrices for a step; False if one is singular."""
    s = len(count)
    rates = _R3 if s == 3 else _R5 if s == 5 else _R7
    inverse = 1.0 / step
    good = factor(rates[0].real * inverse, jacobian, size, stack, exchanges)
    for k in range(1, (s + 1) // 2):
        good &= factor_pair(
            2 * k - 1, rates[k].real * inverse, rates[k].imag * inverse, jacobian, size, stack, exchanges
        )
    return good


@summing_kernel
def project(count: Any, size: Any, source: Any, out: Any) -> None:
    """`out = M^-1 source`, amplitudes from values at the nodes."""
    s = len(count)
    matrix = _P3 if s == 3 else _P5 if s == 5 else _P7
    for i in range(s):
        for c in range(len(size)):
            total = 0.0
            for j in range(s):
                total += matrix[i, j] * source[j, c]
            out[i, c] = total


@summing_kernel
def _unfold(count: Any, size: Any, source: Any, out: Any) -> None:
    """`out = M source`, values at the nodes from amplitudes."""
    s = len(count)
    matrix = _M3 if s == 3 else _M5 if s == 5 else _M7
    for i in range(s):
        for c in range(len(size)):
            total = 0.0
            for j in range(s):
                total += matrix[i, j] * source[j, c]
            out[i, c] = total


@summing_kernel
def _correct(step: float, count: Any, size: Any, scale: Any, w: Any, g: Any, stack: Any, exchanges: Any) -> float:
    """One Newton correction of the amplitudes w from the projected slopes g; its weighted mean square."""
    n = len(size)
    s = len(count)
    rates = _R3 if s == 3 else _R5 if s == 5 else _R7
    total = 0.0
    inverse = 1.0 / step
    re = rates[0].real * inverse
    for c in range(n):
        g[0, c] -= re * w[0, c]
    for k in range(1, (s + 1) // 2):
        re, im = rates[k].real * inverse, rates[k].imag * inverse
        for c in range(n):
            first, second = w[2 * k - 1, c], w[2 * k, c]
            g[2 * k - 1, c] -= re * first - im * second
            g[2 * k, c] -= re * second + im * first
    solve(size, stack, exchanges, g)
    for k in range(1, (s + 1) // 2):
        solve_pair(2 * k - 1, size, stack, exchanges, g)
    for i in range(s):
        for c in range(n):
            change = g[i, c]
            w[i, c] += change
            total += (change * scale[c]) * (change * scale[c])
    return total / (n * s)


@kernel
def collocate(
    time: float,
    step: float,
    state: Any,
    scale: Any,
    goal: float,
    trust: float,
    most: int,
    count: Any,
    size: Any,
    z: Any,
    w: Any,
    f: Any,
    point: Any,
    slope: Any,
    stack: Any,
    exchanges: Any,
    system: Any,
) -> tuple[bool, int, float, float]:
    """Solve one step from the increments and amplitudes in `work`.

    Parameters
    ----------
    time, step : float
    state : (n,) array
    scale : (n,) array
        Inverse sizes of the components.
    goal : float
        Relative remainder of the iteration to reach.
    trust : float
        Contraction/(1 - contraction) of the step before, for the first correction.
    most : int
        Corrections after which the step counts as too long.
    count, size : tuples of length s and n
    tableau, work, system
        The method, working space, the system.

    Returns
    -------
    solved, iterations, contraction, trust
        Contraction below 0 where one correction was enough to know.
    """
    n = len(size)
    s = len(count)
    nodes = _N3 if s == 3 else _N5 if s == 5 else _N7
    contraction = -1.0
    before = 0.0
    quotient = 0.0
    for turn in range(1, most + 1):
        for i in range(len(count)):
            for c in range(n):
                point[c] = state[c] + z[i, c]
            derivative(time + nodes[i] * step, point, system, slope)
            for c in range(n):
                f[i, c] = slope[c]
        project(count, size, f, z)
        size_now = math.sqrt(_correct(step, count, size, scale, w, z, stack, exchanges))
        _unfold(count, size, w, z)
        if not size_now < 1e100:
            return False, turn, 1e3, trust
        if turn > 1:
            present = size_now / before if before > 0.0 else 0.0
            contraction = present if turn == 2 else math.sqrt(present * quotient)
            quotient = present
            if present >= 0.9 or contraction >= 0.99:
                return size_now <= _ROUNDING, turn, max(contraction, 1.0), trust
            trust = contraction / (1.0 - contraction)
        if trust * size_now <= goal:
            return True, turn, contraction, trust
        if turn > 1 and trust * size_now * contraction ** (most - 1 - turn) > goal and size_now > _ROUNDING:
            return False, turn, max(contraction, 0.5), trust
        before = size_now
    return size_now <= _ROUNDING, most, contraction, trust
