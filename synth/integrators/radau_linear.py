"""The linear systems of Radau's Newton iteration: one real and (s - 1)/2 complex matrices of the size of the state.

The real one is kept as a complex one without imaginary part. `rate - jacobian` is factored with partial pivoting, rows
exchanged whole, so that all exchanges are applied to a right-hand side before any substitution. Pivots are stored
inverted: substitution divides nowhere. The number of unknowns comes as the length of a tuple, which the compiler knows
and unrolls by; matrices are addressed in their stack, because a view of one costs more than its solution.
"""

from __future__ import annotations

from typing import Any

from synth.kernels.compiled import kernel, summing_kernel


@kernel
def factor(rate: complex, jacobian: Any, which: int, size: Any, matrices: Any, exchanges: Any) -> bool:
    """Factor `rate - jacobian`.

    Parameters
    ----------
    rate : complex
        Eigenvalue of A^-1 over the step.
    jacobian : (n, n) array
    which : int
        Place in the stacks.
    size : tuple of length n
    matrices : (m, n, n) complex array
        L below the diagonal, inverse pivots on it, U above.
    exchanges : (m, n) integer array
        Row exchanged with row k at stage k.

    Returns
    -------
    bool
        False if the matrix is singular or not finite.
    """
    n = len(size)
    for i in range(n):
        for j in range(n):
            matrices[which, i, j] = -jacobian[i, j]
        matrices[which, i, i] += rate
    for k in range(n):
        chosen = k
        largest = abs(matrices[which, k, k].real) + abs(matrices[which, k, k].imag)
        for i in range(k + 1, n):
            present = abs(matrices[which, i, k].real) + abs(matrices[which, i, k].imag)
            if present > largest:
                largest = present
                chosen = i
        if not 0.0 < largest < 1e150:
            return False
        exchanges[which, k] = chosen
        if chosen != k:
            for j in range(n):
                held = matrices[which, k, j]
                matrices[which, k, j] = matrices[which, chosen, j]
                matrices[which, chosen, j] = held
        pivot = matrices[which, k, k]
        square = 1.0 / (pivot.real * pivot.real + pivot.imag * pivot.imag)
        inverse = complex(pivot.real * square, -pivot.imag * square)
        matrices[which, k, k] = inverse
        for i in range(k + 1, n):
            share = matrices[which, i, k] * inverse
            matrices[which, i, k] = share
            for j in range(k + 1, n):
                matrices[which, i, j] -= share * matrices[which, k, j]
    return True


@summing_kernel
def solve(which: int, size: Any, matrices: Any, exchanges: Any, right: Any) -> None:
    """Replace `right` (n,) by the solution of the factored system."""
    n = len(size)
    for k in range(n):
        chosen = exchanges[which, k]
        held = right[k]
        right[k] = right[chosen]
        right[chosen] = held
    for i in range(1, n):
        total = right[i]
        for j in range(i):
            total -= matrices[which, i, j] * right[j]
        right[i] = total
    for i in range(n - 1, -1, -1):
        total = right[i]
        for j in range(i + 1, n):
            total -= matrices[which, i, j] * right[j]
        right[i] = total * matrices[which, i, i]
