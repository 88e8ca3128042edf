r"""What all exponential collocation shares: weights of an interval, sines of many angles, the end of an interval.

Over one interval of length h each component obeys, with its linear part taken out,

    y'' + loss y' + square y = r(t),      r known at the Gauss nodes t_k,    r(t) = sum r_k l_k(t)   (Lagrange)
    y(t)  = (K' + loss K)(t) y(0) + K(t) y'(0)  + sum_k r_k integral_0^t K(t - s)  l_k(s) ds
    y'(t) = -square K(t) y(0)     + K'(t) y'(0) + sum_k r_k integral_0^t K'(t - s) l_k(s) ds

with K'' + loss K' + square K = 0, K(0) = 0, K'(0) = 1. Integrals are Gauss sums, those to the end in long doubles. The
propagator over a whole interval comes from ball arithmetic of 192 bits: its rounded entries alone would cost 1e-12 in
an hour; it and the weights of the end, whose errors repeat in every interval, are kept as sums of two doubles.

States are sums of two doubles, (components, 4): position and rate, each as leading double and rest. The remainder at
the nodes is `known` (2, components, NODES): that of this turn, `known[now]`, and of the turn before.
"""

import functools
import math
import threading
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from flint import acb, arb, ctx, fmpq
from numpy.typing import NDArray

from synth.kernels.compiled import kernel
from synth.kernels.lanes import LANES, load, store, total
from synth.phase import Floats, Integers

Longs = NDArray[Any]  # long doubles, which type checkers cannot tell from doubles

NODES = LANES  # Gauss nodes of an interval: all at once
POINTS = NODES + 2  # start, nodes and end of an interval
FINE = 1 << 40  # nodes are multiples of 1/FINE of half an interval: their phases are exact in fixed point

_BITS = 192
_ALONE = threading.Lock()  # the precision of balls is one for all threads
_QUADRATURE = 28  # exact for r times the 40th power of time: K over 5 rad to 1e-20
_SPLIT = 134217729.0  # 2^27 + 1
_ROUNDER = 6755399441055744.0  # 1.5 * 2^52: adding and subtracting it rounds to a whole number
_PI = (3.141592653589793116, 1.2246467991473532072e-16)
_INVERSE_PI = 0.3183098861837906715


class Weights(NamedTuple):
    """What an interval needs, for one component."""

    flow: Floats
    """(4 * NODES,) free motion at the nodes: position by start position, position by start rate, rate by start
    position, rate by start rate."""
    inner: Floats
    """(2 * NODES * NODES,) position, then rate, at the nodes (fast index) for the remainder there (slow index)."""
    end: Floats
    """(4 * NODES,) position and rate at the end for the remainder at the nodes; then what rounding left of them, for
    the same error in every interval would add up to a drift of the energy."""
    propagator: Floats
    """(16,) entries (position, position), (position, rate), (rate, position), (rate, rate), each as head and tail of
    its leading double, for exact products, that double, and what is left."""
    reach: float  # what a change of r over the interval is worth in the position, s^2


@functools.lru_cache(maxsize=1024)
def weights(
    square: float | Fraction, loss: float | Fraction, interval: float | Fraction, unit: Fraction = Fraction(1)
) -> Weights:
    """Weights for one component (1/s^2 and 1/s) and one length of interval (s); rates count in units of `unit`, 1/s."""
    places, points, lagrange, basis = _quadrature()
    length, scale, lost = float(interval), float(unit), float(loss)
    roots = np.float64(square - loss * loss / 4), np.float64(loss / 2)
    own, slope = _kernel(*roots, length * places)
    inside = np.stack(_kernel(*roots, length * points))  # (2, place, quadrature)
    inner = (inside[:, :, None, :] @ basis)[:, :, 0].transpose(0, 2, 1) * length  # (2, node, place)
    inner *= np.array([scale * scale, scale])[:, None, None]
    flow = np.stack([slope + lost * own, scale * own, -float(square / unit) * own, slope])
    with _ALONE, ctx.workprec(_BITS):
        balls = [arb(fmpq(*each.as_integer_ratio())) for each in (square, loss, interval, unit)]
        exact = _propagator(*balls)
        long_square, long_loss, long, long_unit = (_long(each) for each in balls)
    final = _kernel(long_square - long_loss * long_loss / 4, long_loss / 2, long * lagrange[0])
    units = long_unit * long_unit, long_unit
    last = np.stack([each @ lagrange[1] * size for each, size in zip(final, units, strict=True)]) * long
    leading = last.astype(np.float64)
    end = np.concatenate([leading, (last - leading).astype(np.float64)])
    worth = length * min(length / 2, 1.0 / max(math.sqrt(abs(float(square))), 1e-300))
    return Weights(flow.ravel(), inner.ravel(), end.ravel(), np.array(exact), worth)


