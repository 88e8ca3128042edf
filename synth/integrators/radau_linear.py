"""The linear systems of Radau's Newton iteration: one real and (s - 1)/2 complex matrices of the size of the state.

All live in one stack of real matrices: the real system in place 0, a complex one in two places that follow each other,
real part first; right-hand sides are rows at the same places. `rate - jacobian` is factored with partial pivoting, rows
exchanged whole, so that all exchanges are applied to a right-hand side before any substitution. Pivots are stored
inverted: substitution divides nowhere. The number of unknowns comes as the length of a tuple, which the compiler knows
and unrolls by; matrices are addressed in their stack, because a view of one costs more than its solution.
"""

from __future__ import annotations

from typing import Any

from synth.kernels.compiled import summing_kernel

_HUGE = 1e150  # the square of a pivot must be finite


@summing_kernel
def factor(rate: float, jacobian: Any, size: Any, stack: Any, exchanges: Any) -> bool:
    """Factor the real `rate - jacobian` in place 0.

    Parameters
    ----------
    rate : float
        Real eigenvalue of A^-1 over the step.
    jacobian : (n, n) array
    size : tuple of length n
    stack : (s, n, n) array
        L below the diagonal, inverse pivots on it, U above.
    exchanges : (s, n) integer array
        Row exchanged with row k at stage k.

    Returns
    -------
    bool
        False if the matrix is singular or not finite.
    """
    n = len(size)
    for i in range(n):
        for j in range(n):
            stack[0, i, j] = -jacobian[i, j]
        stack[0, i, i] += rate
    for k in range(n):
        chosen, largest = k, abs(stack[0, k, k])
        for i in range(k + 1, n):
            if abs(stack[0, i, k]) > largest:
                chosen, largest = i, abs(stack[0, i, k])
        if not 0.0 < largest < _HUGE:
            return False
        exchanges[0, k] = chosen
        if chosen != k:
            for j in range(n):
                stack[0, k, j], stack[0, chosen, j] = stack[0, chosen, j], stack[0, k, j]
        inverse = 1.0 / stack[0, k, k]
        stack[0, k, k] = inverse
        for i in range(k + 1, n):
            share = stack[0, i, k] * inverse
            stack[0, i, k] = share
            for j in range(k + 1, n):
                stack[0, i, j] -= share * stack[0, k, j]
    return True


@summing_kernel
def factor_pair(at: int, real: float, imaginary: float, jacobian: Any, size: Any, stack: Any, exchanges: Any) -> bool:
    """Factor the complex `real + i imaginary - jacobian` in places `at` and `at + 1`, as `factor` does."""
    n = len(size)
    of = at + 1
    for i in range(n):
        for j in range(n):
            stack[at, i, j] = -jacobian[i, j]
            stack[of, i, j] = 0.0
        stack[at, i, i] += real
        stack[of, i, i] = imaginary
    for k in range(n):
        chosen, largest = k, abs(stack[at, k, k]) + abs(stack[of, k, k])
        for i in range(k + 1, n):
            present = abs(stack[at, i, k]) + abs(stack[of, i, k])
            if present > largest:
                chosen, largest = i, present
        if not 0.0 < largest < _HUGE:
            return False
        exchanges[at, k] = chosen
        if chosen != k:
            for j in range(n):
                stack[at, k, j], stack[at, chosen, j] = stack[at, chosen, j], stack[at, k, j]
                stack[of, k, j], stack[of, chosen, j] = stack[of, chosen, j], stack[of, k, j]
        re, im = stack[at, k, k], stack[of, k, k]
        square = 1.0 / (re * re + im * im)
        re, im = re * square, -im * square
        stack[at, k, k], stack[of, k, k] = re, im
        for i in range(k + 1, n):
            a, b = stack[at, i, k], stack[of, i, k]
            first, second = a * re - b * im, a * im + b * re
            stack[at, i, k], stack[of, i, k] = first, second
            for j in range(k + 1, n):
                a, b = stack[at, k, j], stack[of, k, j]
                stack[at, i, j] -= first * a - second * b
                stack[of, i, j] -= first * b + second * a
    return True


@summing_kernel
def solve(size: Any, stack: Any, exchanges: Any, right: Any) -> None:
    """Replace row 0 of `right` (s, n) by the solution of the real system."""
    n = len(size)
    for k in range(n):
        chosen = exchanges[0, k]
        if chosen != k:
            right[0, k], right[0, chosen] = right[0, chosen], right[0, k]
    for i in range(1, n):
        total = right[0, i]
        for j in range(i):
            total -= stack[0, i, j] * right[0, j]
        right[0, i] = total
    for i in range(n - 1, -1, -1):
        total = right[0, i]
        for j in range(i + 1, n):
            total -= stack[0, i, j] * right[0, j]
        right[0, i] = total * stack[0, i, i]


@summing_kernel
def solve_pair(at: int, size: Any, stack: Any, exchanges: Any, right: Any) -> None:
    """Replace rows `at` and `at + 1` of `right` by the solution of the complex system there."""
    n = len(size)
    of = at + 1
    for k in range(n):
        chosen = exchanges[at, k]
        if chosen != k:
            right[at, k], right[at, chosen] = right[at, chosen], right[at, k]
            right[of, k], right[of, chosen] = right[of, chosen], right[of, k]
    for i in range(1, n):
        re, im = right[at, i], right[of, i]
        for j in range(i):
            a, b, x, y = stack[at, i, j], stack[of, i, j], right[at, j], right[of, j]
            re -= a * x - b * y
            im -= a * y + b * x
        right[at, i], right[of, i] = re, im
    for i in range(n - 1, -1, -1):
        re, im = right[at, i], right[of, i]
        for j in range(i + 1, n):
            a, b, x, y = stack[at, i, j], stack[of, i, j], right[at, j], right[of, j]
            re -= a * x - b * y
            im -= a * y + b * x
        a, b = stack[at, i, i], stack[of, i, i]
        right[at, i], right[of, i] = a * re - b * im, a * im + b * re
