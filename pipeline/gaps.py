"""Missing samples of a recorded pendulum that is an INPUT of the correction.

The exact identity integrates the first pendulum over the whole record, so a gap in it must be bridged; the
difference, whose frequency is wanted, is never filled.
"""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Floats

SHORT_GAP = 3.0  # s
SHORT_REACH, LONG_REACH = 1.2, 12.0  # s of record on each side that the bridge is fitted to; wider, swell misfits
LEAST_REACH = 15  # samples on each side
SHORT_DEGREE, LONG_DEGREE = 5, 1  # of the slow part: a high polynomial would swing across a long gap or beyond an end


def fill_gaps(series: Floats, step: float, frequency: float) -> Floats:
    """The series with its gaps bridged; see `bridge`."""
    return bridge(series, step, frequency)[0]


def bridge(series: Floats, step: float, frequency: float) -> tuple[Floats, list[tuple[int, float]]]:
    """Bridge missing samples by a local fit of {polynomial, cos, sin, t cos, t sin}.

    Parameters
    ----------
    series : (n,) array
        Uniform samples, rad, NaN = missing.
    step : float
        s.
    frequency : float
        Circular frequency of the free swing, rad s-1.

    Returns
    -------
    (n,) array
        The series itself when nothing is missing. Stretches too poor to be bridged stay NaN.
    list of (int, float)
        For each bridge its length in samples and the rms misfit of its fit, rad.
    """
    missing = np.isnan(series)
    bridges: list[tuple[int, float]] = []
    if not missing.any():
        return series, bridges
    filled = series.copy()
    present = np.flatnonzero(~missing)
    if present.size == 0:
        return filled, bridges
    edges = np.flatnonzero(np.diff(np.concatenate(([0], missing.astype(np.int8), [0]))))
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        long = (stop - start) * step > SHORT_GAP
        reach = max(LEAST_REACH, int(stop - start), int(np.ceil((LONG_REACH if long else SHORT_REACH) / step)))
        at_end = start == 0 or stop == series.size
        degree = LONG_DEGREE if long or at_end else SHORT_DEGREE
        around = np.arange(max(0, start - reach), min(series.size, stop + reach))
        known = around[~missing[around]]
        if known.size < 2 * (degree + 5):
            continue
        middle, scale = 0.5 * (start + stop - 1) * step, 0.5 * around.size * step
        basis = _basis(known * step - middle, scale, frequency, degree)
        fit = np.linalg.lstsq(basis, series[known], rcond=None)[0]
        bridges.append((int(stop - start), float(np.sqrt(np.mean((series[known] - basis @ fit) ** 2)))))
        gap = np.arange(start, stop)
        filled[gap] = _basis(gap * step - middle, scale, frequency, degree) @ fit
    return filled, bridges


def _basis(tau: Floats, scale: float, frequency: float, degree: int) -> Floats:
    x = tau / scale
    cos, sin = np.cos(frequency * tau), np.sin(frequency * tau)
    return np.stack([*(x**power for power in range(degree + 1)), cos, sin, x * cos, x * sin], axis=-1)
