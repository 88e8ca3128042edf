"""Names for the arrays that the pipeline passes about, and means of what is present in them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]
"""Real numbers, double precision in practice."""
Complexes = NDArray[np.complexfloating[Any, Any]]
"""Complex numbers, double precision in practice."""
EVEN = 1e-9  # s
DIGITS, ROUNDED, ROUNDING = (
    10,
    1e-3,
    0.55,
)  # of decimal stamps; of their last digit: that they are stamps, and how far off
LEAST_STAMPS = 4


def median_present(series: Floats) -> float:
    """Median of the values that are not missing; NaN where all are, without NumPy's warning.

    Examples
    --------
    >>> median_present(np.array([1.0, np.nan, 3.0])), median_present(np.array([np.nan]))
    (2.0, nan)
    """
    present = series[~np.isnan(series)]
    return float(np.median(present)) if present.size else float("nan")


def row_means_present(rows: Floats) -> Floats:
    """Mean of each row's values that are not missing, (rows,); NaN where all are, without NumPy's warning.

    Examples
    --------
    >>> row_means_present(np.array([[1.0, np.nan, 3.0], [np.nan, np.nan, np.nan]])).tolist()
    [2.0, nan]
    """
    missing = np.isnan(rows)
    count = rows.shape[1] - missing.sum(axis=1)
    total = np.where(missing, 0.0, rows).sum(axis=1)
    means: Floats = np.divide(total, count, out=np.full(len(rows), np.nan), where=count > 0)
    return means


def unwrapped(harmonics: Complexes) -> Floats:
    """Unwrapped phases, row by row, NaN where missing."""
    phase = np.full(harmonics.shape, np.nan)
    for row, harmonic in enumerate(harmonics):
        present = np.isfinite(harmonic)
        phase[row, present] = np.unwrap(np.angle(harmonic[present]))
    return phase


def evened(time: Floats) -> Floats:
    """Times that lie on a uniform grid but for the rounding of their stamps, on that grid; others as they are.

    Examples
    --------
    >>> evened(np.array([0.0, 0.033, 0.067, 0.1, 0.133])).round(4).tolist()
    [0.0, 0.0333, 0.0666, 0.0999, 0.1332]
    >>> evened(np.array([0.0, 0.03, 0.09, 0.1])).tolist()
    [0.0, 0.03, 0.09, 0.1]
    """
    if time.size < LEAST_STAMPS:
        return time
    step = float(np.median(np.diff(time)))
    rows = np.rint((time - time[0]) / step)
    step *= float(time[-1] - time[0]) / (rows[-1] * step)
    rows = np.rint((time - time[0]) / step)
    if np.abs(time - time[0] - rows * step).max() < EVEN or np.any(np.diff(rows) < 1.0):
        return time
    for digits in range(DIGITS):
        scaled = time * 10.0**digits
        if np.abs(scaled - np.rint(scaled)).max() < ROUNDED:
            slope, begin = np.polyfit(rows, time, 1)
            even = begin + slope * rows
            return even if np.abs(time - even).max() < ROUNDING * 10.0**-digits else time
    return time
