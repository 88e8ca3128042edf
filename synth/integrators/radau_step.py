"""One step of Radau IIA: the collocation equations solved by Newton's method in the eigenvectors of A^-1.

Unknowns are the increments z_i of the state at the s nodes, z = h A f(state + z) (Hairer and Wanner 1996, IV.8). The
remainder f - A^-1 z/h is taken before the change to eigenvectors, which for 7 stages would cost two digits. The
iteration goes on until its remainder is below the goal, or until rounding alone moves it. Stages come as the length of
a tuple, so that each order is compiled with its coefficients as constants.

The collocation polynomial is kept in Newton's form on the nodes 1 = c_s, ..., c_1, 0: inside the step the dense output,
of order s, or the first guess of a part step; beyond it the first guess of the next step.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from synth.integrators.radau_newton import FIVE, SEVEN, address, factor, factor_pair, solve, solve_pair
from synth.kernels.compiled import kernel, summing_kernel
from synth.systems.dispatch import derivative

SOLVED, DIVERGED, NOT_FINITE = 0, 1, 2

_ROUNDING, _NOISY = 1e-14, 0.3  # of the state: corrections below this that hardly shrink are rounding
_SLOWEST = 0.9  # contraction from which an iteration is not worth its evaluations
_CAREFUL = 0.1  # share of every time scale at the start that the first step may take

_ONE = (0,)


def _stacked(tables: Sequence[Any]) -> Any:
    """One table of the methods of 5 and 7 stages, from one of each, with zeros behind."""
    largest = tables[-1].shape
    return np.stack(
        [np.pad(each, [(0, most - own) for most, own in zip(largest, each.shape, strict=True)]) for each in tables]
    )


_NODES, _RATES, _INVERSE, _MODES, _PROJECTION, _ERROR, _RECIPROCALS = (
    _stacked(each) for each in zip(FIVE, SEVEN, strict=True)
)


class Space(NamedTuple):
    """Arrays of an integration of n unknowns in steps of up to 7 stages; or their addresses, for the kernels of a step."""

    state: Any  # (n,) at the start of the step,
    slope: Any  # (n,) its derivative there,
    slopes: Any  # (n, n) and the Jacobian of the step
    scale: Any  # (n,) inverse sizes of the components
    largest: Any  # (n,) their largest sizes so far
    carry: Any  # (n,) what the rounding of the state left over
    z: Any  # (s, n) increments at the nodes,
    f: Any  # (s, n) slopes there,
    g: Any  # (s, n) amplitudes of a correction, in eigenvectors
    polynomial: Any  # (s + 1, n) divided differences of the increments
    stack: Any  # (s, n, n) factored matrices,
    exchanges: Any  # (s, n) and their exchanges of rows, see `radau_newton`
    point: Any  # (n,) each
    other: Any
    spare: Any


def space(start: Any) -> Space:
    """All arrays, for an integration from a state."""
    n = start.size
    return Space(
        start.copy(), np.zeros(n), np.zeros((n, n)), np.zeros(n), np.abs(start), np.zeros(n),
        np.zeros((7, n)), np.zeros((7, n)), np.zeros((7, n)), np.zeros((8, n)), np.zeros((7, n, n)),
        np.zeros((7, n), dtype=np.int64),
        np.zeros(n), np.zeros(n), np.zeros(n),
    )  # fmt: skip


@kernel
def addresses(arrays: Space) -> Space:
    """Addresses of the arrays, but for the last three, with which derivatives are asked for."""
    return Space(
        address(arrays.state), address(arrays.slope), address(arrays.slopes), address(arrays.scale),
        address(arrays.largest), address(arrays.carry), address(arrays.z), address(arrays.f), address(arrays.g),
        address(arrays.polynomial), address(arrays.stack), address(arrays.exchanges),
        arrays.point, arrays.other, arrays.spare,
    )  # fmt: skip


@kernel
def _prepare(step: float, count: Any, size: Any, work: Space) -> bool:
    """Factor all matrices for a step; False if one is singular or not finite."""
    method, inverse = len(count) // 2 - 2, 1.0 / step
    good = factor(_RATES[method, 0].real * inverse, work.slopes, size, work.stack, work.exchanges)
    for k in range(1, (len(count) + 1) // 2):
        rate = _RATES[method, k] * inverse
        good &= factor_pair(2 * k - 1, rate.real, rate.imag, work.slopes, size, work.stack, work.exchanges)
    return good


@summing_kernel
def _product(tables: Any, i: int, rows: Any, c: int, count: Any, size: Any) -> float:
    """Row i of the method's matrix times column c of `rows` (s, n)."""
    total = 0.0
    for j in range(len(count)):
        total += tables[len(count) // 2 - 2, i, j] * rows[j * len(size) + c]
    return total


@summing_kernel
def _correct(step: float, count: Any, size: Any, work: Space) -> None:
    """Correct the increments z by Newton's method from the slopes f; g becomes the amplitudes of the correction."""
    n, s, z, f, g = len(size), len(count), work.z, work.f, work.g
    inverse = 1.0 / step
    for i in range(s):
        for c in range(n):
            f[i * n + c] -= inverse * _product(_INVERSE, i, z, c, count, size)
    for i in range(s):
        for c in range(n):
            g[i * n + c] = _product(_PROJECTION, i, f, c, count, size)
    solve(size, work.stack, work.exchanges, g)
    for k in range(1, (s + 1) // 2):
        solve_pair(2 * k - 1, size, work.stack, work.exchanges, g)
    for i in range(s):
        for c in range(n):
            z[i * n + c] += _product(_MODES, i, g, c, count, size)


@summing_kernel
def _size(rows: Any, size: Any, work: Space) -> float:
    """Weighted root mean square of g, in as many rows as the first tuple is long."""
    n, g, scale, total = len(size), work.g, work.scale, 0.0
    for i in range(len(rows)):
        for c in range(n):
            total += (g[i * n + c] * scale[c]) * (g[i * n + c] * scale[c])
    return math.sqrt(total / (n * len(rows)))


@kernel
def collocate(
    time: float, step: float, goal: float, count: Any, size: Any, work: Space, system: Any
) -> tuple[int, int, float]:
    """Solve one step in `work.z`, from a first guess of the increments; `count`, `size`: tuples of length s and n.

    The `goal` is relative to the sizes, whose inverses are lowered where a component turns out larger. Returned are
    SOLVED, DIVERGED or NOT_FINITE, the corrections made, and the contraction, -1 where one was enough.
    """
    if not _prepare(step, count, size, work):
        return NOT_FINITE, 0, 1.0
    n, s = len(size), len(count)
    state, z, f, point, slope = work.state, work.z, work.f, work.point, work.other
    most = 2 * s + 2
    contraction, before, quotient, moved = -1.0, 0.0, 0.0, 0.0
    remainder = 1.0  # of the iteration over its last correction; unknown after the first
    for turn in range(1, most + 1):
        for i in range(s):
            for c in range(n):
                point[c] = state[c] + z[i * n + c]
            derivative(time + _NODES[s // 2 - 2, i] * step, point, system, slope)
            for c in range(n):
                f[i * n + c] = slope[c]
        _correct(step, count, size, work)
        for c in range(n):
            ended = abs(state[c] + z[(s - 1) * n + c])
            # larger than thought, such as one that starts at zero; later a ratio of corrections would say nothing
            if turn == 1 and ended * work.scale[c] > 2.0:
                work.scale[c] = 1.0 / ended
        moved = _size(count, size, work)
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


@summing_kernel
def differences(count: Any, size: Any, work: Space) -> None:
    """The polynomial of the increments; it is zero at 0, and its first coefficient is the increment of the step."""
    n, s, out = len(size), len(count), work.polynomial
    for c in range(n):
        for i in range(s):
            out[i * n + c] = work.z[(s - 1 - i) * n + c]
        out[s * n + c] = 0.0
    for level in range(1, s + 1):
        for i in range(s, level - 1, -1):
            for c in range(n):
                rise = out[i * n + c] - out[(i - 1) * n + c]
                out[i * n + c] = rise * _RECIPROCALS[s // 2 - 2, i, i - level]


@summing_kernel
def evaluate(at: float, count: Any, size: Any, polynomial: Any, out: Any, row: int) -> None:
    """Increments at the share `at` of the step, into a row of `out` (rows, n)."""
    n, s = len(size), len(count)
    for c in range(n):
        total = polynomial[s * n + c]
        for i in range(s - 1, -1, -1):
            total = total * (at - _NODES[s // 2 - 2, s - 1 - i]) + polynomial[i * n + c]
        out[row * n + c] = total


@summing_kernel
def guess(known: bool, begin: float, ratio: float, count: Any, size: Any, work: Space) -> None:
    """First guess from the polynomial of a step, if it is known, from its share `begin`, for one `ratio` as long."""
    n, s, z, base = len(size), len(count), work.z, work.point
    if not known:
        for i in range(s * n):
            z[i] = 0.0
        return
    evaluate(begin, count, size, work.polynomial, base, 0)
    for i in range(s):
        evaluate(begin + ratio * _NODES[s // 2 - 2, i], count, size, work.polynomial, z, i)
        for c in range(n):
            z[i * n + c] -= base[c]


@kernel
def part_step(
    time: float, part: float, share: float, goal: float, count: Any, size: Any, work: Space, system: Any
) -> int:  # fmt: skip
    """Solve the first `share` of a step into `work.point`; corrections made, or 0 where it could not be solved."""
    guess(True, 0.0, share, count, size, work)
    outcome, turns, _ = collocate(time, part, goal, count, size, work, system)
    for c in range(len(size)):
        work.point[c] = work.z[(len(count) - 1) * len(size) + c]
    return turns if outcome == SOLVED else 0


@kernel
def local_error(time: float, step: float, again: float, count: Any, size: Any, work: Space, system: Any) -> float:
    """Difference from an embedded formula of order s, filtered by (gamma/h - J)^-1: Hairer and Wanner (1996), IV.8.

    Above `again` it is filtered once more, (8.20): the first filter, (8.19), overestimates what has not settled yet.
    """
    n, s, z, f, g, point = len(size), len(count), work.z, work.f, work.g, work.point
    gain = _RATES[s // 2 - 2, 0].real / step
    for c in range(n):
        total = 0.0
        for i in range(s):
            total += _ERROR[s // 2 - 2, i] * z[i * n + c]
        f[c] = gain * total
        g[c] = work.slope[c] + f[c]
    solve(size, work.stack, work.exchanges, g)
    error = _size(_ONE, size, work)
    if error > again:
        for c in range(n):
            point[c] = work.state[c] + g[c]
        derivative(time, point, system, work.other)
        for c in range(n):
            g[c] = work.other[c] + f[c]
        solve(size, work.stack, work.exchanges, g)
        error = _size(_ONE, size, work)
    return error


@kernel
def first_step(span: float, size: Any, work: Space) -> float:
    """A tenth of the shortest time in which state, slope and curvature (J slope) change one another by their size."""
    n = len(size)
    step = 1e-2 * span
    for c in range(n):
        bend = 0.0
        for j in range(n):
            bend += work.slopes[c * n + j] * work.slope[j]
        y, f, b = abs(work.state[c]), abs(work.slope[c]), abs(bend)
        if f > 0.0 and b > 0.0:
            step = min(step, _CAREFUL * f / b)
        if f > 0.0 and y > 0.0:
            step = min(step, _CAREFUL * y / f)
        if b > 0.0 and y > 0.0:
            step = min(step, _CAREFUL * math.sqrt(y / b))
    return step
