"""How far each trace lies along the film from the first, and how oblique the image is: coarsely, as the gaps agree.

A gap shows on all traces at once: at row `r + offset + shear column`. Offsets may exceed the marks' spacing; of all
offsets and shears the true one brings most gaps together, because missing marks, false gaps and minute codes are the
same on every trace.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.film.marks.search import Gaps
from pipeline.film.parts import Floats

FARTHEST = 45.0  # px along the film between two traces
MOST_SHEAR = 0.035  # tangent: 2 degrees
BIN = 0.4  # px
ENOUGH = 24  # gaps that agree, from which shear is told better than by trial
UNEVEN = 0.15  # of the marks' spacing
LEAD_ODD, LEAD, SHARE = 3, 8, 0.08  # odd gaps, gaps, and share of them, by which the best lag must lead
TOGETHER = 0.6  # of a gap's width, or one pixel


@dataclass(frozen=True)
class Alignment:
    """Offsets of the traces and shear of the image.

    Attributes
    ----------
    offset : (traces,) array
        Rows by which each trace lies later than the first.
    shear : float
        Rows by which the image lags per column.
    sure : bool
        Whether no other offset comes near.
    """

    offset: Floats
    shear: float
    sure: bool

    def rows(self, gaps: Gaps) -> Floats:
        """Rows of gaps at column 0 of the first trace."""
        return np.asarray(gaps.row - self.offset[gaps.trace] - self.shear * gaps.column)


def aligned(gaps: Gaps, traces: int, spacing: float) -> Alignment:
    """Offsets and shear under which most gaps agree.

    Parameters
    ----------
    gaps : Gaps
    traces : int
        How many traces the film has.
    spacing : float
        Rows between marks, about.
    """
    offset, sure = np.zeros(traces), True
    steps = np.arange(-MOST_SHEAR, MOST_SHEAR + 1e-9, 0.00125)
    shear = _shear_of_one(gaps, spacing, steps) if traces == 1 else 0.0
    reference = gaps.pick(gaps.trace == 0)
    for trace in range(1, traces):
        other = gaps.pick(gaps.trace == trace)
        i, j = _pairs(reference, other)
        if i.size == 0:
            sure = False
            continue
        tried = steps if trace == 1 else np.array([shear])
        along, across = other.row[j] - reference.row[i], other.column[j] - reference.column[i]
        odd = _odd(reference.row, spacing)[i] & _odd(other.row, spacing)[j]
        table = np.array([_tally(along - step * across) for step in tried])
        odd_table = np.array([_tally((along - step * across)[odd]) for step in tried])
        which, at, certain = _chosen(table, odd_table, spacing)
        lag, slant = _refined(along, across, (at + 1) * BIN - FARTHEST, float(tried[which]), trace == 1)
        shear = slant if trace == 1 else shear
        offset[trace] = lag
        sure &= certain
    return Alignment(offset, shear, sure)


def _refined(along: Floats, across: Floats, lag: float, shear: float, free: bool) -> tuple[float, float]:
    """Offset and, if `free`, shear by the gaps that agree with coarse ones."""
    for reach in (1.0, 0.5):
        near = np.abs(along - shear * across - lag) < reach
        if near.sum() < ENOUGH:
            break
        if free:
            shear, lag = (float(value) for value in np.polyfit(across[near], along[near], 1))
        else:
            lag = float(np.median(along[near] - shear * across[near]))
    return lag, shear


def _pairs(reference: Gaps, other: Gaps) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Gaps of two traces that could be the same closing of the shutter."""
    slant = (
        MOST_SHEAR * float(np.abs(np.median(other.column) - np.median(reference.column)) + 300.0) if other.size else 0.0
    )
    low = np.searchsorted(reference.row, other.row - FARTHEST - slant)
    count = np.searchsorted(reference.row, other.row + FARTHEST + slant) - low
    j = np.repeat(np.arange(other.size), count)
    i = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + np.repeat(low, count)
    return i, j


def _odd(rows: Floats, spacing: float) -> NDArray[np.bool_]:
    """Gaps not whole numbers of marks from their neighbours: codes and false gaps tell one mark from another."""
    apart = np.diff(rows) / spacing
    uneven = (np.abs(apart - np.round(apart)) > UNEVEN) & (apart < 3.0)
    return np.asarray(np.concatenate([[False], uneven]) | np.concatenate([uneven, [False]]))


