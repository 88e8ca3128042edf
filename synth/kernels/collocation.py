"""What all exponential collocation shares: sines of eight angles, turns of the iteration, the end of an interval.

States are sums of two doubles, (components, 4): position and rate, each as leading double and rest. The remainder at
the nodes is `known` (2, components, NODES): that of this turn, `known[now]`, and of the turn before.
"""

from __future__ import annotations

from typing import Any

from synth.kernels.compiled import kernel
from synth.kernels.lanes import LANES, load, total
from synth.phase import Floats

NODES = 16  # Gauss nodes of an interval

POINTS = NODES + 2  # start, nodes and end of an interval

_SPLIT = 134217729.0  # 2^27 + 1
_ROUNDER = 6755399441055744.0  # 1.5 * 2^52: adding and subtracting it rounds to a whole number
_PI = (3.141592653589793116, 1.2246467991473532072e-16)
_INVERSE_PI = 0.3183098861837906715


@kernel
def turned(angle: Any) -> Any:
    """sin, cos, `angle - sin` and `1 - cos` of eight angles.

    Reduced to a quarter turn either way, then Taylor series; differences have no cancellation at small angles.
    """
    half_turns = (angle * _INVERSE_PI + _ROUNDER) - _ROUNDER
    h = (angle - half_turns * _PI[0]) - half_turns * _PI[1]
    pairs = (half_turns * 0.5 + _ROUNDER) - _ROUNDER
    sign = 1.0 - 2.0 * abs(half_turns - 2.0 * pairs)
    s = h * h
    q = s * s
    low = (1 / 6 + s * (-1 / 120)) + q * (1 / 5040 + s * (-1 / 362880))
    high = (1 / 39916800 + s * (-1 / 6227020800)) + q * (1 / 1307674368000 + s * (-1 / 355687428096000))
    top = 1 / 121645100408832000 + s * (-1 / 51090942171709440000)
    rest = (h * s) * (low + (q * q) * (high + (q * q) * top))
    low = (0.5 + s * (-1 / 24)) + q * (1 / 720 + s * (-1 / 40320))
    high = (1 / 3628800 + s * (-1 / 479001600)) + q * (1 / 87178291200 + s * (-1 / 20922789888000))
    top = 1 / 6402373705728000 + s * (-1 / 2432902008176640000)
    fall = s * (low + (q * q) * (high + (q * q) * top))
    return sign * (h - rest), sign * (1.0 - fall), (angle - sign * h) + sign * rest, (1.0 - sign) + sign * fall


@kernel
def change(known: Floats, c: int) -> float:
    """Square of what a turn changed of the remainder."""
    first = load(known, (1, c, 0)) - load(known, (0, c, 0))
    second = load(known, (1, c, LANES)) - load(known, (0, c, LANES))
    return total(first * first + second * second)


@kernel
def last_terms(tail: Floats, known: Floats, now: int, c: int) -> tuple[float, float]:
    """Squares of the last and of the last but one pair of Legendre coefficients."""
    first = product_sum(tail, 0, 0, known, now, c)
    second = product_sum(tail, 0, NODES, known, now, c)
    third = product_sum(tail, 0, 2 * NODES, known, now, c)
    fourth = product_sum(tail, 0, 3 * NODES, known, now, c)
    return third * third + fourth * fourth, first * first + second * second


@kernel
def advance(state: Floats, propagator: Floats, end: Floats, known: Floats, now: int) -> None:
    """To the end of the interval: exact products with the leading doubles, everything else in the rest."""
    for c in range(state.shape[0]):
        position, position_rest, rate, rate_rest = state[c, 0], state[c, 1], state[c, 2], state[c, 3]
        for row in range(2):
            kick = product_sum(end, c, row * NODES, known, now, c)
            kick_rest = product_sum(end, c, (row + 2) * NODES, known, now, c)
            leading, rest = _moved(propagator, c, 8 * row, position, position_rest, rate, rate_rest, kick, kick_rest)
            state[c, 2 * row], state[c, 2 * row + 1] = leading, rest


@kernel
def product_sum(rows: Floats, c: int, place: int, known: Floats, now: int, which: int) -> float:
    """Sum over the nodes of a row of weights times the remainder."""
    first = load(rows, (c, place)) * load(known, (now, which, 0))
    return total(first + load(rows, (c, place + LANES)) * load(known, (now, which, LANES)))


@kernel
def _moved(
    entries: Any, c: int, row: int, position: float, position_rest: float, rate: float, rate_rest: float,
    kick: float, kick_rest: float,
) -> tuple[float, float]:  # fmt: skip
    """One row of the propagator times the state, plus what the remainder adds; leading double and rest."""
    a, lost = _product(entries[c, row], entries[c, row + 1], entries[c, row + 2], position)
    b, more = _product(entries[c, row + 4], entries[c, row + 5], entries[c, row + 6], rate)
    small = entries[c, row + 3] * position + entries[c, row + 2] * position_rest
    small += entries[c, row + 7] * rate + entries[c, row + 6] * rate_rest
    free, first = _two_sum(a, b)
    total, second = _two_sum(free, kick)
    small = ((small + kick_rest) + (lost + more)) + (first + second)
    leading = total + small
    return leading, small - (leading - total)


@kernel
def _product(head: float, tail: float, whole: float, value: float) -> tuple[float, float]:
    """Product, and what its rounding lost; exact."""
    value_head = value * _SPLIT
    value_head = value_head - (value_head - value)
    value_tail = value - value_head
    product = whole * value
    return product, ((head * value_head - product) + (head * value_tail + tail * value_head)) + tail * value_tail


@kernel
def _two_sum(a: float, b: float) -> tuple[float, float]:
    """Sum, and what its rounding lost; exact."""
    total = a + b
    turned = total - a
    return total, (a - (total - turned)) + (b - turned)
