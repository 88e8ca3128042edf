"""Motion of a trace along the film: the Kalman filter's steps, and the exposure that the moving spot leaves on a row.

State at a row: place m of the slow part, its rate m1 and the rate's rate m2 (all by rows), rotating pair p, q and its
frequency w (rad per row): s rows on x(s) = m + m1 s + m2 s^2/2 + p cos(w s) - q sin(w s). Where the slit lies askew
(`shear` rows per column), s runs along the film and the light of s falls on row s + shear (x(s) - x(0)).

The spot is a Gaussian of the same width along and across the film, and film darkens by how long it is lit:

    E(u) = int ds open(s) g(r - r(s)) exp(-(u - x(s))^2 / 2 spot^2),   g of area 1 and width `spot`,

is 1 on the axis of a line at rest, 1/sqrt(1 + slope^2) on that of a straight line, and exact in turns and beside gaps
of the shutter. Steps of 1.25 spots along the trace make the sum as good as the integral: 1e-5.
"""

import math

import numpy as np

from pipeline.arrays import Floats
from synth.kernels.compiled import kernel, making_kernel

STATES = 6
REACH = 4.0  # spots: what lies farther leaves less than 3e-4
FINENESS = 1.25  # spots a step, where the light comes and goes with the Gaussian
EDGE_FINENESS = 0.6  # where it is cut off
FULL_NODES, MOST_NODES = 1000, 2000


def place_and_rate(states: Floats) -> tuple[Floats, Floats]:
    """Column and columns per row along the film of states (..., 6)."""
    return states[..., 0] + states[..., 3], states[..., 1] - states[..., 5] * states[..., 4]


def moved(states: Floats, along: float | Floats) -> Floats:
    """States (..., 6) of traces some rows on along the film; both broadcast."""
    m, m1, m2, p, q, w = np.moveaxis(states, -1, 0)
    c, s = np.cos(w * along), np.sin(w * along)
    place = m + along * (m1 + 0.5 * along * m2)
    return np.stack(np.broadcast_arrays(place, m1 + m2 * along, m2, p * c - q * s, p * s + q * c, w), axis=-1)


@kernel
def _carry(change: Floats, step: float, c: float, s: float, p: float, q: float) -> None:
    """What a small change of a state becomes a step on, in place; `p`, `q` are those after the step."""
    change[0] += step * (change[1] + 0.5 * step * change[2])
    change[1] += step * change[2]
    turned = c * change[3] - s * change[4] - q * step * change[5]
    change[4] = s * change[3] + c * change[4] + p * step * change[5]
    change[3] = turned


@kernel
def advance(state: Floats, covariance: Floats, noise: Floats, rows: float, shear: float) -> None:
    """Carry state and covariance on, in place, by +1 or -1 rows; `noise` (3,) is that of m2, w and (p, q)."""
    step = rows
    if shear != 0.0:  # the step along the film that moves the trace by whole rows of the image
        for _ in range(4):
            c, s = math.cos(state[5] * step), math.sin(state[5] * step)
            moved = state[1] * step + 0.5 * state[2] * step * step + state[3] * (c - 1.0) - state[4] * s
            step = rows - shear * moved
    c, s = math.cos(state[5] * step), math.sin(state[5] * step)
    p, q = state[3] * c - state[4] * s, state[3] * s + state[4] * c
    state[0] += state[1] * step + 0.5 * state[2] * step * step
    state[1] += state[2] * step
    state[3], state[4] = p, q
    for i in range(STATES):
        _carry(covariance[:, i], step, c, s, p, q)
    for i in range(STATES):
        _carry(covariance[i], step, c, s, p, q)
    grow = abs(step)
    covariance[2, 2] += noise[0] * grow
    covariance[5, 5] += noise[1] * grow
    covariance[3, 3] += noise[2] * grow
    covariance[4, 4] += noise[2] * grow


@kernel
def slope_of(state: Floats, shear: float) -> float:
    """Columns per row of the image at the row the state belongs to."""
    rate: float = state[1] - state[5] * state[4]
    return rate / (1.0 + shear * rate)


@kernel
def place_variance(state: Floats, covariance: Floats, shear: float) -> float:
    """Variance of the column at which the trace crosses the row."""
    gain: float = 1.0 + shear * (state[1] - state[5] * state[4])
    return float(covariance[0, 0] + 2.0 * covariance[0, 3] + covariance[3, 3]) / (gain * gain)


@kernel
def slope_variance(state: Floats, covariance: Floats) -> float:
    """Variance of the columns per row, along the film."""
    w, q = state[5], state[4]
    own: float = covariance[1, 1] + w * w * covariance[4, 4] + q * q * covariance[5, 5]
    shared: float = w * covariance[1, 4] + q * covariance[1, 5] - w * q * covariance[4, 5]
    return own - 2.0 * shared


@making_kernel
def correct(state: Floats, covariance: Floats, shift: float, variance: float, shear: float) -> None:
    """Take in a reading that lies `shift` columns from the state's own, with its variance."""
    gain = 1.0 + shear * (state[1] - state[5] * state[4])
    column = covariance[:, 0] + covariance[:, 3]
    total = column[0] + column[3] + variance * gain * gain
    for i in range(STATES):
        state[i] += column[i] / total * (shift * gain)
        for j in range(STATES):
            covariance[i, j] -= column[i] * column[j] / total


@kernel
def solve(matrix: Floats, right: Floats, n: int) -> bool:
    """Inverse of the first n x n of a positive matrix, and its product with `right`, both in place (Gauss-Jordan)."""
    for k in range(n):
        pivot = matrix[k, k]
        if not pivot > 0.0:
            return False
        matrix[k, k] = 1.0
        for j in range(n):
            matrix[k, j] /= pivot
        right[k] /= pivot
        for i in range(n):
            if i != k:
                factor = matrix[i, k]
                matrix[i, k] = 0.0
                for j in range(n):
                    matrix[i, j] -= factor * matrix[k, j]
                right[i] -= factor * right[k]
    return True


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
    """Number of `nodes` (3, n), overwritten, of the spot while it lit a `row`: column, weight, rows along the film.

    `gaps` (n, 2) are first and last rows of the shutter's gaps along this trace, rising, whose light counts negative.
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
def profile(nodes: Floats, count: int, shift: float, tilt: float, spot: float, first: int, out: Floats) -> None:
    """What nodes leave on pixels from `first` on: exposure, its derivatives by shift and slope, `out` (3, pixels)."""
    scale, reach = 0.5 / (spot * spot), REACH * spot
    light, by_shift, by_slope = out[0], out[1], out[2]
    out[:] = 0.0
    bend = math.exp(-2.0 * scale)
    for n in range(count):
        along = nodes[2, n]
        column = nodes[0, n] + shift + tilt * along - first
        begin = max(0, math.ceil(column - reach - 0.5))
        stop = min(light.size, math.floor(column + reach - 0.5) + 1)
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
