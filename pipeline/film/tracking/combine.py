"""Both directions put together: the course of a trace from all readings but the row's own."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.tracking.motion import STATES, place_variance, slope_of, slope_variance, solve
from pipeline.film.tracking.pieces import Piece
from synth.kernels.compiled import kernel

FORWARD, BACKWARD, BOTH = 1, 2, 3
SLACK = 0.25  # spots, of the normal, that the directions may differ by where paper or ship speed up


class Course(NamedTuple):
    """The states of both directions weighed by their covariances.

    Attributes
    ----------
    states : (rows, traces, 6) array
    variance, slope_variance, disagreement : (traces, rows) arrays
        Variance of the column and of the slope; by how many sigma the directions differ in the column.
    known : (traces, rows) array
        1 forward only, 2 backward only, 3 both, 0 none.
    """

    states: Floats
    variance: Floats
    slope_variance: Floats
    disagreement: Floats
    known: NDArray[np.uint8]


@kernel
def combined(forward: Piece, backward: Piece, spot: float, shear: float) -> Course:
    """The course of all traces of a piece that was followed both ways."""
    rows, traces = forward.states.shape[:2]
    states, known = np.empty((rows, traces, STATES)), np.empty((traces, rows), np.uint8)
    variance, slope_spread, disagreement = np.empty((traces, rows)), np.empty((traces, rows)), np.zeros((traces, rows))
    for i in range(rows):
        for k in range(traces):
            known[k, i] = (FORWARD if forward.followed[k, i] else 0) + (BACKWARD if backward.followed[k, i] else 0)
            one, spread = forward.states[i, k], forward.covariances[i, k]
            other, other_spread = backward.states[i, k], backward.covariances[i, k]
            if known[k, i] == BACKWARD:
                one, spread = other, other_spread
            states[i, k] = one
            variance[k, i], slope_spread[k, i] = place_variance(one, spread, shear), slope_variance(one, spread)
            if known[k, i] != BOTH:
                continue
            steep = slope_of(one, shear)
            apart = variance[k, i] + place_variance(other, other_spread, shear)
            apart += SLACK * SLACK * spot * spot * (1.0 + steep * steep)
            disagreement[k, i] = abs(other[0] + other[3] - one[0] - one[3]) / math.sqrt(apart)
            total, right = spread + other_spread, other - one
            if solve(total, right, STATES):
                gain = spread @ total
                states[i, k] += spread @ right
                change = spread - gain @ spread
                variance[k, i] = place_variance(states[i, k], change, shear)
                slope_spread[k, i] = slope_variance(states[i, k], change)
    return Course(states, variance, slope_spread, disagreement, known)
