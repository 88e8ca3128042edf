"""The linear systems of Radau's Newton iteration: one real and (s - 1)/2 complex matrices of the size of the state.

All live in one stack of real matrices: the real system in place 0, a complex one in two places that follow each other,
real part first; right-hand sides are rows at the same places.
`rate - jacobian` is factored with partial pivoting, rows exchanged whole, so that all exchanges are applied to a
right-hand side before any substitution. Pivots are stored inverted: substitution divides nowhere. The number of
unknowns comes as the length of a tuple, which the compiler knows and unrolls by.

Numba counts references to every array that a kernel is handed, with atomic instructions: arrays in place of addresses
cost 30 % on an oscillator and 20 % on a beam. Kernels are therefore handed addresses (`address`) of arrays which the
caller keeps alive, and index them flat; a matrix (m, n) is walked as `i * n + j`. Without compilation an address is a
view, and the same code runs.
"""

from __future__ import annotations

from typing import Any

from numba.core import types
from numba.extending import intrinsic, overload

from synth.kernels.compiled import summing_kernel

pointer: Any = types.CPointer

_HUGE = 1e150  # the square of a pivot must be finite


def address(array: Any) -> Any:
    """The elements of a contiguous array in order; it must outlive the address."""
    return array.reshape(-1)


def _typed(context: Any, array: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return context.make_array(signature.args[0])(context, builder, arguments[0]).data

    return pointer(array.dtype)(array), generate


_address: Any = intrinsic(_typed)
overload(address, strict=False)(lambda array: lambda array: _address(array))


@summing_kernel
def factor(rate: float, jacobian: Any, size: Any, stack: Any, exchanges: Any) -> bool:
    """Factor the real `rate - jacobian` (n, n) in place 0; False if it is singular or not finite.

    The stack (s, n, n) receives L below the diagonal, inverse pivots on it, U above; `exchanges` (s, n) the row exchanged
    with row k at stage k. `size` is a tuple of length n.
    """
    n = len(size)
    for i in range(n):
        for j in range(n):
            stack[i * n + j] = -jacobian[i * n + j]
        stack[i * n + i] += rate
    for k in range(n):
        chosen, largest = k, abs(stack[k * n + k])
        for i in range(k + 1, n):
            if abs(stack[i * n + k]) > largest:
                chosen, largest = i, abs(stack[i * n + k])
        if not 0.0 < largest < _HUGE:
            return False
        exchanges[k] = chosen
        if chosen != k:
            for j in range(n):
                stack[k * n + j], stack[chosen * n + j] = stack[chosen * n + j], stack[k * n + j]
        inverse = 1.0 / stack[k * n + k]
        stack[k * n + k] = inverse
        for i in range(k + 1, n):
            share = stack[i * n + k] * inverse
            stack[i * n + k] = share
            for j in range(k + 1, n):
                stack[i * n + j] -= share * stack[k * n + j]
    return True


@summing_kernel
def factor_pair(at: int, real: float, imaginary: float, jacobian: Any, size: Any, stack: Any, exchanges: Any) -> bool:
    """Factor the complex `real + i imaginary - jacobian` in places `at` and `at + 1`, as `factor` does."""
    n = len(size)
    of = at + 1
    for i in range(n):
        for j in range(n):
            stack[(at * n + i) * n + j] = -jacobian[i * n + j]
            stack[(of * n + i) * n + j] = 0.0
        stack[(at * n + i) * n + i] += real
        stack[(of * n + i) * n + i] = imaginary
    for k in range(n):
        chosen, largest = k, abs(stack[(at * n + k) * n + k]) + abs(stack[(of * n + k) * n + k])
        for i in range(k + 1, n):
            present = abs(stack[(at * n + i) * n + k]) + abs(stack[(of * n + i) * n + k])
            if present > largest:
                chosen, largest = i, present
        if not 0.0 < largest < _HUGE:
            return False
        exchanges[at * n + k] = chosen
        if chosen != k:
            for j in range(n):
                for part in (at, of):
                    one, other = (part * n + k) * n + j, (part * n + chosen) * n + j
                    stack[one], stack[other] = stack[other], stack[one]
        re, im = stack[(at * n + k) * n + k], stack[(of * n + k) * n + k]
        square = 1.0 / (re * re + im * im)
        re, im = re * square, -im * square
        stack[(at * n + k) * n + k], stack[(of * n + k) * n + k] = re, im
        for i in range(k + 1, n):
            a, b = stack[(at * n + i) * n + k], stack[(of * n + i) * n + k]
            first, second = a * re - b * im, a * im + b * re
            stack[(at * n + i) * n + k], stack[(of * n + i) * n + k] = first, second
            for j in range(k + 1, n):
                a, b = stack[(at * n + k) * n + j], stack[(of * n + k) * n + j]
                stack[(at * n + i) * n + j] -= first * a - second * b
                stack[(of * n + i) * n + j] -= first * b + second * a
    return True


@summing_kernel
def solve(size: Any, stack: Any, exchanges: Any, right: Any) -> None:
    """Replace row 0 of `right` (s, n) by the solution of the real system."""
    n = len(size)
    for k in range(n):
        chosen = exchanges[k]
        if chosen != k:
            right[k], right[chosen] = right[chosen], right[k]
    for i in range(1, n):
        total = right[i]
        for j in range(i):
            total -= stack[i * n + j] * right[j]
        right[i] = total
    for i in range(n - 1, -1, -1):
        total = right[i]
        for j in range(i + 1, n):
            total -= stack[i * n + j] * right[j]
        right[i] = total * stack[i * n + i]


@summing_kernel
def solve_pair(at: int, size: Any, stack: Any, exchanges: Any, right: Any) -> None:
    """Replace rows `at` and `at + 1` of `right` by the solution of the complex system there."""
    n = len(size)
    of = at + 1
    for k in range(n):
        chosen = exchanges[at * n + k]
        if chosen != k:
            right[at * n + k], right[at * n + chosen] = right[at * n + chosen], right[at * n + k]
            right[of * n + k], right[of * n + chosen] = right[of * n + chosen], right[of * n + k]
    for i in range(1, n):
        re, im = right[at * n + i], right[of * n + i]
        for j in range(i):
            a, b, x, y = stack[(at * n + i) * n + j], stack[(of * n + i) * n + j], right[at * n + j], right[of * n + j]
            re -= a * x - b * y
            im -= a * y + b * x
        right[at * n + i], right[of * n + i] = re, im
    for i in range(n - 1, -1, -1):
        re, im = right[at * n + i], right[of * n + i]
        for j in range(i + 1, n):
            a, b, x, y = stack[(at * n + i) * n + j], stack[(of * n + i) * n + j], right[at * n + j], right[of * n + j]
            re -= a * x - b * y
            im -= a * y + b * x
        a, b = stack[(at * n + i) * n + i], stack[(of * n + i) * n + i]
        right[at * n + i], right[of * n + i] = a * re - b * im, a * im + b * re
