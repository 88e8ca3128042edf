"""Names for the arrays that the pipeline passes about, and what is asked of every series."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_schemas.scratch import portions

Floats = NDArray[np.floating[Any]]
"""Real numbers, double precision in practice."""
Complexes = NDArray[np.complexfloating[Any, Any]]
"""Complex numbers, double precision in practice."""


def readings(series: Floats) -> int:
    """How many values of a series are there: neither missing nor infinite."""
    return sum(int(np.count_nonzero(np.isfinite(series[part]))) for part in portions(series.size, series))


def sum_of_squares(series: Floats) -> float:
    """Sum of the squares of a series without gaps."""
    return sum(float(series[part] @ series[part]) for part in portions(series.size, series))
