"""The coefficients of Radau IIA, computed again from their definition with 50 digits."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from synth.integrators.radau_newton import FIVE, SEVEN, Tableau

ROUNDED = 1.2e-16  # half a unit of the last place, relative


def _legendre(degree: int) -> list[mpmath.mpf]:
    """Shifted Legendre polynomial on [0, 1], lowest power first."""
    return [
        (-1) ** (degree + k) * mpmath.binomial(degree, k) * mpmath.binomial(degree + k, k) for k in range(degree + 1)
    ]


def _definition(near: list[float]) -> tuple[mpmath.matrix, mpmath.matrix]:
    """Nodes, zeros of P_s - P_(s-1), and A, from A c^(k-1) = c^k/k."""
    stages = len(near)
    lower = [*_legendre(stages - 1), mpmath.mpf(0)]
    difference = [a - b for a, b in zip(_legendre(stages), lower, strict=True)]

    def residue(at: mpmath.mpf) -> mpmath.mpf:
        return mpmath.fsum(factor * at**k for k, factor in enumerate(difference))

    nodes = [mpmath.findroot(residue, guess) for guess in near]
    powers = mpmath.matrix(stages, stages)
    integrals = mpmath.matrix(stages, stages)
    for i, node in enumerate(nodes):
        for k in range(stages):
            powers[i, k] = node**k
            integrals[i, k] = node ** (k + 1) / (k + 1)
    return mpmath.matrix(nodes), integrals * mpmath.inverse(powers)


@pytest.mark.parametrize("tableau", [FIVE, SEVEN], ids=["5", "7"])
def test_coefficients_are_those_of_the_definition(tableau: Tableau) -> None:
    stages = tableau.nodes.size
    with mpmath.workdps(50):
        nodes, matrix = _definition(tableau.nodes.tolist())
        inverse = mpmath.inverse(matrix)
        assert all(abs(nodes[i] - float(tableau.nodes[i])) <= ROUNDED for i in range(stages))
        assert all(
            abs(inverse[i, j] - float(tableau.inverse[i, j])) <= ROUNDED * abs(inverse[i, j])
            for i in range(stages)
            for j in range(stages)
        )
        modes = mpmath.matrix(stages, stages)
        for k, rate in enumerate(tableau.rates):
            near = mpmath.mpc(rate)
            vector = mpmath.matrix([1] * stages)
            for _ in range(4):  # inverse iteration converges at once from 16 digits
                vector = mpmath.lu_solve(inverse - near * mpmath.eye(stages) * (1 + mpmath.mpf(10) ** -30), vector)
                vector = vector / vector[stages - 1]
            exact = (inverse * vector)[stages - 1]
            assert abs(exact - mpmath.mpc(rate)) <= 2 * ROUNDED * abs(exact)
            for i in range(stages):
                modes[i, max(2 * k - 1, 0)] = mpmath.re(vector[i])
                if k > 0:
                    modes[i, 2 * k] = -mpmath.im(vector[i])
        projection = mpmath.inverse(modes)
        for i in range(stages):
            for j in range(stages):
                assert abs(modes[i, j] - float(tableau.modes[i, j])) <= ROUNDED * max(abs(modes[i, j]), 1e-30)
                assert abs(projection[i, j] - float(tableau.projection[i, j])) <= ROUNDED * abs(projection[i, j])


@pytest.mark.parametrize("tableau", [FIVE, SEVEN], ids=["5", "7"])
def test_embedded_formula_is_exact_for_polynomials_up_to_its_order(tableau: Tableau) -> None:
    """With slopes t^k, h f(start)/gamma + sum e_i z_i vanishes for k < s and not for k = s."""
    stages = tableau.nodes.size
    for k in range(stages + 1):
        increments = tableau.nodes ** (k + 1) / (k + 1)
        start = 1.0 if k == 0 else 0.0
        left = start / tableau.rates[0].real + tableau.error @ increments
        assert (abs(left) < 1e-14) == (k < stages)  # rounding of sums of numbers up to 7


def test_last_row_of_modes_is_the_plain_sum_of_real_parts() -> None:
    for tableau in (FIVE, SEVEN):
        expected = [1.0] + [1.0, 0.0] * (tableau.rates.size - 1)
        assert np.array_equal(tableau.modes[-1], expected)
