"""Outliers and white noise of a series, by what the neighbours of each sample predict.

Each sample is compared with the fit of {1, t, t^2, t^3, cos, sin, t cos, t sin} through the half second on either side,
itself left out.
"""

from __future__ import annotations

import functools

import numpy as np

from data_schemas.scratch import portions
from pipeline.arrays import Floats
from synth.kernels.compiled import summing_kernel

PLACES = 2000  # from which the scale is taken, at least
REACH_SECONDS = 0.5
LEAST_REACH = 6  # samples on each side
THRESHOLD = 6.0  # robust sigmas; of 45000 Gaussian samples 1e-4 exceed it
MOST_ANGLE = 0.5 * np.pi  # swing between samples; with fewer than four a swing neighbours predict nothing
FLOOR = 1e-6  # of the largest elongation: what departs less harms nothing


def outliers_and_noise(series: Floats, step: float, frequency: float) -> tuple[bool, float]:
    """Whether a series has outliers, and its white noise.

    Parameters
    ----------
    series : (n,) array
        Uniform samples, rad, NaN = missing; what lies beside a missing one is not judged.
    step, frequency : float
        s, rad s-1.

    Returns
    -------
    bool, float
        The noise is what the neighbours leave unexplained (1 sigma, rad; NaN where they predict nothing).
    """
    reach = max(LEAST_REACH, round(REACH_SECONDS / step))
    if series.size < 6 * reach or step * frequency > MOST_ANGLE:
        return False, float("nan")
    taps = leave_one_out(reach, step, frequency)
    count = series.size - 2 * reach
    every, errors = max(1, count // PLACES), []
    worst = largest = 0.0
    for part in portions(count, series):
        here, error = series[part.start : part.stop + 2 * reach], np.empty(part.stop - part.start)
        departures(here, taps, error)
        errors.append(error[-part.start % every :: every].copy())
        worst, largest = (
            np.fmax(worst, np.fmax.reduce(error)),
            max(largest, np.fmax.reduce(here), -np.fmin.reduce(here)),
        )
    places = np.concatenate(errors)
    places = places[np.isfinite(places)]
    if places.size == 0:
        return False, float("nan")
    scale = float(np.median(places)) / 0.6745
    return bool(worst > max(THRESHOLD * scale, FLOOR * largest)), scale / float(np.linalg.norm(taps))


@functools.lru_cache(maxsize=64)
def leave_one_out(reach: int, step: float, frequency: float) -> Floats:
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


@summing_kernel
def departures(series: Floats, taps: Floats, out: Floats) -> None:
    """`out[k] = |sum_j taps[j] series[k + j]|`; out is shorter than the series by the taps less one."""
    for k in range(out.size):
        total = 0.0
        for j in range(taps.size):
            total += taps[j] * series[k + j]
        out[k] = abs(total)
