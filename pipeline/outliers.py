"""Single wild readings, found by what their neighbours say.

Each sample is compared with the fit of {1, t, t^2, t^3, cos, sin, t cos, t sin} through the half second on either side,
itself left out. The largest disagreement of its neighbourhood is taken out first, because it spoils its neighbours'.
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.gaps import fill_gaps
from synth.kernels.compiled import kernel, summing_kernel

SAMPLE = 2000  # places from which the scale is taken
BLOCK = 512  # samples that stay in the first cache
REACH_SECONDS = 0.5
LEAST_REACH = 6  # samples on each side
THRESHOLD = 6.0  # robust sigmas; of 45000 Gaussian samples 1e-4 exceed it
MOST_ANGLE = 0.5 * np.pi  # swing between samples; with fewer than four a swing neighbours do not tell
_ROUNDS = 20
_FLOOR = 1e-9  # of the largest elongation: below it lies rounding, not reading error


def reject_outliers(series: Floats, step: float, frequency: float) -> tuple[Floats, int, float]:
    """Replace wild readings by NaN.

    Parameters
    ----------
    series : (n,) array
        Uniform samples, rad, NaN = missing.
    step, frequency : float
        s, rad s-1.

    Returns
    -------
    (n,) array, int, float
        The series (itself when nothing was found), how many samples were rejected, and the white noise that
        the neighbours leave unexplained (1 sigma, rad; NaN where the series is too short to tell).
    """
    reach = max(LEAST_REACH, round(REACH_SECONDS / step))
    if series.size < 6 * reach or step * frequency > MOST_ANGLE:
        return series, 0, float("nan")
    filter_taps = _leave_one_out(reach, step, frequency)
    gain = float(np.linalg.norm(filter_taps))
    scale = _scale(series, filter_taps)
    if np.isfinite(scale) and np.isfinite(series).all():
        # the usual record: one pass that keeps nothing shows that nothing is wild
        if beyond(series, filter_taps, _limit(scale, series)) == 0:
            return series, 0, scale / gain
        work = series.copy()
    else:
        work = fill_gaps(series, step, frequency, noise=np.inf)  # any bridge will do to look across
    rejected = np.zeros(series.size, dtype=bool)
    error = np.empty(series.size - 2 * reach)
    noise = float("nan")
    for _ in range(_ROUNDS):
        scale = _scale(work, filter_taps)
        if not np.isfinite(scale):
            break
        noise = scale / gain
        disagreement(work, filter_taps, error)
        size = np.abs(error)
        wild = np.flatnonzero(size > _limit(scale, work))
        if wild.size == 0:
            break
        tops = _local_maxima(size, wild, reach)
        work[tops + reach] -= error[tops]
        rejected[tops + reach] = True
    rejected &= np.isfinite(series)
    if not rejected.any():
        return series, 0, noise
    cleaned = series.copy()
    cleaned[rejected] = np.nan
    return cleaned, int(rejected.sum()), noise


def _scale(series: Floats, filter_taps: Floats) -> float:
    """Robust scale of the disagreement, as of a Gaussian, from a sample of places; NaN where there are none."""
    windows = np.lib.stride_tricks.sliding_window_view(series, filter_taps.size)
    size = np.abs(windows[:: max(1, windows.shape[0] // SAMPLE)] @ filter_taps)
    size = size[np.isfinite(size)]
    return float(np.median(size)) / 0.6745 if size.size else float("nan")


def _limit(scale: float, series: Floats) -> float:
    largest = float(np.nanmax(np.abs(series[:: max(1, series.size // SAMPLE)])))
    return max(THRESHOLD * scale, _FLOOR * largest)


@functools.lru_cache(maxsize=64)
def _leave_one_out(reach: int, step: float, frequency: float) -> Floats:
    """Taps that give sample minus the fit through its neighbours (symmetric, the middle tap is 1)."""
    tau = np.arange(-reach, reach + 1) * step
    x = tau / tau[-1]
    cos, sin = np.cos(frequency * tau), np.sin(frequency * tau)
    basis = np.stack([np.ones_like(x), x, x * x, x**3, cos, sin, x * cos, x * sin], axis=-1)
    others = np.arange(tau.size) != reach
    prediction = basis[reach] @ np.linalg.pinv(basis[others])
    filter_taps = np.ones(tau.size)
    filter_taps[others] = -prediction
    return filter_taps


@kernel
def disagreement(series: Floats, filter_taps: Floats, out: Floats) -> None:
    """`out[k] = sum_j filter_taps[j] series[k + j]`; out is shorter than the series by the taps less one."""
    for start in range(0, out.size, BLOCK):
        length = min(BLOCK, out.size - start)
        part = out[start : start + length]
        part[:] = 0.0
        for j in range(filter_taps.size):
            weight = filter_taps[j]
            shifted = series[start + j : start + j + length]
            for k in range(length):
                part[k] += weight * shifted[k]


@summing_kernel
def beyond(series: Floats, filter_taps: Floats, limit: float) -> int:
    """Count the places where the disagreement exceeds the limit, without keeping it."""
    part = np.empty(BLOCK)
    total = 0
    count = series.size - filter_taps.size + 1
    for start in range(0, count, BLOCK):
        length = min(BLOCK, count - start)
        part[:length] = 0.0
        for j in range(filter_taps.size):
            weight = filter_taps[j]
            shifted = series[start + j : start + j + length]
            for k in range(length):
                part[k] += weight * shifted[k]
        for k in range(length):
            total += 1 if abs(part[k]) > limit else 0
    return total


def _local_maxima(size: Floats, wild: NDArray[np.intp], reach: int) -> NDArray[np.intp]:
    """Of the wild samples, each that no larger one lies within reach of; greedy from the largest."""
    order = wild[np.argsort(-size[wild])]
    free = np.ones(size.size, dtype=bool)
    tops = []
    for index in order:
        if free[index]:
            tops.append(index)
            free[max(0, index - reach) : index + reach + 1] = False
    return np.asarray(tops, dtype=np.intp)
