"""How far each trace lies along the film from the first, and how oblique the image is: coarse, by agreement of the gaps.

A gap shows on all traces at once: at row `r + offset + shear column`. Offsets may exceed the marks' spacing; of all
offsets and shears the true one brings most gaps together, because missing marks, false gaps and minute codes are the
same on every trace.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.film.marks.gaps import Gaps
from pipeline.film.parts import Floats

FARTHEST = 45.0  # px along the film between two traces
MOST_SHEAR = 0.035  # tangent: 2 degrees
BIN = 0.4  # px
MARGIN, SHARE = 3, 0.004  # gaps, and share of them, by which the best must lead


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
        low = np.searchsorted(reference.row, other.row - FARTHEST - MOST_SHEAR * np.ptp(gaps.column))
        high = np.searchsorted(reference.row, other.row + FARTHEST + MOST_SHEAR * np.ptp(gaps.column))
        count = high - low
        j = np.repeat(np.arange(other.size), count)
        i = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + np.repeat(low, count)
        along, across = other.row[j] - reference.row[i], other.column[j] - reference.column[i]
        if along.size == 0:
            sure = False
            continue
        found = []
        for step in steps if trace == 1 else np.array([shear]):
            lag = along - step * across
            lag = lag[np.abs(lag) <= FARTHEST]
            bins = np.bincount(((lag + FARTHEST) / BIN).astype(int), minlength=int(2 * FARTHEST / BIN) + 2)
            both = bins[:-1] + bins[1:]
            found.append(both)
        table = np.array(found)
        which, at = np.unravel_index(int(np.argmax(table)), table.shape)
        best = table[which, at]
        if trace == 1:
            shear = float(steps[which])
        offset[trace] = (at + 1) * BIN - FARTHEST
        elsewhere = np.abs(np.arange(table.shape[1]) - at) > 0.3 * spacing / BIN
        second = table[:, elsewhere].max() if elsewhere.any() else 0
        sure &= bool(best - second >= max(MARGIN, SHARE * best))
    return Alignment(offset, shear, sure)


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
