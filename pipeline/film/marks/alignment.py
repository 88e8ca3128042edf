"""How far each trace lies along the film from the first, and how oblique the image is.

A gap shows on all traces at once: at row `r + offset + shear column`. Offsets may exceed the marks' spacing; of all
offsets and shears the true one brings most gaps together, because missing marks, false gaps and minute codes are the
same on every trace. Coarse ones are refined once the marks are counted.

The drive's model tells motion from errors by their being independent from mark to mark. Dirt, bends of the tracker's
curve and the obliqueness of strokes are not: marks half a swing apart meet the strokes at nearly the same phase. But
the paper moves all traces at once: what lasts in their differences is error.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.film.marks.drive import Drive
from pipeline.film.marks.search import Gaps
from pipeline.film.parts import Floats

FARTHEST = 45.0  # px along the film between two traces
SHEARS = np.arange(-0.035, 0.035 + 1e-9, 0.00125)  # tangents that are tried, up to 2 degrees
BIN = 0.4  # px
ENOUGH = 24  # gaps that agree, from which shear and offset are fitted; marks seen on several traces
UNEVEN = 0.15  # of the marks' spacing
CHANCE = 2.0  # roots of what another lag has
LEAD_ODD, LEAD, SHARE = 3, 8, 0.08  # odd gaps, gaps, and share of them, by which the best lag must lead
TOGETHER = 0.6  # of a gap's width, or one pixel
LAGS, ENOUGH_PAIRS = 4, 40  # marks: two swings; pairs of marks a lag
SHARED = 0.3  # of the marks' floor, where one trace shows the marks
Whole = NDArray[np.int64]


class Alignment(NamedTuple):
    """How the traces lie to each other."""

    offset: Floats  # (traces,), rows by which each lies later than the first
    shear: float  # rows by which the image lags per column
    sure: bool  # whether no other offset comes near


class Events(NamedTuple):
    """Closings of the shutter, in order."""

    row: Floats  # at column 0 of the first trace
    row_sigma: Floats
    width: Floats  # rows
    width_sigma: Floats
    member: Whole  # (traces, events), which gap shows it on each trace; -1 where none does


def aligned(gaps: Gaps, traces: int, spacing: float) -> Alignment:
    """Offsets and shear under which most gaps agree; `spacing` is about the rows between marks."""
    offset, sure, shear = np.zeros(traces), True, 0.0
    first = gaps.pick(gaps.trace == 0)
    reach = FARTHEST + SHEARS[-1] * float(np.ptp(gaps.column))
    for trace in range(1, traces):
        other = gaps.pick(gaps.trace == trace)
        low, high = (np.searchsorted(first.row, other.row + side * reach) for side in (-1.0, 1.0))
        j = np.repeat(np.arange(other.row.size), high - low)
        if j.size == 0:
            sure = False
            continue
        i = np.arange(j.size) - np.repeat(np.cumsum(high - low) - high, high - low)
        tried = SHEARS if trace == 1 else np.array([shear])
        along, across = other.row[j] - first.row[i], other.column[j] - first.column[i]
        odd = _odd(first.row, spacing)[i] & _odd(other.row, spacing)[j]
        table, odd_table = (
            np.array([_tally((along - step * across)[which]) for step in tried]) for which in (slice(None), odd)
        )
        which, at, certain = _chosen(table, odd_table, spacing)
        sure &= certain
        offset[trace], slant = (at + 1) * BIN - FARTHEST, float(tried[which])
        for within in (1.0, 0.5):
            near = np.abs(along - slant * across - offset[trace]) < within
            if near.sum() >= ENOUGH and trace == 1:
                slant, offset[trace] = np.polyfit(across[near], along[near], 1)
            elif near.sum() >= ENOUGH:
                offset[trace] = np.median(along[near] - slant * across[near])
        shear = float(slant)
    return Alignment(offset, shear, sure)


def _odd(rows: Floats, spacing: float) -> NDArray[np.bool_]:
    """Gaps not whole numbers of marks from their neighbours: codes and false gaps tell one mark from another."""
    apart = np.diff(rows) / spacing
    uneven = (np.abs(apart - np.round(apart)) > UNEVEN) & (apart < 3.0)
    return np.asarray(np.concatenate([[False], uneven]) | np.concatenate([uneven, [False]]))


def _tally(lag: Floats) -> Whole:
    """How many lags lie in each two neighbouring bins."""
    lag = lag[np.abs(lag) <= FARTHEST]
    bins = np.bincount(((lag + FARTHEST) / BIN).astype(int), minlength=int(2 * FARTHEST / BIN) + 2)
    return np.asarray(bins[:-1] + bins[1:])


def _chosen(table: Whole, odd: Whole, spacing: float) -> tuple[int, int, bool]:
    """Shear and lag of most agreement, and whether no lag a mark or more away comes near."""
    lags = (np.arange(table.shape[1]) + 1) * BIN - FARTHEST
    best_at, turns = int(np.argmax(table.max(axis=0))), int(2 * FARTHEST / spacing) + 1
    peaks: list[tuple[int, int, int, int]] = []  # odd gaps, gaps, shear and lag of each
    for turn in range(-turns, turns + 1):
        near = np.flatnonzero(np.abs(lags - lags[best_at] - turn * spacing) < 0.3 * spacing)
        if near.size:
            which, at = divmod(int(np.argmax(table[:, near])), near.size)
            at = int(near[at])
            peaks.append((int(odd[which, max(at - 1, 0) : at + 2].max()), int(table[which, at]), which, at))
    by_odd, *others = sorted(peaks, key=lambda peak: -peak[0])
    # false gaps come with the swing, and so at the lags of its halves: of many the lead must be more than chance
    if not others or by_odd[0] - others[0][0] >= max(LEAD_ODD, CHANCE * math.sqrt(others[0][0])):
        return by_odd[2], by_odd[3], by_odd[0] >= LEAD_ODD
    most = max(peak[1] for peak in peaks)
    near_best = [peak for peak in peaks if most - peak[1] < max(LEAD, SHARE * most)]
    _, _, which, at = min(near_best, key=lambda peak: abs(lags[peak[3]]))
    return which, at, len(near_best) == 1


def gathered(gaps: Gaps, alignment: Alignment, traces: int, width: float) -> Events:
    """Gaps that lie together on different traces taken for one event."""
    rows = gaps.row - alignment.offset[gaps.trace] - alignment.shear * gaps.column
    groups: list[list[int]] = []
    for at in np.argsort(rows, kind="stable").tolist():
        last = groups[-1] if groups else []
        if last and rows[at] - rows[last[0]] < max(TOGETHER * width, 1.0) and gaps.trace[at] not in gaps.trace[last]:
            last.append(at)
        else:
            groups.append([at])
    member, event = np.full((traces, len(groups)), -1, dtype=np.int64), np.empty(gaps.size, dtype=np.int64)
    for k, group in enumerate(groups):
        member[gaps.trace[group], k], event[group] = group, k
    values: list[Floats] = []
    for each, sigma in ((rows, gaps.row_sigma), (gaps.width, gaps.width_sigma)):
        total = np.bincount(event, sigma**-2.0)
        values += [np.bincount(event, sigma**-2.0 * each) / total, np.power(total, -0.5)]
    order = np.argsort(values[0], kind="stable")
    row, row_sigma, wide, wide_sigma = (each[order] for each in values)
    return Events(row, row_sigma, wide, wide_sigma, member[:, order])


def refined(rows: Floats, sigma: Floats, columns: Floats, paper: Drive) -> tuple[Floats, float, float]:
    """Offsets of the traces, the first one's 0, shear, and what their errors make of a row, 1 sigma, by least squares.

    `rows`, `sigma` and `columns` (traces, marks) are those of the gaps, px; NaN = missing. Of marks that several traces
    show, the row is free, so that nothing of theirs is taken for the paper's motion. If there are too few of those,
    rows are held to the motion found: a trace now left and now right of its middle shows the shear.
    """
    traces = len(rows)
    used = paper.used & np.isfinite(rows) & np.isfinite(columns)
    weight = np.where(used, 1.0 / (sigma**2 + paper.model.floor**2), 0.0)
    each_one = np.broadcast_to(np.eye(traces)[:, :, None], (traces, *rows.shape))
    terms = np.stack([*each_one, np.where(used, columns, 0.0), np.where(used, rows - paper.row, 0.0)])
    several = used.sum(axis=0) > 1
    if several.sum() >= ENOUGH:
        weight[:, ~several] = 0.0
    mean = np.einsum("km,pkm->pm", weight, terms) / np.maximum(weight.sum(axis=0), 1e-300)
    terms[:, :, several] -= mean[:, None, several]
    normal = np.einsum("km,pkm,qkm->pq", weight, terms, terms)
    free = [*range(1, traces), traces] if traces > 1 else [0, 1]  # of one trace, what lies even is the paper's
    matrix = normal[np.ix_(free, free)]
    spread = np.linalg.inv(matrix + np.diag(1e-9 * np.diag(matrix) + 1e-12))
    *offset, shear = spread @ normal[free, traces + 1]
    # what all gaps share is the zero of time
    by = np.column_stack([np.eye(traces)[np.nonzero(used)[0]], columns[used]])
    by -= weight[used] @ by / max(float(weight[used].sum()), 1e-300)
    variance = np.einsum("ni,ij,nj->n", by[:, free], spread, by[:, free])
    unsure = float(np.sqrt(np.mean(variance))) if variance.size else 0.0
    return np.array([0.0, *offset[: traces - 1]]), float(shear), unsure


def lasting(rows: Floats, paper: Drive) -> float:
    """1 sigma of the lasting error of a mark's row, px, of measured `rows` (traces, marks) freed of offsets and shear.

    NaN = missing.
    """
    residual = np.where(paper.used, rows - paper.row, np.nan)
    apart = [one - other for one, other in itertools.combinations(residual, 2)]
    products = [each[lag:] * each[:-lag] for each in apart for lag in range(1, LAGS + 1)]
    several = [known for each in products if (known := each[np.isfinite(each)]).size >= ENOUGH_PAIRS]
    if not several:
        return SHARED * paper.model.floor
    together = np.concatenate(several)
    chance = float(np.std(together)) / np.sqrt(together.size)
    of_one = 0.5 * max(float(np.mean(together)) - chance, 0.0)  # variance of a trace; a difference has two
    return float(np.sqrt(of_one / len(rows)))
