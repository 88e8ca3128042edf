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
FINENESS = 1.25  # spots a step, where the light comes and goes with the Gaussian
EDGE_FINENESS = 0.6  # where it is cut off
FULL_NODES, MOST_NODES = 1000, 2000


@kernel
def _add_nodes(
    state: Floats, spot: float, shear: float, begin: float, stop: float, factor: float, nodes: Floats, count: int,
    most: int, fineness: float,
) -> int:  # fmt: skip
    """Add the nodes of a stretch, `begin` to `stop` along the film from this row, to `count`; never over `most`."""
    rate, bend = state[1] - state[5] * state[4], state[2] - state[5] * state[5] * state[3]
    swing = math.sqrt(state[3] * state[3] + state[4] * state[4])
    steepest = abs(state[1]) + 3.0 * spot * abs(state[2]) + abs(state[5]) * swing
    steepest = min(steepest, abs(rate) + 3.0 * spot * abs(bend) + spot * spot * abs(state[5]) ** 3 * swing)
    step = fineness * (spot / math.sqrt(1.0 + steepest * steepest))
    number = min(max(int((stop - begin) / step) + 1, 2), most - count)
    step = (stop - begin) / number
    along = begin + 0.5 * step
    c, s = math.cos(state[5] * step), math.sin(state[5] * step)
    start_c, start_s = math.cos(state[5] * along), math.sin(state[5] * along)
    p, q = state[3] * start_c - state[4] * start_s, state[3] * start_s + state[4] * start_c
    here = state[0] + state[3]
    scale = 0.5 / (spot * spot)
    norm = factor * step / (math.sqrt(2.0 * math.pi) * spot)
    for i in range(number):
        column = state[0] + along * (state[1] + 0.5 * along * state[2]) + p
        p, q = p * c - q * s, p * s + q * c
        away = along + shear * (column - here)
        nodes[0, count + i] = column
        nodes[1, count + i] = norm * math.exp(-away * away * scale)
        nodes[2, count + i] = along
        along += step
    return count + number


@kernel
def _along_film(state: Floats, shear: float, rows: float) -> float:
    """How far along the film from this row's crossing the trace falls `rows` rows of the image on."""
    along = rows
    if shear != 0.0:
        for _ in range(3):
            turned = math.cos(state[5] * along) - 1.0
            moved = along * (state[1] + 0.5 * along * state[2]) + state[3] * turned
            along = rows - shear * (moved - state[4] * math.sin(state[5] * along))
    return along


@kernel
def nodes_of(state: Floats, spot: float, shear: float, gaps: Floats, row: float, nodes: Floats) -> int:
    """Where the spot was while it lit the row with centre line `row`; returns the number of nodes.

    `state` is that of the trace at this row (see `motion`); `gaps` (n, 2) are first and last rows of the shutter's gaps
    along this trace, rising, whose light counts negative. `nodes` (3, n) are overwritten: column, weight, and rows
    along the film from this row.
    """
    steepest = abs(state[1]) + abs(state[5]) * math.sqrt(state[3] * state[3] + state[4] * state[4])
    reach = REACH * spot * (1.0 + abs(shear) * steepest)
    count = _add_nodes(state, spot, shear, -reach, reach, 1.0, nodes, 0, FULL_NODES, FINENESS)
    for g in range(gaps.shape[0]):
        if gaps[g, 1] < row - REACH * spot:
            continue
        if gaps[g, 0] > row + REACH * spot:
            break
        begin = max(-reach, _along_film(state, shear, gaps[g, 0] - row))
        stop = min(reach, _along_film(state, shear, gaps[g, 1] - row))
        if stop > begin and count < MOST_NODES - 2:
            count = _add_nodes(state, spot, shear, begin, stop, -1.0, nodes, count, MOST_NODES, EDGE_FINENESS)
    return count


@kernel
def profile(
    nodes: Floats, count: int, shift: float, tilt: float, spot: float, first: int, out: Floats, size: int
) -> None:
    """What nodes leave on `size` pixels from `first` on: exposure, its derivatives by shift and slope, `out` (3, n).

    Neighbouring values of a Gaussian differ by a factor that itself changes by a constant factor: two exponentials a
    node.
    """
    scale = 0.5 / (spot * spot)
    light, by_shift, by_slope = out[0], out[1], out[2]
    for i in range(size):
        light[i], by_shift[i], by_slope[i] = 0.0, 0.0, 0.0
    reach = REACH * spot
    bend = math.exp(-2.0 * scale)
    for n in range(count):
        along = nodes[2, n]
        column = nodes[0, n] + shift + tilt * along - first
        begin = max(0, math.ceil(column - reach - 0.5))
        stop = min(size, math.floor(column + reach - 0.5) + 1)
        if begin >= stop:
            continue
        away = begin + 0.5 - column
        value = nodes[1, n] * math.exp(-away * away * scale)
        factor = math.exp(-(2.0 * away + 1.0) * scale)
        for i in range(begin, stop):
            slant = 2.0 * scale * value * away
            light[i] += value
            by_shift[i] += slant
            by_slope[i] += slant * along
            value *= factor
            factor *= bend
            away += 1.0