def _tally(lag: Floats) -> NDArray[np.int64]:
    """How many lags lie in each two neighbouring bins."""
    lag = lag[np.abs(lag) <= FARTHEST]
    bins = np.bincount(((lag + FARTHEST) / BIN).astype(int), minlength=int(2 * FARTHEST / BIN) + 2)
    return np.asarray(bins[:-1] + bins[1:])


def _chosen(table: NDArray[np.int64], odd: NDArray[np.int64], spacing: float) -> tuple[int, int, bool]:
    """Shear and lag of most agreement, and whether no lag a mark or more away comes near."""
    lags = (np.arange(table.shape[1]) + 1) * BIN - FARTHEST
    best_at = int(np.argmax(table.max(axis=0)))
    peaks: list[tuple[int, int, int, int]] = []
    for turn in range(-int(2 * FARTHEST / spacing) - 1, int(2 * FARTHEST / spacing) + 2):
        near = np.flatnonzero(np.abs(lags - lags[best_at] - turn * spacing) < 0.3 * spacing)
        if near.size:
            which, place = divmod(int(np.argmax(table[:, near])), near.size)
            at = int(near[place])
            close = odd[which, max(at - 1, 0) : at + 2]
            peaks.append((int(table[which, at]), int(close.max()), which, at))
    by_odd = sorted(peaks, key=lambda peak: -peak[1])
    if len(by_odd) == 1 or by_odd[0][1] - by_odd[1][1] >= LEAD_ODD:
        return by_odd[0][2], by_odd[0][3], by_odd[0][1] >= LEAD_ODD
    by_all = sorted(peaks, key=lambda peak: -peak[0])
    enough = max(LEAD, SHARE * by_all[0][0])
    if by_all[0][0] - by_all[1][0] >= enough:
        return by_all[0][2], by_all[0][3], True
    nearest = min((peak for peak in peaks if by_all[0][0] - peak[0] < enough), key=lambda peak: abs(lags[peak[3]]))
    return nearest[2], nearest[3], False


def _shear_of_one(gaps: Gaps, spacing: float, steps: Floats) -> float:
    """Shear by which the gaps of one trace, now left and now right, come to lie evenly."""
    if gaps.size < 8:
        return 0.0
    spread = []
    for step in steps:
        apart = np.diff(gaps.row - step * gaps.column)
        near = apart[np.abs(apart - spacing) < 0.3 * spacing]
        spread.append(np.inf if near.size < 6 else float(np.median(np.abs(near[1:] - near[:-1]))))
    return float(steps[int(np.argmin(spread))]) if np.isfinite(spread).any() else 0.0


@dataclass(frozen=True)
class Events:
    """Closings of the shutter, in order.

    Attributes
    ----------
    row, row_sigma : (events,) arrays
        At column 0 of the first trace, px.
    width, width_sigma : (events,) arrays
        Rows.
    member : (traces, events) array of int64
        Which gap shows it on each trace; -1 where none does.
    """

    row: Floats
    row_sigma: Floats
    width: Floats
    width_sigma: Floats
    member: NDArray[np.int64]

    @property
    def size(self) -> int:
        """Number of events."""
        return self.row.size


def gathered(gaps: Gaps, alignment: Alignment, traces: int, width: float) -> Events:
    """Gaps that lie together on different traces taken for one event."""
    rows = alignment.rows(gaps)
    order = np.argsort(rows, kind="stable")
    limit = max(TOGETHER * width, 1.0)
    groups: list[list[int]] = []
    for at in order:
        last = groups[-1] if groups else []
        if last and rows[at] - rows[last[0]] < limit and gaps.trace[at] not in gaps.trace[last]:
            last.append(int(at))
        else:
            groups.append([int(at)])
    member = np.full((traces, len(groups)), -1, dtype=np.int64)
    row, sigma, wide, wide_sigma = (np.empty(len(groups)) for _ in range(4))
    for k, group in enumerate(groups):
        weight = gaps.row_sigma[group] ** -2.0
        row[k], sigma[k] = np.sum(weight * rows[group]) / weight.sum(), weight.sum() ** -0.5
        weight = gaps.width_sigma[group] ** -2.0
        wide[k], wide_sigma[k] = np.sum(weight * gaps.width[group]) / weight.sum(), weight.sum() ** -0.5
        member[gaps.trace[group], k] = group
    order = np.argsort(row, kind="stable")
    return Events(row[order], sigma[order], wide[order], wide_sigma[order], member[:, order])
