"""Motion of a trace along the film, and the Kalman filter's steps.

State of a trace at the row it crosses: place m of the slow part, its rate m1 and the rate's rate m2 (all by rows),
rotating pair p, q and its frequency w (rad per row), so that, s rows on,

    x(s) = m + m1 s + m2 s^2/2 + p cos(w s) - q sin(w s).

Where the line of the slit lies askew to the rows (`shear` rows per column), s runs along the film and the light of s
falls on row s + shear (x(s) - x(0)).
"""

from __future__ import annotations

import math

import numpy as np

from pipeline.arrays import Floats
from synth.kernels.compiled import kernel

STATES = 6


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
    """Carry a state and its covariance on, in place, by `rows` (+1 or -1) rows of the image.

    `noise` (3,) is the growth a row of the variance of m2, of w and of p and q.
    """
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


@kernel
def correct(state: Floats, covariance: Floats, shift: float, variance: float, shear: float) -> None:
    """Take in a reading that lies `shift` columns from the state's own, with its variance."""
    gain = 1.0 + shear * (state[1] - state[5] * state[4])
    column = np.empty(STATES)
    for i in range(STATES):
        column[i] = covariance[i, 0] + covariance[i, 3]
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
