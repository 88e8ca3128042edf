"""Reading of one row: windows about the traces, groups of those that overlap, a joint fit of each group."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.tracking.line_profile import REACH, nodes_of
from pipeline.film.tracking.row_fit import fit_row
from synth.kernels.compiled import kernel

Integers = NDArray[np.int64]
Floats32 = NDArray[np.float32]

WINDOW = 3.5  # spots beyond the outermost light


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
