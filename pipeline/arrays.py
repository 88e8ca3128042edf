"""Names for the arrays that the pipeline passes about, and means of what is present in them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating[Any]]  # Real numbers, double precision in practice
Complexes = NDArray[np.complexfloating[Any, Any]]  # Complex numbers, double precision in practice
EVEN = 1e-9  # s
DIGITS, ROUNDING = 10, 0.55  # of decimal stamps; of their last digit, by which stamps are off
STEPS = 3.0  # of a last digit, that a clock may step within the record
LEAST_STAMPS, HARMLESS = 4, 1e-4  # of the step, a last digit by which stamps may jitter


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
    with np.errstate(invalid="ignore"):
        return np.asarray(np.nansum(rows, axis=1) / np.sum(~np.isnan(rows), axis=1))


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
    >>> rounded = np.round(np.arange(100) / 30.0, 3)
    >>> bool(np.abs(evened(rounded) - np.arange(100) / 30.0).max() < 1e-4)
    True
    >>> late = np.arange(1000) * 0.1 + 0.01 * (np.arange(1000) > 500)
    >>> evened(late) is late
    True
    """
    if time.size < LEAST_STAMPS:
        return time
    if np.abs(time - np.linspace(time[0], time[-1], time.size)).max() < EVEN:
        return time
    apart = np.diff(time)
    step = float(np.mean(apart[apart < 1.5 * np.median(apart)]))  # less gaps
    rows = np.rint((time - time[0]) / step)
    step *= float(time[-1] - time[0]) / (rows[-1] * step)
    rows = np.rint((time - time[0]) / step)
    if np.abs(time - time[0] - rows * step).max() < EVEN or np.any(np.diff(rows) < 1.0):
        return time
    for digits in range(DIGITS):
        scaled, last = time * 10.0**digits, 10.0**-digits
        if np.abs(scaled - np.rint(scaled)).max() < 4.0 * np.spacing(np.abs(scaled).max()):
            whole = (
                abs(step / last - np.rint(step / last)) < STEPS / time.size
            )  # such a grid needs no rounding: what is off, is
            if whole and last > HARMLESS * step:
                return time
            slope, begin = np.polyfit(rows, time, 1)
            even = begin + slope * rows
            return even if np.abs(time - even).max() < (2.0 if whole else 1.0) * ROUNDING * last else time
    return time
