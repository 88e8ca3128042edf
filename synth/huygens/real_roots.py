"""All real roots of a polynomial with rational coefficients, by Sturm's theorem: none is missed, none is doubled.

Doubles are rationals, so a polynomial computed from them exactly has roots that can be counted exactly: between two
points lie as many different ones as Sturm's chain loses changes of sign. Each is then halved down to a bracket far
narrower than a double can tell.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from math import gcd

Polynomial = list[int]  # coefficients, lowest power first, the last not zero; [] is zero


def real_roots(values: Sequence[Fraction], low: Fraction, high: Fraction, width: Fraction) -> list[Fraction]:
    """Different real roots of a polynomial in (low, high], increasing.

    Parameters
    ----------
    values : sequence of Fraction
        Coefficients, lowest power first.
    low, high : Fraction
        Ends of the interval.
    width : Fraction
        Each root is the middle of an interval no wider than this that holds it and no other.

    Raises
    ------
    ValueError
        If the polynomial is zero everywhere.

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
        following = [-each for each in _remainder(chain[-2], chain[-1])]
    return [_quotient(each, chain[-1]) for each in chain]


def _primitive(values: Sequence[Fraction | int]) -> Polynomial:
    """Whole coefficients without a common factor, positive multiples of the given ones."""
    exact = [Fraction(each) for each in values]
    while exact and not exact[-1]:
        exact.pop()
    below = 1
    for each in exact:
        below = below * each.denominator // gcd(below, each.denominator)
    whole = [each.numerator * (below // each.denominator) for each in exact]
    common = gcd(*whole) if whole else 1
    return [each // common for each in whole]


def _remainder(dividend: Polynomial, divisor: Polynomial) -> Polynomial:
    """A positive multiple of the remainder."""
    rest, lead = list(dividend), abs(divisor[-1])
    sign = 1 if divisor[-1] > 0 else -1
    for place in range(len(dividend) - len(divisor), -1, -1):
        top = rest[place + len(divisor) - 1]
        rest = [lead * each for each in rest]
        for power, each in enumerate(divisor):
            rest[place + power] -= sign * top * each
    return _primitive(rest[: len(divisor) - 1])


def _quotient(dividend: Polynomial, divisor: Polynomial) -> Polynomial:
    """Of a division that leaves nothing, times a positive number."""
    rest = [Fraction(each) for each in dividend]
    found = []
    for place in range(len(dividend) - len(divisor), -1, -1):
        found.append(rest[place + len(divisor) - 1] / divisor[-1])
        for power, each in enumerate(divisor):
            rest[place + power] -= found[-1] * each
    return _primitive(found[::-1])


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
