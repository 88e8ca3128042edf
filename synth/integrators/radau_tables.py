"""Coefficients of the Radau IIA methods of 3, 5 and 7 stages (orders 5, 9 and 13), in the form Newton needs.

With A the matrix of the method, A^-1 has one real eigenvalue and pairs of complex ones: A^-1 = M diag(rates) M^-1.
Columns of `modes` M are the eigenvectors, scaled to end in 1: the real one, then real part and minus imaginary part
of one of each pair, so that stages are z = Re(sum of w_k times eigenvector k) and the last stage is the plain sum of
the real parts. `projection` is M^-1.

Source: E. Hairer, G. Wanner, "Stiff differential equations solved by Radau methods", J. Comput. Appl. Math. 111 (1999)
93-111, and Solving Ordinary Differential Equations II, section IV.8. Computed from the definition (nodes: zeros of the
difference of shifted Legendre polynomials P_s - P_(s-1)) with 80 digits and rounded once.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from flint import acb_mat, arb_mat, ctx, fmpz_poly
from numpy.typing import NDArray

from synth.phase import Floats

_BITS = 300


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
        residue = _legendre(stages) - _legendre(stages - 1)
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


def _legendre(degree: int) -> Any:
    """Shifted Legendre polynomial on [0, 1]."""
    return fmpz_poly(
        [(-1) ** (degree + k) * math.comb(degree, k) * math.comb(degree + k, k) for k in range(degree + 1)]
    )


THREE, FIVE, SEVEN = (_tableau(stages) for stages in (3, 5, 7))  # Orders 5, 9 and 13
