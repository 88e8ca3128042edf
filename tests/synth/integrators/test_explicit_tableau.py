"""The coefficients meet the order conditions of Butcher's trees, in exact arithmetic."""

from __future__ import annotations

from fractions import Fraction
from math import prod

import pytest

from synth.integrators.explicit_step import CORRECTION, DENSE, ERRORS, INSIDE, NODES

A = [[Fraction(value) for value in row] for row in INSIDE[:12]]
B = [Fraction(value) + Fraction(small) for value, small in zip(INSIDE[12, :12], CORRECTION, strict=True)]
C = [sum(row, Fraction(0)) for row in A]

Tree = tuple["Tree", ...]


def trees(order: int) -> list[Tree]:
    """All rooted trees of `order` nodes, as nested sorted tuples."""
    if order == 1:
        return [()]
    found: set[Tree] = set()

    def grow(left: int, largest: int, branches: Tree) -> None:
        if left == 0:
            found.add(tuple(sorted(branches)))
            return
        for size in range(min(left, largest), 0, -1):
            for tree in trees(size):
                grow(left - size, size, (*branches, tree))

    grow(order - 1, order - 1, ())
    return sorted(found)


def size(tree: Tree) -> int:
    return 1 + sum(size(branch) for branch in tree)


def density(tree: Tree) -> int:
    return size(tree) * prod(density(branch) for branch in tree)


def stages(tree: Tree) -> list[Fraction]:
    """Elementary weight of the tree's crown at each stage."""
    result = [Fraction(1)] * 12
    for branch in tree:
        inner = stages(branch)
        step = [sum((a * v for a, v in zip(row, inner, strict=False)), Fraction(0)) for row in A]
        step[0] = Fraction(0)
        result = [one * other for one, other in zip(result, step, strict=True)]
    return result


@pytest.mark.parametrize("order", range(1, 9))
def test_order_conditions(order: int) -> None:
    """200 trees; what is left is the rounding of the published numbers, 1e-18 where the correction acts."""
    worst = max(
        abs(float(sum(b * v for b, v in zip(B, stages(tree), strict=True)) - Fraction(1, density(tree))))
        for tree in trees(order)
    )
    assert worst < {1: 1e-18, 2: 1e-18, 3: 1e-16}.get(order, 1e-15)


def test_order_nine_is_not_met() -> None:
    """So that the conditions above can fail."""
    tall: Tree = ()
    for _ in range(8):
        tall = (tall,)
    assert abs(float(sum(b * v for b, v in zip(B, stages(tall), strict=True)) - Fraction(1, density(tall)))) > 1e-8


def test_nodes_are_row_sums() -> None:
    for row, node in zip(INSIDE[1:12], NODES[1:12], strict=True):
        assert sum(map(Fraction, row)) == pytest.approx(Fraction(node), abs=1e-14)  # weights of 40, rounded
    for row, node in zip(INSIDE[13:], NODES[13:], strict=True):
        assert sum(map(Fraction, row)) == pytest.approx(Fraction(node), abs=1e-15)


@pytest.mark.parametrize(("row", "order"), [(0, 3), (1, 5)])
def test_embedded_estimates_vanish_to_their_order(row: int, order: int) -> None:
    for power in range(order):
        assert abs(sum(e * c**power for e, c in zip(ERRORS[row], NODES[:12], strict=True))) < 1e-13


def test_dense_rows_vanish_for_slopes_that_the_first_three_coefficients_carry() -> None:
    """A cubic is carried by the values and slopes at the ends alone."""
    for row in DENSE:
        for power in range(3):
            assert abs(sum(d * c**power for d, c in zip(row, NODES, strict=True))) < 1e-11  # weights of 500
