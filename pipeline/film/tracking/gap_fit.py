"""Middle and length of the shutter's gaps, fitted to the pixels of the rows about them.

The brightness of single rows only tells that there is a gap: beside it a row holds part of a line, whose cut is not
that of a whole one. Course and brightness in the open are known from many rows; what remains is when the shutter closed
and opened.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.tracking.line_profile import MOST_NODES, nodes_of, profile
from synth.kernels.compiled import kernel

Integers = NDArray[np.int64]
Floats32 = NDArray[np.float32]

ROUNDS = 5
STEP = 0.02  # rows, of the derivatives
ABOUT = 3.0  # spots beyond the gap
MIDDLE_PRIOR, LENGTH_PRIOR = 0.5, 1.0  # rows, 1 sigma
LONGEST = 12.0  # spots
HUBER = 3.5


@kernel
def fit_gaps(
    darkness: Floats32,
    first: int,
    states: Floats,
    known: NDArray[np.uint8],
    lamp: Floats,
    gaps: Floats,
    gap_of: Integers,
    optics: Floats,
    table: Floats,
    sigma: Floats,
) -> None:
    """Fit first and last row of each gap, in place.

    Parameters
    ----------
    darkness, first, states, known, lamp, optics, table
        As for `reading.read_piece`.
    gaps, gap_of : (n, 2), (traces + 1,) arrays
        First and last row of the gaps, trace after trace; overwritten.
    sigma : (n,) array
        Overwritten: 1 sigma of the middle, rows.
    """
    rows, columns = darkness.shape
    traces = states.shape[1]
    spot, shear, table_step = optics[0], optics[1], optics[2]
    top = table.shape[1] - 2
    nodes, out = np.empty((2, MOST_NODES)), np.empty((2, columns))
    exposure = np.empty((4, columns))  # others, itself, itself moved, itself longer
    trial = np.empty((1, 2))
    for k in range(traces):
        for n in range(gap_of[k], gap_of[k + 1]):
            middle, length = 0.5 * (gaps[n, 0] + gaps[n, 1]), gaps[n, 1] - gaps[n, 0]
            middle_start, length_start = middle, length
            sigma[n] = MIDDLE_PRIOR
            for _ in range(ROUNDS):
                mm, ml = 1.0 / MIDDLE_PRIOR**2, 0.0
                ll = 1.0 / LENGTH_PRIOR**2
                rm = (middle_start - middle) / MIDDLE_PRIOR**2
                rl = (length_start - length) / LENGTH_PRIOR**2
                begin = max(0, int(middle - 0.5 * length - ABOUT * spot) - first)
                stop = min(rows, int(middle + 0.5 * length + ABOUT * spot) + 1 - first)
                for i in range(begin, stop):
                    if known[k, i] == 0:
                        continue
                    row = first + i + 0.5
                    low, high = 1e9, -1e9
                    for kind in range(1, 4):
                        shift, growth = (STEP if kind == 2 else 0.0), (STEP if kind == 3 else 0.0)
                        trial[0, 0] = middle + shift - 0.5 * (length + growth)
                        trial[0, 1] = middle + shift + 0.5 * (length + growth)
                        count = nodes_of(states[i, k], spot, shear, trial, 0, row, nodes)
                        if kind == 1:
                            for j in range(count):
                                if abs(j - count // 2) < 0.4 * count:
                                    low, high = min(low, nodes[0, j]), max(high, nodes[0, j])
                            left = max(0, int(low - 3.0 * spot))
                            right = min(columns, int(high + 3.0 * spot) + 1)
                            size = right - left
                            if size < 4:
                                break
                        for j in range(count):  # the trace's other gaps stay as they are
                            for other in range(max(gap_of[k], n - 2), min(gap_of[k + 1], n + 3)):
                                if other != n and gaps[other, 0] < row + 6 * spot and gaps[other, 1] > row - 6 * spot:
                                    along = row + (2.0 * j / (count - 1) - 1.0) * 4.0 * spot
                                    if along > gaps[other, 0] and along < gaps[other, 1]:
                                        nodes[1, j] = 0.0
                        profile(nodes, count, 0.0, spot, left, out[:, :size])
                        for j in range(size):
                            exposure[kind, j] = lamp[k, i] * out[0, j]
                    if size < 4:
                        continue
                    for j in range(size):
                        exposure[0, j] = 0.0
                    for other in range(traces):
                        if other == k or known[other, i] == 0:
                            continue
                        here, there = states[i, k, 0] + states[i, k, 3], states[i, other, 0] + states[i, other, 3]
                        swing = abs(states[i, other, 5]) * 4.0 * spot * (abs(states[i, other, 3]) + abs(states[i, other, 4]))
                        if abs(here - there) > size + swing:
                            continue
                        count = nodes_of(
                            states[i, other], spot, shear, gaps[gap_of[other] : gap_of[other + 1]], 0, row, nodes
                        )
                        profile(nodes, count, 0.0, spot, left, out[:, :size])
                        for j in range(size):
                            exposure[0, j] += lamp[other, i] * out[0, j]
                    for j in range(size):
                        total = exposure[0, j] + exposure[1, j]
                        place = total / table_step
                        index = min(int(place), top)
                        share = min(place - index, 1.0)
                        dark = table[0, index] + share * (table[0, index + 1] - table[0, index])
                        rate = table[1, index] + share * (table[1, index + 1] - table[1, index])
                        residual = darkness[i, left + j] - dark
                        weight = 1.0 / (optics[3] + optics[4] * dark)
                        size_of = abs(residual) * math.sqrt(weight)
                        if size_of > HUBER:
                            weight *= HUBER / size_of
                        dm = rate * (exposure[2, j] - exposure[1, j]) / STEP
                        dl = rate * (exposure[3, j] - exposure[1, j]) / STEP
                        mm += weight * dm * dm
                        ml += weight * dm * dl
                        ll += weight * dl * dl
                        rm += weight * dm * residual
                        rl += weight * dl * residual
                det = mm * ll - ml * ml
                step_m, step_l = (ll * rm - ml * rl) / det, (mm * rl - ml * rm) / det
                middle += min(max(step_m, -0.7), 0.7)
                length = min(max(length + min(max(step_l, -0.7), 0.7), 0.1), LONGEST * spot)
                sigma[n] = math.sqrt(ll / det)
                if abs(step_m) < 0.01 and abs(step_l) < 0.03:
                    break
            gaps[n, 0], gaps[n, 1] = middle - 0.5 * length, middle + 0.5 * length
