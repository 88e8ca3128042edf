r"""Weights of exponential collocation, in whole-number arithmetic of 320 bits.

Over one interval of length h (time in units of h, dots likewise, n and gamma as n h and gamma h)

    y'' + 2 gamma y' + n^2 y = n^2 r(x),   r known at nodes x_k,   r(x) = sum r_k l_k(x)   (Lagrange)
    y(x) = (K' + 2 gamma K)(x) y(0) + K(x) y'(0) + n^2 sum_k r_k  integral_0^x K(x - s) l_k(s) ds

with K'' + 2 gamma K' + n^2 K = 0, K(0) = 0, K'(0) = 1. The moments M_m = integral K(x - s) s^m ds and
D_m = integral K'(x - s) s^m ds follow from integration by parts,

    D_0 = K(x),  D_m = m M_(m-1),     n^2 M_m = x^m - [m = 0] K'(x) - m D_(m-1) - 2 gamma D_m

which loses m!/(n h)^m: hence the many bits. Doubles would do for neither the moments nor the propagator, whose
rounded entries alone cost 1e-12 in an hour; its entries are kept as a sum of two doubles.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from synth.kernels.collocation_remainder import NODES
from synth.phase import Floats
from synth.propagators.picard_nodes import FINE, continuation, gauss_nodes

BITS = 320
ONE = 1 << BITS
"""1 in fixed point."""
_NOTHING = 1 << 8  # rounding of what follows


@dataclass(frozen=True)
class Weights:
    """What an interval needs, for one pendulum; time in intervals, speed as theta'/n.

    Attributes
    ----------
    flow : (2 * NODES,) float64
        Free motion at the nodes: that of the start angle, then that of the start speed.
    inner : (NODES * NODES,) float64
        Angle at the nodes (fast index) for the remainder at the nodes (slow index).
    guess : (NODES * NODES,) float64
        The same for the remainder of the interval before, continued.
    end : (4 * NODES,) float64
        Angle, then speed, at the end for the remainder at the nodes; then what rounding left of them, for the same
        error in every interval would add up to a drift of the energy.
    propagator : (16,) float64
        Entries (angle, angle), (angle, speed), (speed, angle), (speed, speed), each as head and tail of its
        leading double, for exact products, the leading double itself, and what is left.
    """

    flow: Floats
    inner: Floats
    guess: Floats
    end: Floats
    propagator: Floats


@functools.lru_cache(maxsize=64)
def weights(frequency: float, damping_rate: float, interval: Fraction) -> Weights:
    """Weights for one pendulum and one length of interval.

    Parameters
    ----------
    frequency, damping_rate
        n > 0 in rad/s and gamma in 1/s, of either sign; taken as the doubles they are.
    interval
        h in s, exact.
    """
    turn = fixed(Fraction(frequency) * interval)
    loss = fixed(2 * Fraction(damping_rate) * interval)
    square = turn * turn >> BITS
    places = [(FINE + int(node)) * (ONE // (2 * FINE)) for node in gauss_nodes()] + [ONE]
    kernel, slope = zip(*(series(place, square, loss) for place in places), strict=True)
    each_place = zip(places, kernel, slope, strict=True)
    moments, rates = zip(*(_moments(*each, square, loss) for each in each_place), strict=True)
    lagrange = np.array(_lagrange(), dtype=object)  # (power, node)
    angle = (np.array(moments, dtype=object) @ lagrange >> BITS) * square >> BITS
    speed = (np.array(rates[-1], dtype=object) @ lagrange >> BITS) * turn >> BITS
    inner = np.array([[_float(value) for value in row] for row in angle])
    last = [_pair(value) for value in (*angle[-1], *speed)]
    flow = [[_float(rise + (loss * each >> BITS)) for each, rise in zip(kernel, slope, strict=True)]]
    flow.append([_float(turn * each >> BITS) for each in kernel])
    cross = turn * kernel[-1] >> BITS
    entries = (slope[-1] + (loss * kernel[-1] >> BITS), cross, -cross, slope[-1])
    return Weights(
        np.array([each[:NODES] for each in flow]).ravel(),
        np.ascontiguousarray(inner[:NODES].T).ravel(),
        np.ascontiguousarray((inner[:NODES] @ continuation()).T).ravel(),
        np.array(last).T.ravel(),
        np.concatenate([parts(entry) for entry in entries]),
    )


@functools.cache
def _lagrange() -> list[list[int]]:
    """(power, node): coefficients of the Lagrange polynomials on [0, 1], fixed point."""
    unit = 2 * FINE  # nodes are whole numbers of 1/unit: exact until the one division
    nodes = [FINE + int(node) for node in gauss_nodes()]
    columns = []
    for node in nodes:
        polynomial = [1]
        for other in nodes:
            if other != node:
                pairs = zip([0, *polynomial], [*polynomial, 0], strict=True)
                polynomial = [low - other * high for low, high in pairs]
        scale = math.prod(node - other for other in nodes if other != node)
        columns.append([(each * unit**power << BITS) // scale for power, each in enumerate(polynomial)])
    return [list(row) for row in zip(*columns, strict=True)]


def series(place: int, square: int, loss: int) -> tuple[int, int]:
    """K(x) and K'(x) by their power series: the coefficients follow from the equation of motion; all in fixed point."""
    before, term = 0, place  # x^i/i! times the i-th derivative of K at zero, i = 0 and 1
    total, slope, order = term, ONE, 1
    while abs(term) + abs(before) > _NOTHING:
        # K^(i+2) = -2 gamma K^(i+1) - n^2 K^(i)
        steeper = -(loss * term >> BITS) - ((square * before >> BITS) * place // order >> BITS)
        slope += steeper
        order += 1
        before, term = term, (steeper * place >> BITS) // order
        total += term
    return total, slope


def _moments(place: int, kernel: int, slope: int, square: int, loss: int) -> tuple[list[int], list[int]]:
    moments: list[int] = []
    rates: list[int] = []
    power = ONE
    for m in range(NODES):
        rates.append(m * moments[-1] if m else kernel)
        rest = power - (m * rates[-2] if m else slope) - (loss * rates[-1] >> BITS)
        moments.append((rest << BITS) // square)
        power = power * place >> BITS
    return moments, rates


def parts(entry: int) -> list[float]:
    """Head and tail (26 bits each) of the leading double, itself, and what is left."""
    leading, rest = _pair(entry)
    mantissa, exponent = math.frexp(leading)
    head = math.ldexp(math.floor(math.ldexp(mantissa, 26) + 0.5), exponent - 26)
    return [head, leading - head, leading, rest]


def _pair(value: int) -> tuple[float, float]:
    """A fixed-point number as leading double and rest."""
    leading = _float(value)
    return leading, _float(value - fixed(Fraction(leading)))


def fixed(value: Fraction) -> int:
    """The number in fixed point."""
    return (value.numerator << BITS) // value.denominator


def _float(value: int) -> float:
    return value / ONE
