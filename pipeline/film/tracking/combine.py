"""Both directions put together: the course of a trace from all readings but the row's own."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.tracking.line_profile import Optics
from pipeline.film.tracking.motion import STATES, place_variance, slope_of, slope_variance
from pipeline.film.tracking.pieces import Piece
from pipeline.film.tracking.row_fit import solve
from synth.kernels.compiled import kernel

FORWARD, BACKWARD, BOTH = 1, 2, 3
SLACK = 0.25  # spots, of the normal, that the directions may differ by where paper or ship speed up


@kernel
def combine(
    forward_states: Floats,
    forward_covariances: Floats,
    forward_followed: NDArray[np.uint8],
    backward_states: Floats,
    backward_covariances: Floats,
    backward_followed: NDArray[np.uint8],
    spot: float,
    shear: float,
    states: Floats,
    variance: Floats,
    slope_spread: Floats,
    disagreement: Floats,
    known: NDArray[np.uint8],
) -> None:
    """Weigh the states of both directions by their covariances.

    Parameters
    ----------
    states : (rows, traces, 6) array
        Overwritten: the course.
    variance, slope_spread, disagreement : (traces, rows) arrays
        Overwritten: variance of the course's column and of its slope; by how many sigma the directions differ in it.
    known : (traces, rows) array
        Overwritten: 1 forward only, 2 backward only, 3 both, 0 none.
    """
    rows, traces = states.shape[:2]
    total, right, change = np.empty((STATES, STATES)), np.empty(STATES), np.empty((STATES, STATES))
    gain = np.empty((STATES, STATES))
    for i in range(rows):
        for k in range(traces):
            known[k, i] = (FORWARD if forward_followed[k, i] else 0) + (BACKWARD if backward_followed[k, i] else 0)
            disagreement[k, i] = 0.0
            one = backward_states[i, k] if known[k, i] == BACKWARD else forward_states[i, k]
            spread = backward_covariances[i, k] if known[k, i] == BACKWARD else forward_covariances[i, k]
            for a in range(STATES):
                states[i, k, a] = one[a]
            variance[k, i] = place_variance(one, spread, shear)
            slope_spread[k, i] = slope_variance(one, spread)
            if known[k, i] != BOTH:
                continue
            other = backward_states[i, k]
            apart = variance[k, i] + place_variance(other, backward_covariances[i, k], shear)
            steep = slope_of(one, shear)
            apart += SLACK * SLACK * spot * spot * (1.0 + steep * steep)
            disagreement[k, i] = abs(other[0] + other[3] - one[0] - one[3]) / math.sqrt(apart)
            for a in range(STATES):
                right[a] = other[a] - one[a]
                for b in range(STATES):
                    total[a, b] = spread[a, b] + backward_covariances[i, k, a, b]
            if not solve(total, right, STATES):
                continue
            for a in range(STATES):
                for b in range(STATES):
                    states[i, k, a] += spread[a, b] * right[b]
            for a in range(STATES):
                for b in range(STATES):
                    gain[a, b] = 0.0
                    for c in range(STATES):
                        gain[a, b] += spread[a, c] * total[c, b]
            for a in range(STATES):
                for b in range(STATES):
                    change[a, b] = spread[a, b]
                    for c in range(STATES):
                        change[a, b] -= gain[a, c] * spread[c, b]
            variance[k, i] = place_variance(states[i, k], change, shear)
            slope_spread[k, i] = slope_variance(states[i, k], change)


def combined(
    forward: Piece, backward: Piece, optics: Optics
) -> tuple[Floats, Floats, Floats, Floats, NDArray[np.uint8]]:
    """Course (rows, traces, 6), variances of place and slope, disagreement in sigma, and which directions know it."""
    traces, rows = forward.place.shape
    states, known = np.empty((rows, traces, STATES)), np.empty((traces, rows), np.uint8)
    variance, slope_spread, disagreement = (np.empty((traces, rows)) for _ in range(3))
    combine(
        forward.states,
        forward.covariances,
        forward.followed,
        backward.states,
        backward.covariances,
        backward.followed,
        optics.spot,
        optics.shear,
        states,
        variance,
        slope_spread,
        disagreement,
        known,
    )
    return states, variance, slope_spread, disagreement, known
