"""Gaps that the shutter left in a trace, told from its brightness row by row.

The spot blurs a gap, but not what is missing: the lack of light summed over the rows is the gap's length, and its
centre of gravity the gap's middle.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats

LEAST_LACK = 0.12
SIGNIFICANT = 6.0  # sigma of the light missing in all


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
