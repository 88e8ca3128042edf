"""Names for the arrays that the pipeline passes about, and means of what is present in them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]
"""Real numbers, double precision in practice."""
Complexes = NDArray[np.complexfloating[Any, Any]]
"""Complex numbers, double precision in practice."""


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
