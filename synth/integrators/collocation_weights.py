r"""Weights of exponential collocation for coupled oscillators, with velocities.

Over one interval of length h each component obeys, with its linear part taken out,

    y'' + loss y' + square y = r(t),      r known at the Gauss nodes t_k,    r(t) = sum r_k l_k(t)   (Lagrange)
    y(t)  = (K' + loss K)(t) y(0) + K(t) y'(0)  + sum_k r_k integral_0^t K(t - s)  l_k(s) ds
    y'(t) = -square K(t) y(0)     + K'(t) y'(0) + sum_k r_k integral_0^t K'(t - s) l_k(s) ds

with K'' + loss K' + square K = 0, K(0) = 0, K'(0) = 1. Integrals are Gauss sums in long doubles. The propagator over
a whole interval comes from whole-number arithmetic: its rounded entries alone would cost 1e-12 in an hour; it and the
weights of the end are kept as sums of two doubles.
"""

from __future__ import annotations

import functools
import math
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from synth.kernels.collocation_remainder import NODES
from synth.phase import Floats
from synth.propagators.picard_nodes import FINE, gauss_nodes
from synth.propagators.picard_weights import ONE, fixed, parts, series

Longs = NDArray[Any]  # long doubles, which type checkers cannot tell from doubles

_QUADRATURE = 28  # exact for r times the 40th power of time: K over 5 rad to 1e-20


class Weights(NamedTuple):
    """What an interval needs, for one component."""

    flow: Floats
    """(4 * NODES,) free motion at the nodes: position by start position, position by start rate, rate by start position,
    rate by start rate."""
    inner: Floats
    """(2 * NODES * NODES,) position, then rate, at the nodes (fast index) for the remainder at the nodes (slow index)."""
    end: Floats
    """(4 * NODES,) position and rate at the end for the remainder at the nodes; then what rounding left of them."""
    propagator: Floats
    """(16,) entries (position, position), (position, rate), (rate, position), (rate, rate), each as head and tail of its
    leading double, for exact products, that double, and what is left."""
    reach: float
    """What a change of r over the interval is worth in the position, s^2."""


class Level(NamedTuple):
    """One length of intervals, with the weights of all components, (components, ...) each as in `Weights`."""

    interval: float
    """s."""
    lag: int
    """Intervals after which the motion repeats itself, as far as it does; whole half swings."""
    mirror: Floats
    """(components,) what that many do to the remainder, 1 or -1."""
    flow: Floats
    inner: Floats
    end: Floats
    propagator: Floats
    reach: Floats


@functools.lru_cache(maxsize=1024)
def weights(square: float, loss: float, interval: float) -> Weights:
    """Weights for one component and one length of interval.

    Parameters
    ----------
    square, loss : float
        Of the linear part, 1/s^2 and 1/s; taken as the doubles they are.
    interval : float
        h in s, taken as the double it is.
    """
    places, points, lagrange, basis = _quadrature()
    roots = np.float64(square - 0.25 * loss * loss), np.float64(0.5 * loss)
    own, slope = _kernel(*roots, interval * places)
    inside = np.stack(_kernel(*roots, interval * points))  # (2, place, quadrature)
    inner = (inside[:, :, None, :] @ basis)[:, :, 0].transpose(0, 2, 1) * interval  # (2, node, place)
    flow = np.stack([slope + loss * own, own, -square * own, slope])
    half = np.longdouble(loss) / 2
    final = _kernel(np.longdouble(square) - half * half, half, np.longdouble(interval) * lagrange[0])
    last = np.stack([each @ lagrange[1] for each in final]) * np.longdouble(interval)
    leading = last.astype(np.float64)
    end = np.concatenate([leading, (last - leading).astype(np.float64)])
    exact = _propagator(Fraction(square), Fraction(loss), Fraction(interval))
    worth = interval * min(interval / 2, 1.0 / max(math.sqrt(abs(square)), 1e-300))
    return Weights(flow.ravel(), inner.ravel(), end.ravel(), np.array(exact), worth)


def aligned(values: Floats) -> Floats:
    """A contiguous copy that begins at a cache line: loads of eight doubles then touch one line each."""
    room = np.empty(values.size + 8)
    skip = -(room.ctypes.data // 8) % 8
    result = room[skip : skip + values.size].reshape(values.shape)
    result[...] = values
    return result


@functools.cache
def _quadrature() -> tuple[Floats, Floats, tuple[Longs, Longs], Floats]:
    """Nodes in intervals; times left from the quadrature points before each; the same for the end, in long doubles, with
    weight times l_k there; weight times l_k at all nodes, (node, point, k)."""
    nodes = np.longdouble(0.5) + gauss_nodes().astype(np.longdouble) / (2 * FINE)
    places = np.append(nodes, np.longdouble(1.0))
    abscissa, share = _gauss()
    points = places[:, None] * abscissa
    apart = nodes[:, None] - nodes
    np.fill_diagonal(apart, 1.0)
    scale = 1.0 / np.prod(apart, axis=1)
    distance = points[:, :, None] - nodes
    basis = np.empty(distance.shape, dtype=np.longdouble)
    for k in range(NODES):
        others = np.delete(distance, k, axis=2)
        basis[:, :, k] = np.prod(others, axis=2) * scale[k]
    basis *= (places[:, None] * share)[:, :, None]
    left = places[:, None] - points
    doubles = (each[:NODES].astype(np.float64) for each in (places, left, basis))
    first, second, third = doubles
    return first, second, (left[NODES], basis[NODES]), third


def _gauss() -> tuple[Longs, Longs]:
    """Gauss-Legendre rule on [0, 1] in long doubles: Newton steps from the rule in doubles."""
    x: Longs = np.polynomial.legendre.leggauss(_QUADRATURE)[0].astype(np.longdouble)
    for _ in range(3):
        before, value = np.ones_like(x), x.copy()
        for m in range(2, _QUADRATURE + 1):
            before, value = value, ((2 * m - 1) * x * value - (m - 1) * before) / m
        slope = _QUADRATURE * (x * value - before) / (x * x - 1)
        x = x - value / slope
    share = 1 / ((1 - x * x) * slope * slope)
    return (1 + x) / 2, share


def _kernel(own: Any, half: Any, time: Any) -> tuple[Any, Any]:
    """K and K' at times of any shape, in the precision of the arguments.

    `own` is the square of the damped frequency, of either sign; `half` is half the loss.
    """
    root = np.sqrt(abs(own))
    turn = root * time
    sine, cosine = (np.sin(turn), np.cos(turn)) if own >= 0.0 else (np.sinh(turn), np.cosh(turn))
    sine = np.where(turn < 1e-5, time * (1 - own * time * time / 6), sine / (root if root > 0 else 1))
    if half:
        fade = np.exp(-half * time)
        sine, cosine = sine * fade, cosine * fade
    return sine, cosine - half * sine


def _propagator(square: Fraction, loss: Fraction, interval: Fraction) -> list[float]:
    """Entries over one interval, right to 2^-106."""
    total, slope = series(ONE, fixed(square * interval**2), fixed(loss * interval))
    own, rise = Fraction(total, ONE) * interval, Fraction(slope, ONE)
    return [part for entry in (rise + loss * own, own, -square * own, rise) for part in parts(fixed(entry))]
