"""Where three conics meet: their resultant, exact, by Sylvester's determinant.

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


def resultant(conics: Sequence[Conic]) -> Fraction:
    """Number that is zero if and only if three conics have a point in common, real or not, finite or not.

    Examples
    --------
    The circle x^2 + y^2 = 2, the hyperbola x y = 1 and the line pair x^2 = y^2 meet in (1, 1).

    >>> one, none = Fraction(1), Fraction(0)
    >>> circle, hyperbola = (one, none, one, none, none, -2 * one), (none, one, none, none, none, -one)
    >>> resultant([circle, hyperbola, (one, none, -one, none, none, none)])
    Fraction(0, 1)
    >>> resultant([circle, hyperbola, (one, none, -one, none, none, one)]) != 0
    True
    """
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
    return _determinant([[form.get(powers, Fraction(0)) for powers in _POWERS] for form in forms])


def interpolated(function: Callable[[Fraction], Fraction], degree: int, step: Fraction) -> list[Fraction]:
    """Coefficients (lowest power first) of the polynomial of at most this degree that a function is.

    Newton's divided differences at 0, step, 2 step, ...: exact in rationals.
    """
    places = [index * step for index in range(degree + 1)]
    table = [function(place) for place in places]
    for order in range(1, degree + 1):
        for index in range(degree, order - 1, -1):
            table[index] = (table[index] - table[index - 1]) / (order * step)
    values = [table[degree]]
    for index in range(degree - 1, -1, -1):
        values = [Fraction(0), *values]
        for power in range(len(values) - 1):
            values[power] -= places[index] * values[power + 1]
        values[0] += table[index]
    return values


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


def _determinant(rows: list[list[Fraction]]) -> Fraction:
    total = Fraction(1)
    for column in range(len(rows)):
        pivot = next((index for index in range(column, len(rows)) if rows[index][column]), None)
        if pivot is None:
            return Fraction(0)
        if pivot != column:
            rows[column], rows[pivot] = rows[pivot], rows[column]
            total = -total
        lead = rows[column]
        total *= lead[column]
        for index in range(column + 1, len(rows)):
            factor = rows[index][column] / lead[column]
            if factor:
                rows[index] = [each - factor * above for each, above in zip(rows[index], lead, strict=True)]
    return total
