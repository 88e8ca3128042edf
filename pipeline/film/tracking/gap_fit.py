"""Middle and length of the shutter's gaps, fitted to the pixels of the rows about them.

The brightness of single rows only tells that there is a gap: beside it a row holds part of a line, whose cut is not
that of a whole one. Course and brightness in the open are known from many rows; what remains is when the shutter closed
and opened.

Gaps are told from a trace's brightness row by row: the spot blurs a gap, but not what is missing. The lack of light
summed over the rows is the gap's length, and its centre of gravity the gap's middle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.tracking.line_profile import (
    EDGE_FINENESS,
    MOST_NODES,
    REACH,
    along_film,
    light_nodes,
    nodes_of,
    profile,
)
from synth.kernels.compiled import kernel

LEAST_LACK = 0.12
SIGNIFICANT = 6.0  # sigma of the light missing in all
Integers = NDArray[np.int64]
Floats32 = NDArray[np.float32]

ROUNDS = 5
STEP = 0.01  # rows, half the stretch of light at an edge
MOST_ROWS = 96
ABOUT = 3.0  # spots beyond the gap
MIDDLE_PRIOR, LENGTH_PRIOR = 0.5, 1.0  # rows, 1 sigma
LONGEST = 12.0  # spots
HUBER = 3.5


@dataclass(frozen=True)
class Gaps:
    """Gaps of one trace.

    Attributes
    ----------
    middle, length : (n,) arrays
        Row (px from the film's edge) and length, rows.
    """

    middle: Floats
    length: Floats


def lamp_course(light: Floats, period: float) -> Floats:
    """Brightness of the line in the open: the running upper half of half a swing, where anything is seen."""
    from scipy import ndimage

    width = 2 * max(4, round(0.25 * period)) + 1
    course = ndimage.percentile_filter(np.nan_to_num(light, nan=0.0), 60.0, size=width, mode="nearest")
    return np.asarray(np.maximum(course, 0.02), dtype=np.float64)


def find_gaps(light: Floats, lamp: Floats, first: int, spot: float) -> Gaps:
    """Gaps of a trace from its brightness over some rows from `first` on; NaN where it was not followed."""
    lack = np.clip(1.0 - light / lamp, -0.5, 1.0)
    known = np.isfinite(lack)
    lack = np.where(known, lack, 0.0)
    sigma = 1.4826 * float(np.median(np.abs(lack[known] - np.median(lack[known])))) if known.sum() > 8 else 0.1
    smooth = np.convolve(lack, np.ones(3) / 3.0, mode="same")
    inside = smooth > max(LEAST_LACK, 2.0 * sigma)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(np.int8), [0]])))
    middle, length = [], []
    for begin, stop in zip(edges[::2], edges[1::2], strict=True):
        a, b = max(0, begin - 1), min(lack.size, stop + 1)
        amount = float(lack[a:b].sum())
        if amount > max(0.2, SIGNIFICANT * sigma * np.sqrt(b - a)):
            middle.append(first + float(np.sum(lack[a:b] * (np.arange(a, b) + 0.5))) / amount)
            length.append(amount)
    return Gaps(np.array(middle), np.array(length))


def as_table(gaps: list[Gaps]) -> tuple[Floats, NDArray[np.int64]]:
    """First and last row of all gaps, trace after trace (n, 2), and where each trace's begin (traces + 1,)."""
    rows = [np.stack([each.middle - 0.5 * each.length, each.middle + 0.5 * each.length], axis=1) for each in gaps]
    return np.concatenate(rows), np.concatenate([[0], np.cumsum([each.middle.size for each in gaps])]).astype(np.int64)


def from_table(rows: Floats, begins: NDArray[np.int64]) -> list[Gaps]:
    """The gaps of each trace out of `as_table`'s arrays."""
    parts = [rows[a:b] for a, b in pairwise(begins)]
    return [Gaps(part.mean(axis=1), part[:, 1] - part[:, 0]) for part in parts]


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
        As for `row_reading.read_piece`.
    gaps, gap_of : (n, 2), (traces + 1,) arrays
        First and last row of the gaps, trace after trace; overwritten.
    sigma : (n,) array
        Overwritten: 1 sigma of the middle, rows.
    """
    rows, columns = darkness.shape
    traces = states.shape[1]
    spot, shear, table_step = optics[0], optics[1], optics[2]
    top = table.shape[1] - 2
    nodes = np.empty((3, MOST_NODES))
    parts = np.empty((MOST_ROWS, 3, columns))  # exposure in the open of the rows about a gap, without and with it
    edges = np.empty((2, 3, columns))  # what the light at its two edges would leave
    bounds = np.empty((MOST_ROWS, 2), np.int64)
    for k in range(traces):
        for n in range(gap_of[k], gap_of[k + 1]):
            middle, length = 0.5 * (gaps[n, 0] + gaps[n, 1]), gaps[n, 1] - gaps[n, 0]
            middle_start, length_start = middle, length
            sigma[n] = MIDDLE_PRIOR
            begin = max(0, int(middle - 0.5 * length - ABOUT * spot) - first)
            stop = min(rows, int(middle + 0.5 * length + ABOUT * spot) + 1 - first, begin + MOST_ROWS)
            for i in range(begin, stop):
                row = first + i + 0.5
                slot = i - begin
                bounds[slot, 0], bounds[slot, 1] = 0, 0
                if known[k, i] == 0:
                    continue
                others = gaps[gap_of[k] : n]
                count = nodes_of(states[i, k], spot, shear, others, row, nodes)
                low, high, least = 1e9, -1e9, 0.01 * nodes[1, 0] * math.exp(0.5 * REACH * REACH)
                for j in range(count):
                    if nodes[1, j] >= least:
                        low, high = min(low, nodes[0, j]), max(high, nodes[0, j])
                if not (low > -1e6 and high < 1e6):
                    continue
                left, right = max(0, int(low - 3.0 * spot)), min(columns, int(high + 3.0 * spot) + 1)
                size = right - left
                if size < 4:
                    continue
                bounds[slot, 0], bounds[slot, 1] = left, right
                part = parts[slot, :, :size]
                profile(nodes, count, 0.0, 0.0, spot, left, part)
                for j in range(size):
                    part[0, j] *= lamp[k, i]
                later = gaps[n + 1 : gap_of[k + 1]]
                if later.shape[0] > 0 and later[0, 0] < row + REACH * spot:
                    take_gaps(states[i, k], spot, shear, later, row, left, -lamp[k, i], nodes, part, edges[0, :, :size])
                for other in range(traces):
                    if other == k or known[other, i] == 0:
                        continue
                    here, there = states[i, k, 0] + states[i, k, 3], states[i, other, 0] + states[i, other, 3]
                    swing = abs(states[i, other, 3]) + abs(states[i, other, 4])
                    if abs(here - there) > size + REACH * spot * (2.0 + abs(states[i, other, 5]) * swing):
                        continue
                    count = nodes_of(states[i, other], spot, shear, gaps[gap_of[other] : gap_of[other + 1]], row, nodes)
                    profile(nodes, count, 0.0, 0.0, spot, left, edges[0, :, :size])
                    for j in range(size):
                        part[0, j] += lamp[other, i] * edges[0, 0, j]
            for _ in range(ROUNDS):
                mm, ml, ll = 1.0 / MIDDLE_PRIOR**2, 0.0, 1.0 / LENGTH_PRIOR**2
                rm = (middle_start - middle) / MIDDLE_PRIOR**2
                rl = (length_start - length) / LENGTH_PRIOR**2
                for i in range(begin, stop):
                    slot = i - begin
                    left, size = bounds[slot, 0], bounds[slot, 1] - bounds[slot, 0]
                    if size < 4:
                        continue
                    row, state, fine = first + i + 0.5, states[i, k], EDGE_FINENESS
                    closed = parts[slot, :, :size]
                    dark_from = along_film(states[i, k], shear, middle - 0.5 * length - row)
                    dark_to = along_film(states[i, k], shear, middle + 0.5 * length - row)
                    reach = 1.5 * REACH * spot
                    dark_from, dark_to = max(-reach, min(reach, dark_from)), max(-reach, min(reach, dark_to))
                    count = 0
                    if dark_to > dark_from:
                        count = light_nodes(state, spot, shear, dark_from, dark_to, 1.0, nodes, 0, MOST_NODES, fine)
                    lost = edges[0, :, :size]
                    profile(nodes, count, 0.0, 0.0, spot, left, lost)
                    for j in range(size):
                        closed[1, j] = max(closed[0, j] - lamp[k, i] * lost[0, j], 0.0)
                    light_nodes(state, spot, shear, dark_from - STEP, dark_from + STEP, 0.5 / STEP, nodes, 0, 2, fine)
                    profile(nodes, 2, 0.0, 0.0, spot, left, edges[0, :, :size])
                    light_nodes(state, spot, shear, dark_to - STEP, dark_to + STEP, 0.5 / STEP, nodes, 0, 2, fine)
                    profile(nodes, 2, 0.0, 0.0, spot, left, edges[1, :, :size])
                    for j in range(size):
                        place = closed[1, j] / table_step
                        index = min(int(place), top)
                        share = min(place - index, 1.0)
                        dark = table[0, index] + share * (table[0, index + 1] - table[0, index])
                        rate = lamp[k, i] * (table[1, index] + share * (table[1, index + 1] - table[1, index]))
                        residual = darkness[i, left + j] - dark
                        weight = 1.0 / (optics[3] + optics[4] * dark)
                        size_of = abs(residual) * math.sqrt(weight)
                        if size_of > HUBER:
                            weight *= HUBER / size_of
                        dm = rate * (edges[0, 0, j] - edges[1, 0, j])
                        dl = -0.5 * rate * (edges[0, 0, j] + edges[1, 0, j])
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


@kernel
def take_gaps(
    state: Floats,
    spot: float,
    shear: float,
    gaps: Floats,
    row: float,
    left: int,
    factor: float,
    nodes: Floats,
    part: Floats,
    work: Floats,
) -> None:
    """Take the light of closed stretches out of a row's exposure."""
    reach = REACH * spot
    for g in range(gaps.shape[0]):
        if gaps[g, 0] > row + reach:
            break
        begin = max(-reach, along_film(state, shear, gaps[g, 0] - row))
        stop = min(reach, along_film(state, shear, gaps[g, 1] - row))
        if stop > begin:
            count = light_nodes(state, spot, shear, begin, stop, factor, nodes, 0, MOST_NODES, EDGE_FINENESS)
            profile(nodes, count, 0.0, 0.0, spot, left, work)
            for j in range(work.shape[1]):
                part[0, j] += work[0, j]
