"""Exponential Picard collocation of pendulums, interval by interval.

The remainder is all that a pendulum has beyond y'' + 2 gamma y' + n^2 y = n^2 r, theta = steady + y:

    r = (theta - sin theta) - zeta sin theta + u (1 - cos theta) - drive

    r = -zeta theta - drive                                        where the law is linear

In every interval the angle at the nodes and the remainder there are computed from each other in turn until they agree.
Inner loops have constant lengths and walk forwards through memory, so that they are unrolled and vectorised; nothing is
allocated in them. Kernels of the remainder are odd in (theta, u, drive) to the last bit.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from synth.kernels.collocation import NODES, POINTS, advance
from synth.kernels.compiled import kernel, summing_kernel
from synth.phase import Floats

MOST_TURNS = 20
"""Picard iterations after which an interval counts as too long."""

HOPELESS = 1e20
"""Square of a change of r, rad, from which iteration runs away."""

_ROUNDER = 6755399441055744.0  # 1.5 * 2^52: adding and subtracting it rounds to a whole number
_HALF_CIRCLE = (3.141592653589793116, 1.2246467991473532072e-16)


class Forcing(NamedTuple):
    """What acts in consecutive intervals."""

    steady: Floats
    """(pendulums, intervals, NODES) steady linear answer at the nodes, rad."""
    vertical: Floats
    """(intervals, NODES) zeta,"""
    horizontal: Floats
    """u,"""
    drive: Floats
    """and the part of u that `steady` does not answer."""
    impulses: Floats
    """(3, pendulums, intervals) at the end of each: what stays of the state, what is added to y and to y'/n."""


class Law(NamedTuple):
    """What pendulums are in intervals of one length: `collocation_weights.Weights`, (pendulums, ...)."""

    flow: Floats
    inner: Floats
    """(pendulums, NODES * NODES) of the angle alone."""
    guess: Floats
    """What inner makes of the remainder of the interval before, continued."""
    end: Floats
    propagator: Floats
    tail: Floats
    """(1, 4 * NODES) rows of the Legendre tail."""
    linear: bool


@kernel
def march(
    state: Floats, remainder: Floats, forcing: Forcing, law: Law, reach: Floats, floor: Floats, stop: float,
    points: Floats, report: Floats,
) -> int:  # fmt: skip
    """Carry pendulums through consecutive intervals.

    Parameters
    ----------
    state : (pendulums, 4)
        y and y'/n at the start, each as leading double and rest; at the end on return.
    remainder : (pendulums, NODES)
        r in the interval before, zero if unknown; in the last interval on return.
    forcing : Forcing
    law : Law
    reach, floor : (pendulums,)
        Amplitude of y at the start of an interval from which theta might exceed 0.5 rad in it: the general remainder
        is then used. Square of an angle below which agreement is not asked for in relation to y alone.
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
    flow, inner, guess, end, propagator, tail, linear = law
    steady, vertical, horizontal, drive, impulses = forcing
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
                    step = _change(known, p)
                    if step > HOPELESS:
                        return i
                    agree &= not step > limit
            for p in range(pendulums):
                _couple(inner, known, now, p, base, theta)
        unchecked = max(turns - 1, 1)
        for p in range(pendulums):
            report[p, 3] = max(report[p, 3], state[p, 0] * state[p, 0] + state[p, 2] * state[p, 2])
            report[p, 4] += turns
            _note(tail, known, now, p, report)
            points[p, i, 0] = state[p, 0]
        advance(state, propagator, end, known, now)
        for p in range(pendulums):
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
def _at(table: Any, row: int, points: Any, p: int, i: int) -> float:
    total = 0.0
    for j in range(POINTS):
        total += table[row, j] * points[p, i, j]
    return total


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
        first += tail[0, j] * value
        second += tail[0, NODES + j] * value
        third += tail[0, 2 * NODES + j] * value
        fourth += tail[0, 3 * NODES + j] * value
        size += value * value
    report[p, 0] = max(report[p, 0], third * third + fourth * fourth)
    report[p, 1] = max(report[p, 1], first * first + second * second)
    report[p, 2] += size


@summing_kernel
def remainder_small(
    theta: Any, vertical: Any, horizontal: Any, drive: Any, p: int, i: int, known: Any, now: int
) -> None:
    """Taylor polynomials, for |theta| < 0.5: short by less than 5e-17 of theta."""
    for j in range(NODES):
        x = theta[p, j]
        s = x * x
        short = 1 / 39916800 - s * (1 / 6227020800)
        short = s * (1 / 6 + s * (-1 / 120 + s * (1 / 5040 + s * (-1 / 362880 + s * short)))) * x
        rise = 1 / 3628800 + s * (-1 / 479001600 + s * (1 / 87178291200))
        rise = s * (0.5 + s * (-1 / 24 + s * (1 / 720 + s * (-1 / 40320 + s * rise))))
        known[now, p, j] = short - vertical[i, j] * (x - short) + horizontal[i, j] * rise - drive[i, j]


@summing_kernel
def remainder_linear(
    theta: Any, vertical: Any, horizontal: Any, drive: Any, p: int, i: int, known: Any, now: int
) -> None:
    """The linear law, which the support's horizontal acceleration does not change."""
    for j in range(NODES):
        known[now, p, j] = -vertical[i, j] * theta[p, j] - drive[i, j]


@kernel
def remainder_general(
    theta: Any, vertical: Any, horizontal: Any, drive: Any, p: int, i: int, known: Any, now: int
) -> None:
    """Any angle: sine and cosine of half the angle, itself reduced to a quarter turn either way."""
    for j in range(NODES):
        x = theta[p, j]
        half_turns = (x * (1 / np.pi) + _ROUNDER) - _ROUNDER
        rest = (x - half_turns * _HALF_CIRCLE[0]) - half_turns * _HALF_CIRCLE[1]
        pairs = (half_turns * 0.5 + _ROUNDER) - _ROUNDER
        sign = 1.0 - 2.0 * abs(half_turns - 2.0 * pairs)
        h = 0.5 * rest
        s = h * h
        sine = 1 / 6227020800 + s * (-1 / 1307674368000 + s * (1 / 355687428096000))
        sine = -1 / 6 + s * (1 / 120 + s * (-1 / 5040 + s * (1 / 362880 + s * (-1 / 39916800 + s * sine))))
        sine = h + h * (s * sine)
        cosine = 1 / 479001600 + s * (-1 / 87178291200 + s * (1 / 20922789888000))
        cosine = -0.5 + s * (1 / 24 + s * (-1 / 720 + s * (1 / 40320 + s * (-1 / 3628800 + s * cosine))))
        cosine = 1.0 + s * cosine
        full = sign * (2.0 * sine * cosine)
        rise = 1.0 - sign * (1.0 - 2.0 * sine * sine)
        known[now, p, j] = (x - full) - vertical[i, j] * full + horizontal[i, j] * rise - drive[i, j]
