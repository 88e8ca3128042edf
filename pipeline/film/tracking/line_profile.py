"""Exposure that a moving spot leaves on one row of the film.

The spot is a Gaussian of the same width along and across the film, and film darkens by how long it is lit. So a row
gets from each stretch of the trace near it the cut through a Gaussian,

    E(u) = int ds open(s) g(r - r(s)) exp(-(u - x(s))^2 / 2 spot^2),   g of area 1 and width `spot`,

which is 1 on the axis of a line at rest, 1/sqrt(1 + slope^2) on that of a straight line, and exact also where the
trace turns within the spot, near its other stroke, and beside a gap of the shutter. Steps are fine enough (1.25
spots along the trace) that the sum of Gaussians is as good as the integral: 1e-5.
"""

from __future__ import annotations

import math

from pipeline.arrays import Floats
from synth.kernels.compiled import kernel

REACH = 4.0  # spots: what lies farther leaves less than 3e-4
FINENESS = 1.25
MOST_NODES = 1200


@kernel
def nodes_of(state: Floats, spot: float, shear: float, gaps: Floats, first_gap: int, row: float, nodes: Floats) -> int:
    """Where the spot was while it lit the row: columns and weights of `nodes` (2, n); returns their number.

    Parameters
    ----------
    state : (6,) array
        Of the trace at this row (see `motion`).
    gaps : (n, 2) array
        First and last row of the shutter's gaps along this trace, rising.
    first_gap : int
        First of them that may matter here.
    row : float
        Centre line of this row, px.
    nodes : (2, n) array
        Overwritten.
    """
    rate, bend = state[1] - state[5] * state[4], state[2] - state[5] * state[5] * state[3]
    swing = math.sqrt(state[3] * state[3] + state[4] * state[4])
    steepest = abs(state[1]) + 3.0 * spot * abs(state[2]) + abs(state[5]) * swing
    steepest = min(steepest, abs(rate) + 3.0 * spot * abs(bend) + spot * spot * abs(state[5]) ** 3 * swing)
    step = FINENESS * spot / math.sqrt(1.0 + steepest * steepest)
    length = REACH * spot * (1.0 + abs(shear) * steepest)
    half = min(int(length / step) + 1, (MOST_NODES - 1) // 2)
    step = length / half
    c, s = math.cos(state[5] * step), math.sin(state[5] * step)
    angle = -state[5] * length
    p = state[3] * math.cos(angle) - state[4] * math.sin(angle)
    q = state[3] * math.sin(angle) + state[4] * math.cos(angle)
    here = state[0] + state[3]
    scale = 0.5 / (spot * spot)
    norm = step / (math.sqrt(2.0 * math.pi) * spot)
    count = 0
    before = 0.0
    for i in range(2 * half + 1):
        along = -length + i * step
        column = state[0] + along * (state[1] + 0.5 * along * state[2]) + p
        p, q = p * c - q * s, p * s + q * c
        away = along + shear * (column - here)
        weight = norm * math.exp(-away * away * scale)
        span = step if i == 0 else away - before
        before = away
        g = first_gap
        while g < gaps.shape[0] and gaps[g, 0] < row + away + span:
            closed = min(gaps[g, 1], row + away + 0.5 * span) - max(gaps[g, 0], row + away - 0.5 * span)
            if closed > 0.0:
                weight *= max(0.0, 1.0 - closed / span)
            g += 1
        nodes[0, count] = column
        nodes[1, count] = weight
        count += 1
    return count


@kernel
def profile(nodes: Floats, count: int, shift: float, spot: float, first: int, out: Floats) -> None:
    """Add up what the nodes leave on pixels `first` on: exposure and its derivative by the shift, out (2, n).

    Neighbouring values of a Gaussian differ by a factor that itself changes by a constant factor: two exponentials a
    node.
    """
    scale = 0.5 / (spot * spot)
    reach = REACH * spot
    bend = math.exp(-2.0 * scale)
    size = out.shape[1]
    for i in range(size):
        out[0, i] = 0.0
        out[1, i] = 0.0
    for n in range(count):
        column = nodes[0, n] + shift - first
        begin = max(0, int(math.ceil(column - reach - 0.5)))
        stop = min(size, int(math.floor(column + reach - 0.5)) + 1)
        if begin >= stop:
            continue
        away = begin + 0.5 - column
        value = nodes[1, n] * math.exp(-away * away * scale)
        factor = math.exp(-(2.0 * away + 1.0) * scale)
        for i in range(begin, stop):
            out[0, i] += value
            out[1, i] += value * away
            value *= factor
            factor *= bend
            away += 1.0
    for i in range(size):
        out[1, i] *= 2.0 * scale
