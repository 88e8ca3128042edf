"""The harmonic Kalman filter along a piece of film, in either direction."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.tracking.line_profile import MOST_NODES
from pipeline.film.tracking.motion import advance, correct, place_variance, slope_of, slope_variance
from pipeline.film.tracking.row_reading import read_row
from synth.kernels.compiled import kernel

Integers = NDArray[np.int64]
Floats32 = NDArray[np.float32]

GATE = 5.0  # sigma
SLACK = 0.3  # spots, of the line's normal: what the filter may lag behind where ship or paper speed up
SEEN = 4.0  # sigma of the brightness from which on there is a line
MISFIT = 30.0  # mean square residual from which on something else lies on the line; less makes a reading less sure
LAMP_MEMORY = 0.03  # a row
GIVEN_UP = 0.25  # share of good rows of late under which a trace is lost
SETTLED = 0.08
LEAST_SLOPE_VARIANCE = 1e-8
DEGENERATE = 25.0  # growth of the variance by another trace from which on a row says nothing


@kernel
def follow(
    darkness: Floats32,
    first: int,
    order: int,
    states: Floats,
    covariances: Floats,
    alive: Integers,
    begins: Integers,
    lamp: Floats,
    quality: Floats,
    optics: Floats,
    table: Floats,
    noise: Floats,
    quality_memory: float,
    place: Floats,
    variance: Floats,
    brightness: Floats,
    followed: NDArray[np.uint8],
    kept_states: Floats,
    kept_covariances: Floats,
) -> None:
    """Read and follow all traces over the rows of a piece.

    Parameters
    ----------
    darkness : (rows, columns) array
        Above blank film.
    first : int
        Row of the film of the first.
    order : int
        1 along the film, -1 against it.
    states, covariances, alive, lamp, quality : (traces, ...) arrays
        Before the first row to be read; overwritten by those after the last.
    begins : (traces,) array
        Row of the piece from which on a trace that is not alive is to be followed; its state is that of this row.
        -1 for none.
    optics : (5,) array
        As for `row_reading.read_row`.
    noise : (traces, 3) array
        As for `motion.advance`.
    quality_memory : float
        Share by which one row counts in the share of good rows.
    place, variance, brightness, followed : (traces, rows) arrays
        Overwritten: readings, inf their variance where not used; whether the trace was being followed.
    kept_states, kept_covariances : (rows, traces, ...) arrays
        Overwritten: before each row was read.
    """
    rows, columns = darkness.shape
    traces = states.shape[0]
    spot, shear = optics[0], optics[1]
    found, nodes = np.empty((traces, 6)), np.empty((traces, 3, MOST_NODES))
    counts, windows = np.empty(traces, np.int64), np.empty((traces, 4), np.int64)
    profiles = np.empty((traces, 3, columns))
    matrices, work = np.empty((3, 3 * traces + 8, 3 * traces + 8)), np.empty((2, 6, 6))
    prior = np.ones((traces, 2))
    gaps, gap_of = np.empty((0, 2)), np.zeros(traces + 1, np.int64)
    for turn in range(rows):
        i = turn if order > 0 else rows - 1 - turn
        for k in range(traces):
            if alive[k] != 0:
                advance(states[k], covariances[k], noise[k], float(order), shear, work)
            elif begins[k] == i:
                alive[k] = 1
            if alive[k] != 0:
                prior[k, 0] = place_variance(states[k], covariances[k], shear)
                prior[k, 1] = max(slope_variance(states[k], covariances[k]), LEAST_SLOPE_VARIANCE)
            for a in range(6):
                kept_states[i, k, a] = states[k, a]
                for b in range(6):
                    kept_covariances[i, k, a, b] = covariances[k, a, b]
        read_row(
            darkness[i],
            first + i + 0.5,
            states,
            alive,
            optics,
            table,
            lamp,
            prior,
            gaps,
            gap_of,
            SETTLED,
            found,
            nodes,
            counts,
            windows,
            profiles,
            matrices,
        )
        for k in range(traces):
            followed[k, i] = alive[k]
            place[k, i], variance[k, i], brightness[k, i] = 0.0, np.inf, found[k, 2]
            if alive[k] == 0:
                continue
            slope = slope_of(states[k], shear)
            stretch = 1.0 + slope * slope
            shift, spread, light, light_variance = found[k, 0], found[k, 1], found[k, 2], found[k, 3]
            seen = light * light > SEEN * SEEN * light_variance and found[k, 4] < MISFIT
            dim = max(0.0, 1.0 - light / lamp[k])
            spread = spread * max(1.0, found[k, 4]) + spot * spot * stretch * (1e-3 + 2.25 * dim * dim)
            limit = GATE * GATE * (prior[k, 0] + spread + SLACK * SLACK * spot * spot * stretch)
            good = seen and shift * shift <= limit
            if not found[k, 1] > DEGENERATE * found[k, 5]:
                quality[k] += quality_memory * ((1.0 if good else 0.0) - quality[k])
            if good:
                place[k, i], variance[k, i] = states[k, 0] + states[k, 3] + shift, spread
                correct(states[k], covariances[k], shift, spread, shear, work)
            if seen:
                doubt = math.sqrt(light_variance) / (0.1 * lamp[k])
                lamp[k] = max(0.02, lamp[k] + LAMP_MEMORY / (1.0 + doubt * doubt) * (light - lamp[k]))
            if quality[k] < GIVEN_UP:
                alive[k] = 0


@kernel
def replay(
    states: Floats,
    covariances: Floats,
    alive: Integers,
    noise: Floats,
    shear: float,
    place: Floats,
    variance: Floats,
    followed: NDArray[np.uint8],
    kept_states: Floats,
    kept_covariances: Floats,
) -> None:
    """Once more along a piece that was followed before, from its readings alone; overwrites what `follow` kept."""
    rows, traces = kept_states.shape[:2]
    work = np.empty((2, 6, 6))
    for i in range(rows):
        for k in range(traces):
            if followed[k, i] == 0:
                continue
            if alive[k] == 0:
                alive[k] = 1
            else:
                advance(states[k], covariances[k], noise[k], 1.0, shear, work)
            for a in range(6):
                kept_states[i, k, a] = states[k, a]
                for b in range(6):
                    kept_covariances[i, k, a, b] = covariances[k, a, b]
            if np.isfinite(variance[k, i]):
                shift = place[k, i] - (states[k, 0] + states[k, 3])
                correct(states[k], covariances[k], shift, variance[k, i], shear, work)
