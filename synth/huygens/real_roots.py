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

_TERMS = ((2, 0, 0), (1, 1, 0), (0, 2, 0), (1, 0, 1), (0, 1, 1), (0, 0, 2))
"""Powers of x, y, z in the same order, z making the forms homogeneous."""


def real_roots(values: Sequence[Fraction], low: Fraction, high: Fraction, width: Fraction) -> list[Fraction]:
    """Different real roots in [low, high], increasing, of a polynomial with these coefficients, lowest power first.

    Each is the middle of an interval no wider than `width` that holds it and no other; a root nearer to an end than
    half of that may be given too. `ValueError` if the polynomial is zero everywhere.

    Examples
    --------
    (x^2 - 2)(x - 1)^2: the double root is one.

    >>> roots = real_roots([Fraction(c) for c in (-2, 4, -1, -2, 1)], Fraction(0), Fraction(2), Fraction(1, 10**9))
    >>> [round(float(root), 6) for root in roots]
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
            real = [root.real for root, _ in polynomial.complex_roots() if root.imag == 0]
            balls = [(_fraction(each.mid()), _fraction(each.rad())) for each in real]
            inside = [each for each in balls if low <= sum(each) and each[0] - each[1] <= high]
            if all(2 * radius <= width for _, radius in inside):
                return sorted(middle for middle, _ in inside)
            ctx.prec *= 2
    finally:
        ctx.prec = digits


def _fraction(number: Any) -> Fraction:
    mantissa, exponent = number.man_exp()
    return Fraction(int(mantissa)) * Fraction(2) ** int(exponent)


def rational(value: Fraction) -> Any:
    """A fraction as a number that goes with polynomials."""
    from flint import fmpq

    return fmpq(value.numerator, value.denominator)


def resultant(conics: Callable[[Any], Sequence[Conic]]) -> list[Fraction]:
    """Coefficients, lowest power first, of the polynomial of one unknown that is zero if and only if three conics have
    a point in common, real or not, finite or not; `conics` gives the three from the unknown.
    """
    from flint import Ordering, fmpq_mpoly_ctx

    ring = fmpq_mpoly_ctx.get(["x", "y", "z", "unknown"], Ordering.lex)
    terms = [ring.from_dict({(*term, 0): 1}) for term in _TERMS]
    forms = []
    for conic in conics(ring.gens()[3]):
        numbers = [rational(each) if isinstance(each, Fraction) else each for each in conic]
        forms.append(sum(term * each for term, each in zip(terms, numbers, strict=True)))
    jacobian = _determinant([[form.derivative(axis) for axis in range(3)] for form in forms])
    forms += [jacobian.derivative(axis) for axis in range(3)]
    rows = [
        [ring.from_dict({key: value for key, value in form.to_dict().items() if key[:3] == term}) for term in _TERMS]
        for form in forms
    ]
    # every product of the expansion holds each term once: together x^4 y^4 z^4
    by_power = {key[3]: Fraction(int(value.p), int(value.q)) for key, value in _determinant(rows).to_dict().items()}
    return [by_power.get(power, Fraction(0)) for power in range(max(by_power, default=0) + 1)]


def _determinant(rows: list[list[Any]]) -> Any:
    """By expansion: 6 x 6 at most."""
    if not rows:
        return 1
    minors = ([row[:k] + row[k + 1 :] for row in rows[1:]] for k in range(len(rows)))
    return sum(
        (-1) ** k * value * _determinant(minor) for k, (value, minor) in enumerate(zip(rows[0], minors, strict=True))
    )
