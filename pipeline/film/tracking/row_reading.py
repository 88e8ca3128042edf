"""Reading of one row: windows about the traces, groups of those that overlap, a joint fit of each group."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.tracking.line_profile import MOST_NODES, REACH, nodes_of
from pipeline.film.tracking.motion import slope_of
from pipeline.film.tracking.row_fit import fit_row
from synth.kernels.compiled import kernel

Integers = NDArray[np.int64]
Floats32 = NDArray[np.float32]

WINDOW = 3.5  # spots beyond the outermost light


FIELDS = 7
SETTLED = 0.03


@kernel
def read_row(
    darkness: Floats32,
    row: float,
    states: Floats,
    alive: Integers,
    optics: Floats,
    table: Floats,
    lamp: Floats,
    prior: Floats,
    gaps: Floats,
    gap_of: Integers,
    settled: float,
    found: Floats,
    nodes: Floats,
    counts: Integers,
    windows: Integers,
    profiles: Floats,
    matrices: Floats,
) -> None:
    """Shift and brightness of all traces on one row (see `row_fit.fit_row`).

    Parameters
    ----------
    darkness : (columns,) array
        Above blank film.
    row : float
        Centre line of the row, px.
    states : (traces, 6) array
        Of the motion at this row.
    alive : (traces,) array
        0 where a trace is not known.
    optics : (5,) array
        Spot (px), shear, step of the table, variance of the grain and its growth.
    gaps, gap_of : (n, 2), (traces + 1,) array
        Gaps of all traces; those of trace k from `gap_of[k]` to before `gap_of[k + 1]`.
    found : (traces, 6) array
        Overwritten; variance inf where a trace is not known or off the image.
    nodes, counts, windows, profiles, matrices
        Work: (traces, 3, MOST_NODES), (traces,), (traces, 4), (traces, 3, columns), (3, 3 traces + 8, 3 traces + 8).
    """
    spot, shear = optics[0], optics[1]
    traces, columns = states.shape[0], darkness.size
    for k in range(traces):
        found[k, 0], found[k, 1], found[k, 2], found[k, 3], found[k, 4] = 0.0, np.inf, 0.0, np.inf, 0.0
        found[k, 5] = np.inf
        windows[k, 2] = -1
        if alive[k] == 0:
            continue
        last = gap_of[k + 1]
        near = gap_of[k]
        while near < last and gaps[near, 1] < row - 8.0 * spot:
            near += 1
        counts[k] = nodes_of(states[k], spot, shear, gaps[near:last], row, nodes[k])
        low, high, least = 1e9, -1e9, 0.01 * nodes[k, 1, 0] * math.exp(0.5 * REACH * REACH)
        for i in range(counts[k]):
            if nodes[k, 1, i] >= least:
                low, high = min(low, nodes[k, 0, i]), max(high, nodes[k, 0, i])
        if not (low > -1e6 and high < 1e6 and low <= high):
            continue
        windows[k, 0] = max(0, math.floor(low - WINDOW * spot))
        windows[k, 1] = min(columns, math.ceil(high + WINDOW * spot))
        here = states[k, 0] + states[k, 3]
        if here > 0.0 and here < columns and windows[k, 1] - windows[k, 0] >= 6:
            windows[k, 2] = k
    for _ in range(traces):  # the smallest number of a group is its name
        for a in range(traces):
            for b in range(traces):
                if (
                    windows[a, 2] > windows[b, 2] >= 0
                    and windows[a, 0] < windows[b, 1]
                    and windows[b, 0] < windows[a, 1]
                ):
                    windows[a, 2] = windows[b, 2]
    for name in range(traces):
        count, low_pixel, high_pixel = 0, columns, 0
        for k in range(traces):
            if windows[k, 2] == name:
                windows[count, 3] = k
                count += 1
                low_pixel, high_pixel = min(low_pixel, windows[k, 0]), max(high_pixel, windows[k, 1])
        if count > 0:
            fit_row(
                darkness[low_pixel:high_pixel],
                low_pixel,
                nodes,
                counts,
                windows[:count, 3],
                spot,
                table,
                optics[2],
                optics[3:5],
                lamp,
                prior,
                settled,
                found,
                profiles,
                matrices,
            )


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
