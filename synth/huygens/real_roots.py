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

Conic = tuple[Fraction, Fraction, Fraction, Fraction, Fraction, Fraction]
"""Coefficients of x^2, x y, y^2, x, y, 1."""
_Terms = dict[tuple[int, int], Fraction]  # by powers of x and y; the third unknown makes up the degree
_POWERS = ((2, 0), (1, 1), (0, 2), (1, 0), (0, 1), (0, 0))


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


def resultant(conics: Sequence[Conic]) -> Fraction:
    """Number that is zero if and only if three conics have a point in common, real or not, finite or not."""
    from sympy import QQ
    from sympy.polys.matrices import DomainMatrix

    forms: list[_Terms] = [dict(zip(_POWERS, conic, strict=True)) for conic in conics]
    slopes = [[_slope(form, variable, 2) for variable in range(3)] for form in forms]
    jacobian: _Terms = {}
    for (i, j, k), sign in (
        ((0, 1, 2), 1), ((1, 2, 0), 1), ((2, 0, 1), 1), ((0, 2, 1), -1), ((2, 1, 0), -1), ((1, 0, 2), -1),
    ):  # fmt: skip
        product = _product(_product(slopes[0][i], slopes[1][j]), slopes[2][k])
        for powers, value in product.items():
            jacobian[powers] = jacobian.get(powers, Fraction(0)) + sign * value
    forms += [_slope(jacobian, variable, 3) for variable in range(3)]
    rows = [
        [QQ(value.numerator, value.denominator) for value in (form.get(powers, Fraction(0)) for powers in _POWERS)]
        for form in forms
    ]
    found = DomainMatrix(rows, (6, 6), QQ).det()
    return Fraction(int(found.numerator), int(found.denominator))


def interpolated(function: Callable[[Fraction], Fraction], degree: int, step: Fraction) -> list[Fraction]:
    """Coefficients (lowest power first) of the polynomial of at most this degree that a function is, exactly."""
    from sympy import QQ
    from sympy.polys.matrices import DomainMatrix

    places = [QQ(index * step.numerator, step.denominator) for index in range(degree + 1)]
    values = [function(index * step) for index in range(degree + 1)]
    powers = DomainMatrix([[place**power for power in range(degree + 1)] for place in places], (degree + 1,) * 2, QQ)
    right = DomainMatrix([[QQ(each.numerator, each.denominator)] for each in values], (degree + 1, 1), QQ)
    return [Fraction(int(each.numerator), int(each.denominator)) for each in powers.lu_solve(right).to_list_flat()]


def _slope(form: _Terms, variable: int, degree: int) -> _Terms:
    """Partial derivative; variables x, y and the third."""
    found: _Terms = {}
    for (i, j), value in form.items():
        power = (i, j, degree - i - j)[variable]
        if power:
            found[i - (variable == 0), j - (variable == 1)] = power * value
    return found


def _product(one: _Terms, other: _Terms) -> _Terms:
    found: _Terms = {}
    for (i, j), value in one.items():
        for (k, m), factor in other.items():
            found[i + k, j + m] = found.get((i + k, j + m), Fraction(0)) + value * factor
    return found
