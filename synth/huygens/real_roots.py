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
from math import lcm
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
    from flint import ctx, fmpz_poly

    scale = lcm(*(each.denominator for each in values))
    polynomial: Any = fmpz_poly([int(each * scale) for each in values])
    if polynomial == 0:
        raise ValueError("the polynomial is zero everywhere")
    digits = ctx.prec
    try:
        while True:
            # a ball that is not a point lies on one side of either end once it is small enough, or the end is the root
            balls = [_ball(root.real) for root, _ in polynomial.complex_roots() if root.imag == 0]
            close = [
                (middle, radius) for middle, radius in balls if not (middle + radius < low or middle - radius > high)
            ]
            ends = [end for end in {low, high} if polynomial(rational(end)) == 0]
            unsure = (
                radius and abs(middle - end) <= radius
                for middle, radius in close
                for end in {low, high}.difference(ends)
            )
            if not any(unsure) and all(2 * radius <= width for _, radius in close):
                break
            ctx.prec *= 2
    finally:
        ctx.prec = digits
    exact = [next((end for end in ends if abs(middle - end) <= radius), middle) for middle, radius in close]
    return sorted(root for root in exact if low < root <= high)


def _ball(real: Any) -> tuple[Fraction, Fraction]:
    """Middle and radius of a ball of real numbers."""
    parts = (each.man_exp() for each in (real.mid(), real.rad()))
    middle, radius = (Fraction(int(mantissa)) * Fraction(2) ** int(exponent) for mantissa, exponent in parts)
    return middle, radius


def rational(value: Fraction) -> Any:
    """A fraction as a number that goes with polynomials."""
    from flint import fmpq

    return fmpq(value.numerator, value.denominator)


def resultant(conics: Callable[[Any], Sequence[Conic]]) -> list[Fraction]:
    """Coefficients, lowest power first, of the polynomial of one unknown that is zero if and only if three conics have
    a point in common, real or not, finite or not.

    Parameters
    ----------
    conics : callable
        Of the unknown: the three, whose coefficients are rational polynomials of it.
    """
    from flint import fmpq_poly

    forms: list[Form] = [
        {term: rational(each) if isinstance(each, Fraction) else each for term, each in zip(TERMS, conic, strict=True)}
        for conic in conics(fmpq_poly([0, 1]))
    ]
    (a, b, c), (d, e, f), (g, h, i) = ([_slope(form, axis) for axis in range(3)] for form in forms)
    jacobian = _sum(
        _product(a, _sum(_product(e, i), _product(f, h), -1)),
        _sum(
            _product(b, _sum(_product(f, g), _product(d, i), -1)), _product(c, _sum(_product(d, h), _product(e, g), -1))
        ),
    )
    rows = [[form.get(term, 0) for term in TERMS] for form in (*forms, *(_slope(jacobian, axis) for axis in range(3)))]
    found = fmpq_poly([0]) + _determinant(rows)
    return [Fraction(int(each.p), int(each.q)) for each in found.coeffs()] or [Fraction(0)]


TERMS = ((2, 0, 0), (1, 1, 0), (0, 2, 0), (1, 0, 1), (0, 1, 1), (0, 0, 2))
"""Powers of x, y, z."""
Form = dict[tuple[int, ...], Any]
"""Coefficients by powers."""


def _slope(form: Form, axis: int) -> Form:
    lowered = ((list(powers), value) for powers, value in form.items() if powers[axis])
    return {(*p[:axis], p[axis] - 1, *p[axis + 1 :]): p[axis] * value for p, value in lowered}


def _product(one: Form, other: Form) -> Form:
    found: Form = {}
    for p, value in one.items():
        for q, factor in other.items():
            term = tuple(map(int.__add__, p, q))
            found[term] = found.get(term, 0) + value * factor
    return found


def _sum(one: Form, other: Form, sign: int = 1) -> Form:
    return {term: one.get(term, 0) + sign * other.get(term, 0) for term in {**one, **other}}


def _determinant(rows: list[list[Any]]) -> Any:
    """By expansion: 6 x 6 at most."""
    if not rows:
        return 1
    minors = ([row[:k] + row[k + 1 :] for row in rows[1:]] for k in range(len(rows)))
    return sum(
        (-1) ** k * value * _determinant(minor) for k, (value, minor) in enumerate(zip(rows[0], minors, strict=True))
    )
