"""Where three conics meet, exactly: their resultant, and all real roots of a polynomial with rational coefficients.

Doubles are rationals, so a polynomial computed from them exactly has roots that can be counted exactly, and each be
enclosed in a bracket far narrower than a double can tell: none is missed, none is doubled.

Three quadratic forms in three unknowns vanish together somewhere (but at the origin) if and only if the determinant of
six quadratic forms does: the three, and the slopes of their Jacobian, which also vanish wherever the three do
(G. Salmon, Lessons introductory to the modern higher algebra, 1885, art. 90).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

Conic = tuple[Any, Any, Any, Any, Any, Any]
"""Coefficients of x^2, x y, y^2, x, y, 1: fractions, or polynomials with rational coefficients."""


def real_roots(values: Sequence[Fraction], low: Fraction, high: Fraction, width: Fraction) -> list[Fraction]:
    """Different real roots of a polynomial in (low, high], increasing.

    `ValueError` if the polynomial is zero everywhere.

    Parameters
    ----------
    values : sequence of Fraction
        Coefficients, lowest power first.
    low, high : Fraction
        Ends of the interval.
    width : Fraction
        Each root is the middle of an interval no wider than this that holds it and no other.

    Examples
    --------
    (x^2 - 2)(x - 1)^2: the double root is one.

    >>> found = real_roots([Fraction(c) for c in (-2, 4, -1, -2, 1)], Fraction(0), Fraction(2), Fraction(1, 10**9))
    >>> [round(float(root), 6) for root in found]
    [1.0, 1.414214]
    """
    from sympy import QQ, Dummy, Poly

    polynomial = Poly.from_list([QQ(each.numerator, each.denominator) for each in reversed(values)], Dummy(), domain=QQ)
    if polynomial.is_zero:
        raise ValueError("the polynomial is zero everywhere")
    below, above = (QQ(each.numerator, each.denominator) for each in (low, high))
    eps = QQ(width.numerator, width.denominator)
    brackets = polynomial.sqf_part().intervals(eps=eps, inf=below, sup=above, sqf=True)
    ends = ([Fraction(int(each.p), int(each.q)) for each in bracket] for bracket in brackets)
    return [(left + right) / 2 for left, right in ends if right > low]


def resultant(conics: Callable[[Any], Sequence[Conic]]) -> list[Fraction]:
    """Coefficients, lowest power first, of the polynomial of one unknown that is zero if and only if three conics have
    a point in common, real or not, finite or not.

    Parameters
    ----------
    conics : callable
        Of the unknown: the three, whose coefficients are rational polynomials of it.
    """
    from sympy import QQ, ring
    from sympy.polys.matrices import DomainMatrix

    numbers, unknown = ring("unknown", QQ)
    domain = numbers.to_domain()
    plane, x, y, z = ring("x, y, z", domain)
    terms = (x * x, x * y, y * y, x * z, y * z, z * z)
    forms = [sum(term * numbers(value) for term, value in zip(terms, conic, strict=True)) for conic in conics(unknown)]
    slopes = DomainMatrix([[form.diff(place) for place in (x, y, z)] for form in forms], (3, 3), plane.to_domain())
    jacobian = slopes.det()
    rows = [[form.coeff(term) for term in terms] for form in (*forms, *(jacobian.diff(place) for place in (x, y, z)))]
    found = DomainMatrix(rows, (6, 6), domain).det()
    values = [found.coeff(unknown**power) for power in range(max(found.degree(), 0) + 1)]
    return [Fraction(int(each.numerator), int(each.denominator)) for each in values]
