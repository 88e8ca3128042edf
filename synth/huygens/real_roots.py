"""Where three conics meet, exactly: their resultant, and all real roots of a polynomial with rational coefficients.

Doubles are rationals, so a polynomial computed from them exactly has roots that can be counted exactly: between two
points lie as many different ones as Sturm's chain loses changes of sign. Each is then halved down to a bracket far
narrower than a double can tell: none is missed, none is doubled.

Three quadratic forms in three unknowns vanish together somewhere (but at the origin) if and only if the determinant of
six quadratic forms does: the three, and the slopes of their Jacobian, which also vanish wherever the three do
(G. Salmon, Lessons introductory to the modern higher algebra, 1885, art. 90).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from itertools import pairwise
from math import gcd, lcm

Polynomial = list[int]  # coefficients, lowest power first, the last not zero; [] is zero
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
    chain = sturm_chain(values)
    brackets = [(low, high, _changes(chain, low), _changes(chain, high))]
    found = []
    while brackets:
        left, right, before, after = brackets.pop()
        if before == after:
            continue
        middle = (left + right) / 2
        if before - after == 1 and right - left <= width:
            found.append(middle)
            continue
        between = _changes(chain, middle)
        brackets += [(middle, right, between, after), (left, middle, before, between)]
    return found


def sturm_chain(values: Sequence[Fraction]) -> list[Polynomial]:
    """Sturm's chain of a polynomial with each root once: it, its slope, minus remainders, over their divisor.

    Divided out, the chain counts right even at a multiple root.
    """
    first = _primitive(values)
    if not first:
        raise ValueError("the polynomial is zero everywhere")
    chain = [first]
    following = _primitive([power * each for power, each in enumerate(first)][1:])
    while following:
        chain.append(following)
        following = [-each for each in _divided(chain[-2], chain[-1])[1]]
    return [_divided(each, chain[-1])[0] for each in chain]


def _primitive(values: Sequence[Fraction | int]) -> Polynomial:
    """Whole coefficients without a common factor, positive multiples of the given ones."""
    exact = [Fraction(each) for each in values]
    while exact and not exact[-1]:
        exact.pop()
    below = lcm(*(each.denominator for each in exact))
    whole = [each.numerator * (below // each.denominator) for each in exact]
    return [each // gcd(*whole) for each in whole]


def _divided(dividend: Polynomial, divisor: Polynomial) -> tuple[Polynomial, Polynomial]:
    """Quotient and remainder, each times a positive number."""
    rest, quotient = [Fraction(each) for each in dividend], []
    for place in range(len(dividend) - len(divisor), -1, -1):
        quotient.append(rest[place + len(divisor) - 1] / divisor[-1])
        for power, each in enumerate(divisor):
            rest[place + power] -= quotient[-1] * each
    return _primitive(quotient[::-1]), _primitive(rest[: len(divisor) - 1])


def _changes(chain: Sequence[Polynomial], place: Fraction) -> int:
    """Changes of sign along the chain."""
    signs = [sign for sign in (_sign(each, place) for each in chain) if sign]
    return sum(one != other for one, other in pairwise(signs))


def _sign(values: Polynomial, place: Fraction) -> int:
    top, bottom = place.numerator, place.denominator
    total, scale = 0, 1
    for each in reversed(values):  # Horner, with the denominators collected
        total = total * top + each * scale
        scale *= bottom
    return (total > 0) - (total < 0)


def resultant(conics: Sequence[Conic]) -> Fraction:
    """Number that is zero if and only if three conics have a point in common, real or not, finite or not."""
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
