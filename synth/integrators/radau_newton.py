"""One step of Radau IIA: the collocation equations solved by Newton's method in the eigenvectors of A^-1.

Unknowns are the increments z_i of the state at the s nodes, z = h A f(state + z), and their amplitudes w = M^-1 z
(Hairer and Wanner 1996, IV.8.1). The iteration goes on until its remainder is below the goal, or until rounding
alone moves it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synth.integrators.radau_linear import factor, solve
from synth.integrators.radau_tables import Tableau
from synth.kernels.compiled import kernel, summing_kernel
from synth.phase import Floats
from synth.systems.dispatch import derivative

_ROUNDING = 2e-14  # of the largest increment: Newton corrections below this that no longer shrink are rounding


class Stages(NamedTuple):
    """Working space of one step; nothing is allocated on the way."""

    increments: Floats
    """(7, n) z."""
    amplitudes: Floats
    """(7, n) w."""
    slopes: Floats
    """(7, n) f at the nodes."""
    point: Floats
    """(n,) argument of the derivative."""
    slope: Floats
    """(n,) its value."""
    real: Floats
    """(n, n) factored real matrix."""
    real_order: NDArray[np.int64]
    """(n,) its exchanges."""
    pairs: NDArray[np.complex128]
    """(3, n, n) factored complex matrices."""
    pairs_order: NDArray[np.int64]
    """(3, n) their exchanges."""
    right: Floats
    """(n,) real right-hand side."""
    right_pair: NDArray[np.complex128]
    """(n,) complex right-hand side."""


@kernel
def stages(n: int) -> Stages:
    """Working space for n unknowns."""
    return Stages(
        np.zeros((7, n)),
        np.zeros((7, n)),
        np.zeros((7, n)),
        np.zeros(n),
        np.zeros(n),
        np.zeros((n, n)),
        np.zeros(n, dtype=np.int64),
        np.zeros((3, n, n), dtype=np.complex128),
        np.zeros((3, n), dtype=np.int64),
        np.zeros(n),
        np.zeros(n, dtype=np.complex128),
    )


@kernel
def prepare(step: float, jacobian: Any, size: Any, tableau: Tableau, work: Stages) -> bool:
    """Factor all matrices for a step; False if one is singular."""
    if not factor(tableau.real / step, jacobian, size, work.real, work.real_order):
        return False
    for k in range(tableau.pairs.size):
        if not factor(tableau.pairs[k] / step, jacobian, size, work.pairs[k], work.pairs_order[k]):
            return False
    return True


@summing_kernel
def _product(matrix: Any, count: Any, size: Any, source: Any, out: Any) -> None:
    """`out = matrix @ source` over the stages."""
    for i in range(len(count)):
        for c in range(len(size)):
            total = 0.0
            for j in range(len(count)):
                total += matrix[i, j] * source[j, c]
            out[i, c] = total


@kernel
def project(count: Any, size: Any, tableau: Tableau, work: Stages) -> None:
    """Amplitudes from increments."""
    _product(tableau.projection, count, size, work.increments, work.amplitudes)


@kernel
def _correct(step: float, count: Any, size: Any, scale: Any, tableau: Tableau, work: Stages) -> float:
    """One Newton correction of the amplitudes from the projected slopes; its weighted mean square."""
    n = len(size)
    w, g = work.amplitudes, work.increments
    total = 0.0
    rate = tableau.real / step
    for c in range(n):
        work.right[c] = g[0, c] - rate * w[0, c]
    solve(work.real, work.real_order, size, work.right)
    for c in range(n):
        w[0, c] += work.right[c]
        part = work.right[c] * scale[c]
        total += part * part
    for k in range((len(count) - 1) // 2):
        pair = tableau.pairs[k] / step
        for c in range(n):
            work.right_pair[c] = complex(g[2 * k + 1, c], g[2 * k + 2, c]) - pair * complex(w[2 * k + 1, c], w[2 * k + 2, c])
        solve(work.pairs[k], work.pairs_order[k], size, work.right_pair)
        for c in range(n):
            change = work.right_pair[c]
            w[2 * k + 1, c] += change.real
            w[2 * k + 2, c] += change.imag
            first = change.real * scale[c]
            second = change.imag * scale[c]
            total += first * first + second * second
    return total / (n * len(count))


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
    tableau: Tableau,
    work: Stages,
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
    z = work.increments
    contraction = -1.0
    before = 0.0
    quotient = 0.0
    for turn in range(1, most + 1):
        for i in range(len(count)):
            for c in range(n):
                work.point[c] = state[c] + z[i, c]
            derivative(time + tableau.nodes[i] * step, work.point, system, work.slope)
            for c in range(n):
                work.slopes[i, c] = work.slope[c]
        _product(tableau.projection, count, size, work.slopes, z)
        size_now = math.sqrt(_correct(step, count, size, scale, tableau, work))
        _product(tableau.modes, count, size, work.amplitudes, z)
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
