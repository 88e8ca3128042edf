"""Isolation of real roots, and the resultant of three conics: exact, so equalities."""

from __future__ import annotations

from fractions import Fraction

import pytest

from synth.huygens.balance import real_roots, resultant

ONE = Fraction(1)
WIDTH = Fraction(1, 1 << 60)


def expanded(roots: list[Fraction]) -> list[Fraction]:
    """Coefficients of the product of (x - root)."""
    values = [ONE]
    for root in roots:
        shifted = [Fraction(0), *values]
        values = [above - root * each for above, each in zip(shifted, [*values, Fraction(0)], strict=True)]
    return values


def test_every_root_once() -> None:
    """Double, triple and close ones, and one at either end."""
    roots = [Fraction(each) for each in (-1, 0, 1, 1, 2, 2, 2, 5, 6)] + [1 + Fraction(1, 10**9)]
    found = real_roots(expanded(roots), Fraction(0), Fraction(5), WIDTH)
    expected = [0, 1, 1 + Fraction(1, 10**9), 2, 5]
    assert len(found) == len(expected)
    assert all(abs(one - other) <= WIDTH for one, other in zip(found, expected, strict=True))


def test_a_multiple_root_met_on_the_way() -> None:
    """Halving [0, 2] meets 1 at once, where the polynomial and its slope vanish together."""
    found = real_roots(expanded([ONE, ONE, Fraction(3, 2)]), Fraction(0), Fraction(2), WIDTH)
    assert [round(float(each), 12) for each in found] == [1.0, 1.5]


def test_no_real_root() -> None:
    assert real_roots([ONE, Fraction(0), ONE], Fraction(-9), Fraction(9), WIDTH) == []
    with pytest.raises(ValueError, match="zero everywhere"):
        real_roots([Fraction(0)], Fraction(0), ONE, WIDTH)


def conic(*values: int) -> tuple[Fraction, ...]:
    return tuple(Fraction(each) for each in values)


def test_the_resultant_of_conics_through_a_point() -> None:
    """Through (3, -2): zero. With the last one moved: not. At infinity: zero, if all three go there together."""
    through = [conic(1, 0, 0, 0, 0, -9), conic(0, 1, 0, 0, 0, 6), conic(0, 0, 1, 1, 1, -5)]
    assert resultant(lambda _: through) == [0]
    assert resultant(lambda _: [*through[:2], conic(0, 0, 1, 1, 1, -4)]) != [0]
    assert resultant(lambda _: [conic(0, 1, 0, 1, 0, 1), conic(0, 2, 0, 0, 1, 1), conic(0, 3, 0, 1, 1, 5)]) == [0]


def test_the_resultant_scales_with_the_fourth_power_of_each() -> None:
    """It is of degree 4 in the coefficients of each conic: what makes the degree in beta 20."""
    three = [conic(1, 2, 3, -1, 0, 2), conic(2, 0, 1, 1, -3, 1), conic(1, 1, -1, 2, 1, -4)]
    scaled = [tuple(3 * each for each in three[0]), *three[1:]]
    (value,) = resultant(lambda _: three)
    assert value != 0
    assert resultant(lambda _: scaled) == [81 * value]


def test_the_resultant_of_conics_that_depend_on_an_unknown() -> None:
    """Two pairs of lines and a circle of squared radius u meet four times where u is 2: (u - 2)^4 but for a factor."""
    found = resultant(lambda u: [conic(1, 0, 0, 0, 0, -1), conic(0, 0, 1, 0, 0, -1), (1, 0, 1, 0, 0, -u)])
    assert [each / found[-1] for each in found] == [16, -32, 24, -8, 1]
