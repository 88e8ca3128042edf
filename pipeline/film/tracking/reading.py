"""The reading of each row, about the course that all rows together gave."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.tracking.line_profile import MOST_NODES
from pipeline.film.tracking.motion import slope_of
from pipeline.film.tracking.row_reading import read_row
from synth.kernels.compiled import kernel

Integers = NDArray[np.int64]
Floats32 = NDArray[np.float32]
FIELDS = 7
SETTLED = 0.03


@kernel
def read_piece(
    darkness: Floats32,
    first: int,
    states: Floats,
    known: NDArray[np.uint8],
    slope_variance: Floats,
    lamp: Floats,
    gaps: Floats,
    gap_of: Integers,
    optics: Floats,
    table: Floats,
    out: Floats,
) -> None:
    """Read all traces row by row.

    Parameters
    ----------
    darkness : (rows, columns) array
        Above blank film, from row `first` of the film on.
    states, known : (rows, traces, 6), (traces, rows) arrays
        The course, and where there is one.
    slope_variance, lamp : (traces, rows) arrays
        Variance of the course's slope; brightness in the open.
    gaps, gap_of, optics, table
        As for `row_reading.read_row`.
    out : (traces, rows, 7) array
        Overwritten: shift from the course, its variance, brightness (of the light let through), its variance, mean
        square residual, variance of the shift had the trace lain alone, slope.
    """
    rows, columns = darkness.shape
    traces = states.shape[1]
    found, nodes = np.empty((traces, 6)), np.empty((traces, 3, MOST_NODES))
    counts, windows = np.empty(traces, np.int64), np.empty((traces, 4), np.int64)
    profiles = np.empty((traces, 3, columns))
    matrices = np.empty((3, 3 * traces + 8, 3 * traces + 8))
    alive, now, prior = np.empty(traces, np.int64), np.empty(traces), np.full((traces, 2), math.inf)
    for i in range(rows):
        for k in range(traces):
            alive[k], now[k] = (1 if known[k, i] else 0), lamp[k, i]
            prior[k, 1] = max(slope_variance[k, i], 1e-8)
        read_row(
            darkness[i],
            first + i + 0.5,
            states[i],
            alive,
            optics,
            table,
            now,
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
            for a in range(6):
                out[k, i, a] = found[k, a]
            out[k, i, 6] = slope_of(states[i, k], optics[1])