@functools.cache
def _quadrature() -> tuple[Floats, Floats, tuple[Longs, Longs], Floats]:
    """Nodes in intervals; times left from the quadrature points before each; the same for the end, in long doubles,
    with weight times l_k there; weight times l_k at all nodes, (node, point, k)."""
    nodes = np.longdouble(0.5) + gauss_nodes().astype(np.longdouble) / (2 * FINE)
    places = np.append(nodes, np.longdouble(1.0))
    with _ALONE, ctx.workprec(_BITS):  # the Gauss-Legendre rule on [0, 1]
        rule = [arb.legendre_p_root(_QUADRATURE, k, weight=True) for k in reversed(range(_QUADRATURE))]
        abscissa, share = (np.array([_long(each / 2) for each in column]) for column in zip(*rule, strict=True))
    points = places[:, None] * (np.longdouble(0.5) + abscissa)
    distance = points[:, :, None] - nodes
    rest = [np.delete(distance, k, axis=2) / (nodes[k] - np.delete(nodes, k)) for k in range(NODES)]
    basis = np.stack([each.prod(axis=2) for each in rest], axis=2) * (places[:, None] * share)[:, :, None]
    left = places[:, None] - points
    inside, times, weighted = (each[:NODES].astype(np.float64) for each in (places, left, basis))
    return inside, times, (left[NODES], basis[NODES]), weighted


def _long(ball: Any) -> Any:
    """The number as a long double."""
    leading = float(ball)
    return np.longdouble(leading) + np.longdouble(float(ball - leading))


def _kernel(own: Any, half: Any, time: Any) -> tuple[Any, Any]:
    """K and K' at times of any shape; `own` is the damped frequency squared, of either sign; `half` half the loss."""
    root = np.sqrt(abs(own))
    turn = root * time
    sine, cosine = (np.sin(turn), np.cos(turn)) if own >= 0.0 else (np.sinh(turn), np.cosh(turn))
    sine = np.where(turn < 1e-5, time * (1 - own * time * time / 6), sine / (root if root > 0 else 1))
    if half:
        fade = np.exp(-half * time)
        sine, cosine = sine * fade, cosine * fade
    return sine, cosine - half * sine


def _propagator(square: Any, loss: Any, interval: Any, unit: Any) -> list[float]:
    """Entries over one interval, right to 2^-106: of each its leading double in two halves and whole, and the rest."""
    half = loss / 2
    turn = acb(square - half * half).sqrt() * interval
    fade = (-half * interval).exp()
    own = fade * interval * turn.sinc().real
    slope = fade * turn.cos().real - half * own
    parts = []
    for entry in (slope + loss * own, unit * own, -square / unit * own, slope):
        leading = float(entry)
        head = leading * _SPLIT - (leading * _SPLIT - leading)
        parts += [head, leading - head, leading, float(entry - leading)]
    return parts


@functools.cache
def gauss_nodes() -> Integers:
    """Gauss-Legendre nodes in units of 1/FINE, on (-FINE, FINE), increasing and even about zero."""
    after = np.rint(np.polynomial.legendre.leggauss(NODES)[0][NODES // 2 :] * FINE).astype(np.int64)
    return np.concatenate([-after[::-1], after])


@functools.cache
def barycentric() -> tuple[Floats, Floats]:
    """Start, nodes and end of an interval on [-1, 1], (POINTS,), and their barycentric shares."""
    points = np.concatenate([[-1.0], gauss_nodes() / FINE, [1.0]])
    apart = points[:, None] - points
    np.fill_diagonal(apart, 1.0)
    return points, 1.0 / np.prod(2.0 * apart, axis=1)


def interpolation(place: Floats) -> Floats:
    """Rows (moments, POINTS) that give y at places (moments,) in an interval, 0 to 1, from its start, nodes and end."""
    points, share = barycentric()
    distance = (2.0 * np.asarray(place) - 1.0)[:, None] - points
    exact = distance == 0.0
    distance[exact] = 1.0
    rows = np.where(exact.any(axis=1, keepdims=True), exact, share / distance)
    rows /= rows.sum(axis=1, keepdims=True)
    return rows


@functools.cache
def _projection() -> Floats:
    """(degree, node): Legendre coefficients of a polynomial from its values."""
    values = np.polynomial.legendre.legvander(gauss_nodes() / FINE, NODES - 1)
    return np.asarray(np.linalg.inv(values), dtype=np.float64)


def legendre_tail() -> Floats:
    """Rows that give the last four Legendre coefficients of r from its nodes, flat (4 * NODES,)."""
    return _projection()[-4:].ravel()


@functools.cache
def continuation() -> Floats:
    """(node, node): r at the nodes of the next interval, from its polynomial in this one; good to five digits."""
    beyond = np.polynomial.legendre.legvander(gauss_nodes() / FINE + 2.0, NODES - 1)
    return np.asarray(beyond @ _projection())


@kernel
def turned(angle: Any) -> Any:
    """sin, cos, `angle - sin` and `1 - cos` of sixteen angles, without cancellation at small angles."""
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
def couple(
    matrix: Floats, place: int, known: Floats, now: int, c: int, base: Floats, begin: int, out: Floats
) -> None:  # fmt: skip
    """Values at the nodes: `base` from `begin` on, and weights from `place` on times the remainder."""
    half = NODES // 2
    first, second = load(base, (c, begin)), 0.0  # two chains of additions, which run side by side
    for k in range(half):
        first += load(matrix, (c, place + k * NODES)) * known[now, c, k]
        second += load(matrix, (c, place + (k + half) * NODES)) * known[now, c, k + half]
    store(out, (c, 0), first + second)


@kernel
def change(known: Floats, c: int) -> float:
    """Square of what a turn changed of the remainder."""
    moved = load(known, (1, c, 0)) - load(known, (0, c, 0))
    return total(moved * moved)


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
    return total(load(rows, (c, place)) * load(known, (now, which, 0)))


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
