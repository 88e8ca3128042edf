"""Single wild readings, found by what their neighbours say.

Each sample is compared with the fit of {1, t, t^2, t^3, cos, sin, t cos, t sin} through the half second on either side,
itself left out.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator

import numpy as np

from data_schemas.scratch import portions
from pipeline.arrays import Floats
from synth.kernels.compiled import kernel, summing_kernel

SAMPLE = 2000  # places from which the scale is taken
BLOCK = 1024  # samples that stay in the first cache
TOGETHER = 8  # taps in one pass over a block
REACH_SECONDS = 0.5
LEAST_REACH = 6  # samples on each side
THRESHOLD = 6.0  # robust sigmas; of 45000 Gaussian samples 1e-4 exceed it
MOST_ANGLE = 0.5 * np.pi  # swing between samples; with fewer than four a swing neighbours do not tell
FLOOR = 1e-6  # of the largest elongation: what departs less harms nothing


def outliers_and_noise(series: Floats, step: float, frequency: float) -> tuple[bool, float]:
    """Whether a series has wild readings, and its white noise.

    Parameters
    ----------
    series : (n,) array
        Uniform samples, rad, NaN = missing; what lies beside a missing one is not judged.
    step, frequency : float
        s, rad s-1.

    Returns
    -------
    bool, float
        The noise is what the neighbours leave unexplained (1 sigma, rad; NaN where they do not tell).
    """
    reach = max(LEAST_REACH, round(REACH_SECONDS / step))
    if series.size < 6 * reach or step * frequency > MOST_ANGLE:
        return False, float("nan")
    filter_taps = _leave_one_out(reach, step, frequency)
    scale, limit = scale_and_limit(series, filter_taps)
    wild = any(beyond(here, filter_taps, limit) for _, here in _windows(series, reach))
    return wild, scale / float(np.linalg.norm(filter_taps))


def _windows(series: Floats, reach: int) -> Iterator[tuple[int, Floats]]:
    """Portions of a series with the taps' reach on both sides, and the first sample that has its neighbours in each."""
    for part in portions(series.size - 2 * reach, series, unit=BLOCK):
        yield part.start + reach, series[part.start : part.stop + 2 * reach]


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


def scale_and_limit(series: Floats, filter_taps: Floats) -> tuple[float, float]:
    """Robust scale of the disagreement, as of a Gaussian, and what is wild; NaN where there is nothing to tell by.

    Both are taken from some `SAMPLE` places.
    """
    count, reach = series.size - filter_taps.size + 1, filter_taps.size // 2
    every = max(1, count // SAMPLE)
    size = np.empty(-(-count // every))
    found, largest = 0, 0.0
    for first, here in _windows(series, reach):
        more, top = sampled(here, filter_taps, (reach - first) % every, every, size[found:])
        found, largest = found + more, max(largest, top)
    if found == 0:
        return float("nan"), float("nan")
    scale = float(np.median(size[:found])) / 0.6745
    return scale, max(THRESHOLD * scale, FLOOR * largest)


@kernel
def sampled(series: Floats, filter_taps: Floats, first: int, every: int, size: Floats) -> tuple[int, float]:
    """Sizes of the disagreement at each so many places from the first on: how many could be told; largest sample."""
    found, largest = 0, 0.0
    for start in range(first, series.size - filter_taps.size + 1, every):
        error = abs(dot(series[start : start + filter_taps.size], filter_taps))
        if np.isfinite(error):
            size[found] = error
            found += 1
            largest = max(largest, abs(series[start]))
    return found, largest


@summing_kernel
def dot(one: Floats, other: Floats) -> float:
    """Sum of products."""
    total = 0.0
    for k in range(one.size):
        total += one[k] * other[k]
    return total


@summing_kernel
def disagreement(series: Floats, filter_taps: Floats, out: Floats) -> None:
    """`out[k] = sum_j filter_taps[j] series[k + j]`; out is shorter than the series by the taps less one."""
    length, taps = out.size, filter_taps.size
    out[:] = 0.0
    together = taps - taps % TOGETHER
    for j in range(0, together, TOGETHER):
        w0, w1, w2, w3, w4, w5, w6, w7 = filter_taps[j : j + TOGETHER]
        near = series[j:]
        s0, s1, s2, s3 = near[:length], near[1 : 1 + length], near[2 : 2 + length], near[3 : 3 + length]
        s4, s5, s6, s7 = near[4 : 4 + length], near[5 : 5 + length], near[6 : 6 + length], near[7 : 7 + length]
        for k in range(length):
            out[k] += ((w0 * s0[k] + w1 * s1[k]) + (w2 * s2[k] + w3 * s3[k])) + (
                (w4 * s4[k] + w5 * s5[k]) + (w6 * s6[k] + w7 * s7[k])
            )
    for j in range(together, taps):
        weight = filter_taps[j]
        shifted = series[j : j + length]
        for k in range(length):
            out[k] += weight * shifted[k]


@summing_kernel
def beyond(series: Floats, filter_taps: Floats, limit: float) -> int:
    """Count the places where the disagreement exceeds the limit, without keeping it."""
    part = np.empty(BLOCK)
    total = 0
    count = series.size - filter_taps.size + 1
    for start in range(0, count, BLOCK):
        length = min(BLOCK, count - start)
        disagreement(series[start : start + length + filter_taps.size - 1], filter_taps, part[:length])
        for k in range(length):
            total += 1 if abs(part[k]) > limit else 0
    return total
