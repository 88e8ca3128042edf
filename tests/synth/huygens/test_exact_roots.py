"""The resultant of three conics without a product of x and y: exact, so equalities."""

from __future__ import annotations

from flint import fmpq_poly

from synth.huygens.balance import Conic, resultant

U = fmpq_poly([0, 1])


def conic(*values: int | fmpq_poly) -> Conic:
    x2, y2, x, y, one = (fmpq_poly([0]) + each for each in values)
    return x2, y2, x, y, one


def test_the_resultant_of_conics_through_a_point() -> None:
    """Through (3, -2): zero. With the last one moved: not."""
    through = [conic(1, 0, 0, 1, -7), conic(1, 1, 0, 0, -13), conic(0, 1, 1, 1, -5)]
    assert resultant(through) == 0
    assert resultant([*through[:2], conic(0, 1, 1, 1, -4)]) != 0


def test_the_resultant_scales_with_the_fourth_power_of_each() -> None:
    """It is of degree 4 in the coefficients of each conic: what makes the degree in beta 20."""
    three = [conic(1, 3, -1, 0, 2), conic(2, 1, 1, -3, 1), conic(1, -1, 2, 1, -4)]
    value = resultant(three)
    assert value != 0
    for k in range(3):
        scaled = [conic(*(3 * value for value in each)) if j == k else each for j, each in enumerate(three)]
        assert resultant(scaled) == 81 * value


def test_the_resultant_of_conics_that_depend_on_an_unknown() -> None:
    """Two pairs of lines and a circle of squared radius u about (0, 1/2): twice each at 5/4 and 13/4."""
    found = resultant([conic(1, 0, 0, 0, -1), conic(0, 1, 0, 0, -1), conic(4, 4, 0, -4, 1 - 4 * U)])
    expected = (4 * U - 5) ** 2 * (4 * U - 13) ** 2
    assert found * expected[4] == expected * found[4]


def test_every_root_once() -> None:
    """Isolated by FLINT: a double root and one close to it, and none that is not real."""
    roots = ((U - 1) ** 2 * (10**9 * (U - 1) - 1) * (U**2 + 1)).complex_roots()
    assert sorted(float(root.real) for root, _ in roots if root.imag == 0) == [1.0, 1.0 + 1e-9]
