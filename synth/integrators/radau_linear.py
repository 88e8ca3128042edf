"""The linear systems of Radau's Newton iteration: one real and (s - 1)/2 complex matrices of the size of the state.

`rate/step - jacobian` is factored with partial pivoting, rows exchanged whole, so that all exchanges are applied to a
right-hand side before any substitution. Pivots are stored inverted: substitution divides nowhere. The number of
unknowns comes as the length of a tuple, which the compiler knows and unrolls by.
"""

from __future__ import annotations

from typing import Any

from synth.kernels.compiled import kernel


@kernel
def factor(rate: Any, jacobian: Any, size: Any, matrix: Any, order: Any) -> bool:
    """Factor `rate - jacobian` for a real or complex rate.

    Parameters
    ----------
    rate : float or complex
        Eigenvalue of A^-1 over the step.
    jacobian : (n, n) array
    size : tuple of length n
    matrix : (n, n) array of the type of `rate`
        L below the diagonal, inverse pivots on it, U above.
    order : (n,) integer array
        Row exchanged with row k at stage k.

    Returns
    -------
    bool
        False if the matrix is singular or not finite.
    """
    n = len(size)
    for i in range(n):
        for j in range(n):
            matrix[i, j] = -jacobian[i, j]
        matrix[i, i] += rate
    for k in range(n):
        chosen = k
        largest = abs(matrix[k, k].real) + abs(matrix[k, k].imag)
        for i in range(k + 1, n):
            present = abs(matrix[i, k].real) + abs(matrix[i, k].imag)
            if present > largest:
                largest = present
                chosen = i
        if not 0.0 < largest < 1e300:
            return False
        order[k] = chosen
        if chosen != k:
            for j in range(n):
                held = matrix[k, j]
                matrix[k, j] = matrix[chosen, j]
                matrix[chosen, j] = held
        pivot = matrix[k, k]
        inverse = pivot.conjugate() * (1.0 / (pivot.real * pivot.real + pivot.imag * pivot.imag))
        matrix[k, k] = inverse
        for i in range(k + 1, n):
            share = matrix[i, k] * inverse
            matrix[i, k] = share
            for j in range(k + 1, n):
                matrix[i, j] -= share * matrix[k, j]
    return True


@kernel
def solve(matrix: Any, order: Any, size: Any, right: Any) -> None:
    """Replace `right` (n,) by the solution of the factored system."""
    n = len(size)
    for k in range(n):
        chosen = order[k]
        held = right[k]
        right[k] = right[chosen]
        right[chosen] = held
    for i in range(1, n):
        total = right[i]
        for j in range(i):
            total -= matrix[i, j] * right[j]
        right[i] = total
    for i in range(n - 1, -1, -1):
        total = right[i]
        for j in range(i + 1, n):
            total -= matrix[i, j] * right[j]
        right[i] = total * matrix[i, i]
