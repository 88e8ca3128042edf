"""Exponential Picard collocation of pendulums, interval by interval.

The remainder r = (theta - sin theta) - zeta sin theta + u (1 - cos theta) - drive is all that a pendulum has
beyond y'' + 2 gamma y' + n^2 y = n^2 r, theta = steady + y. In every interval the angle at the nodes and the
remainder there are computed from each other in turn until they agree. Inner loops have constant lengths and
walk forwards through memory, so that they are unrolled and vectorised; nothing is allocated in them.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from synth.kernels.collocation_remainder import NODES, remainder_general, remainder_linear, remainder_small
from synth.kernels.compiled import kernel, summing_kernel

POINTS = NODES + 2
"""Start, nodes and end of an interval."""

MOST_TURNS = 20
"""Picard iterations after which an interval counts as too long."""

HOPELESS = 1e20
"""Square of a change of r, rad, from which iteration runs away."""

_SPLIT = 134217729.0  # 2^27 + 1


@kernel
def march(
    state: Any,
    remainder: Any,
    steady: Any,
    vertical: Any,
    horizontal: Any,
    drive: Any,
    impulses: Any,
    linear: bool,
    reach: Any,
    floor: Any,
    weights: Any,
    stop: float,
    points: Any,
    report: Any,
) -> int:
    """Carry pendulums through consecutive intervals.

    Parameters
    ----------
    state : (pendulums, 4)
        y and y'/n at the start, each as leading double and rest; at the end on return.
    remainder : (pendulums, NODES)
        r in the interval before, zero if unknown; in the last interval on return.
    steady : (pendulums, intervals, NODES)
        Steady linear answer at the nodes, rad.
    vertical, horizontal, drive : (intervals, NODES)
        zeta, u, and the part of u that `steady` does not answer.
    impulses : (3, pendulums, intervals)
        At the end of each interval: what stays of the state, what is added to y and to y'/n.
    linear : bool
        Whether the law is linear.
    reach, floor : (pendulums,)
        Amplitude of y at the start of an interval from which theta might exceed 0.5 rad in it: the general remainder
        is then used. Square of an angle below which agreement is not asked for in relation to y alone.
    weights : tuple of (pendulums, ...) arrays
        Fields of `picard_weights.Weights`, then the rows of the Legendre tail (4 * NODES,).
    stop : float
        Change of r, relative to the angle, from which an iteration is the last.
    points : (pendulums, intervals, POINTS)
        Receives y at start, nodes and end of every interval.
    report : (pendulums, 5)
        Squares: largest last and last but one pair of Legendre coefficients of r, sum of r, largest amplitude of y;
        then the number of iterations. Raised, never reset.

    Returns
    -------
    int
        Number of intervals done; fewer than asked for if iteration does not converge.
    """
    flow, inner, guess, end, propagator, tail = weights
    pendulums, intervals = steady.shape[0], steady.shape[1]
    base, theta = np.empty((pendulums, NODES)), np.empty((pendulums, NODES))
    known = np.empty((2, pendulums, NODES))  # r of this turn and of the turn before, in either order
    known[0] = remainder
    now = 0
    unchecked = 0
    for i in range(intervals):
        for p in range(pendulums):
            _free(flow, steady, p, i, state[p, 0], state[p, 2], base)
            _couple(guess, known, now, p, base, theta)
        turns = 0
        agree = False
        while not agree:
            if turns == MOST_TURNS:
                return i
            turns += 1
            now = 1 - now
            for p in range(pendulums):
                if linear:
                    remainder_linear(theta, vertical, horizontal, drive, p, i, known, now)
                elif state[p, 0] * state[p, 0] + state[p, 2] * state[p, 2] < reach[p] * reach[p]:
                    remainder_small(theta, vertical, horizontal, drive, p, i, known, now)
                else:
                    remainder_general(theta, vertical, horizontal, drive, p, i, known, now)
            if turns >= unchecked or turns == 2:  # the second tells whether iteration runs away
                agree = True
                for p in range(pendulums):
                    limit = stop * stop * max(report[p, 3], floor[p])
                    change = _change(known, p)
                    if change > HOPELESS:
                        return i
                    agree &= not change > limit
            for p in range(pendulums):
                _couple(inner, known, now, p, base, theta)
        unchecked = max(turns - 1, 1)
        for p in range(pendulums):
            report[p, 3] = max(report[p, 3], state[p, 0] * state[p, 0] + state[p, 2] * state[p, 2])
            report[p, 4] += turns
            _note(tail, known, now, p, report)
            points[p, i, 0] = state[p, 0]
            _advance(state, propagator, end, known, now, p)
            for j in range(NODES):
                points[p, i, j + 1] = theta[p, j] - steady[p, i, j]
            points[p, i, POINTS - 1] = state[p, 0]
            for k in range(2):
                state[p, 2 * k] = impulses[0, p, i] * state[p, 2 * k] + impulses[1 + k, p, i]
                state[p, 2 * k + 1] *= impulses[0, p, i]
    remainder[:] = known[now]
    return int(intervals)


@kernel
def read(points: Any, begin: Any, row: Any, table: Any, result: Any) -> None:
    """Add y at readings to the result (pendulums, readings).

    Parameters
    ----------
    points : (pendulums, intervals, POINTS)
        As `march` leaves them.
    begin : (intervals + 1,)
        First reading of each interval.
    row : (readings,)
        Which row of the table tells where in its interval a reading lies.
    table : (rows, POINTS)
        Weights of interpolation.
    """
    for p in range(points.shape[0]):
        for i in range(points.shape[1]):
            for k in range(begin[i], begin[i + 1]):
                result[p, k] += _at(table, row[k], points, p, i)


@summing_kernel
def _free(flow: Any, steady: Any, p: int, i: int, angle: float, speed: float, out: Any) -> None:
    for j in range(NODES):
        out[p, j] = steady[p, i, j] + (flow[p, j] * angle + flow[p, NODES + j] * speed)


@summing_kernel
def _couple(matrix: Any, known: Any, now: int, p: int, base: Any, out: Any) -> None:
    for j in range(NODES):
        first, second = base[p, j], 0.0  # two chains of additions run side by side
        for k in range(NODES // 2):
            first += matrix[p, k * NODES + j] * known[now, p, k]
            second += matrix[p, (k + NODES // 2) * NODES + j] * known[now, p, k + NODES // 2]
        out[p, j] = first + second


@summing_kernel
def _change(known: Any, p: int) -> float:
    total = 0.0
    for j in range(NODES):
        step = known[1, p, j] - known[0, p, j]
        total += step * step
    return total


@summing_kernel
def _note(tail: Any, known: Any, now: int, p: int, report: Any) -> None:
    """Raise the report by the Legendre tail and the size of the remainder."""
    first, second, third, fourth, size = 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(NODES):
        value = known[now, p, j]
        first += tail[j] * value
        second += tail[NODES + j] * value
        third += tail[2 * NODES + j] * value
        fourth += tail[3 * NODES + j] * value
        size += value * value
    report[p, 0] = max(report[p, 0], third * third + fourth * fourth)
    report[p, 1] = max(report[p, 1], first * first + second * second)
    report[p, 2] += size


@summing_kernel
def _kick(end: Any, first: int, known: Any, now: int, p: int) -> float:
    total = 0.0
    for j in range(NODES):
        total += end[p, first + j] * known[now, p, j]
    return total


@kernel
def _advance(state: Any, propagator: Any, end: Any, known: Any, now: int, p: int) -> None:
    """To the end of the interval."""
    angle, angle_rest, speed, speed_rest = state[p, 0], state[p, 1], state[p, 2], state[p, 3]
    for k in range(2):
        kick = _kick(end, k * NODES, known, now, p)
        kick_rest = _kick(end, (k + 2) * NODES, known, now, p)
        leading, rest = moved(propagator, p, 8 * k, angle, angle_rest, speed, speed_rest, kick, kick_rest)
        state[p, 2 * k], state[p, 2 * k + 1] = leading, rest


@kernel
def moved(
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


@summing_kernel
def _at(table: Any, row: int, points: Any, p: int, i: int) -> float:
    total = 0.0
    for j in range(POINTS):
        total += table[row, j] * points[p, i, j]
    return total
