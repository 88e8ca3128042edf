"""What Newton's iteration of Radau IIA needs: coefficients of the methods of 5 and 7 stages, and linear systems.

With A the matrix of the method, A^-1 has one real eigenvalue and pairs of complex ones: A^-1 = M diag(rates) M^-1.
Columns of `modes` M are the eigenvectors, scaled to end in 1: the real one, then real part and minus imaginary part
of one of each pair, so that stages are z = Re(sum of w_k times eigenvector k). `projection` is M^-1.

Source: E. Hairer, G. Wanner, "Stiff differential equations solved by Radau methods", J. Comput. Appl. Math. 111 (1999)
93-111, and Solving Ordinary Differential Equations II, section IV.8. Computed from the definition (nodes: zeros of the
difference of shifted Legendre polynomials P_s - P_(s-1)) with 80 digits and rounded once.

The linear systems, one real and (s - 1)/2 complex, live in one stack of real matrices: place 0, then two places each,
real part first (complex stacks cost a third to a half of the speed); right-hand sides are rows at the same places.
`rate - jacobian` is factored with partial pivoting, rows exchanged whole; pivots are stored inverted. The number of
unknowns comes as the length of a tuple, which the compiler unrolls by.

Shapes of arrays and indices that may be negative cost 15 %. Kernels are therefore handed addresses (`address`) of
arrays which the caller keeps alive, and index them flat; a matrix (m, n) is walked as `i * n + j`. Without compilation
an address is a view.
"""

from typing import Any, NamedTuple

import numpy as np
from flint import acb_mat, arb_mat, ctx, fmpq_poly
from numba.core import types
from numba.extending import intrinsic, overload
from numpy.typing import NDArray

from synth.kernels.compiled import summing_kernel
from synth.phase import Floats

_BITS = 300
_HUGE = 1e150  # the square of a pivot must be finite

pointer: Any = types.CPointer


class Tableau(NamedTuple):
    """One method of s stages."""

    nodes: Floats  # (s,) c, the last is 1
    rates: NDArray[np.complex128]
    """((s + 1)/2,) eigenvalues of A^-1: the real one, gamma, and those with positive imaginary part."""
    inverse: Floats  # (s, s) A^-1
    modes: Floats  # (s, s) M
    projection: Floats  # (s, s) M^-1
    error: Floats
    """(s,) e: h f(start)/gamma + sum e_i z_i is the difference from a formula of order s with weight 1/gamma at 0."""
    reciprocals: Floats
    """(s + 1, s + 1) 1/(x_i - x_j) of the nodes 1 = c_s, ..., c_1, 0 of the collocation polynomial, zero for i = j."""


def _tableau(stages: int) -> Tableau:
    every = range(stages)
    with ctx.workprec(_BITS):
        shifted = fmpq_poly([-1, 2])
        residue: Any = fmpq_poly.legendre_p(stages)(shifted) - fmpq_poly.legendre_p(stages - 1)(shifted)
        exact = sorted((root.real for root, _ in residue.complex_roots()), key=float)
        # A c^(k-1) = c^k/k
        powers = arb_mat([[node**k for k in every] for node in exact])
        solved = arb_mat([[node ** (k + 1) / (k + 1) for k in every] for node in exact]).inv()
        inverse = powers * solved
        values, vectors = acb_mat(inverse).eig(right=True)
        real = min(every, key=lambda k: abs(float(values[k].imag)))
        pairs = sorted((k for k in every if k != real and values[k].imag > 0), key=lambda k: float(values[k].imag))
        columns = [[(vectors[i, real] / vectors[stages - 1, real]).real for i in every]]
        for k in pairs:
            vector = [vectors[i, k] / vectors[stages - 1, k] for i in range(stages - 1)]
            columns += [[*(each.real for each in vector), 1], [*(-each.imag for each in vector), 0]]
        modes = arb_mat(columns).transpose()
        gamma = values[real].real
        error = [-each / gamma for each in solved.entries()[:stages]]
        points = np.array([*map(float, exact[::-1]), 0.0])
        distance = points[:, None] - points[None, :]
        np.fill_diagonal(distance, np.inf)
        rates = np.array([float(gamma), *(complex(values[k]) for k in pairs)])
        square = [np.array([[float(each) for each in row] for row in m.table()]) for m in (inverse, modes, modes.inv())]
        nodes, weights = (np.array([float(each) for each in row]) for row in (exact, error))
        return Tableau(nodes, rates, square[0], square[1], square[2], weights, 1.0 / distance)


FIVE, SEVEN = (_tableau(stages) for stages in (5, 7))  # Orders 9 and 13


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
    """Factor the real `rate - jacobian` (n, n) in place 0; False if singular or not finite; `size`: tuple of length n.

    The stack (s, n, n) receives L, inverse pivots on the diagonal, U; `exchanges` (s, n) the row exchanged with row k.
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
