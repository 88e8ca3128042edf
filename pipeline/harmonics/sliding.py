"""Sliding weighted least squares: the separated harmonic and the slow part at uniform instants.

In a Kaiser window the series is fitted by {1, t, t^2} x {cos, sin} + {1, t}: the harmonic with an amplitude and phase
that may change quadratically, on a slow part. Where all samples are there the fit is one set of filter taps, flat
at the pendulum's frequency and some 95 dB down where swell lives; where samples are missing the same fit is
solved on those present, so a gap is never filled.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np

from data_schemas.scratch import portions, release
from pipeline.arrays import Complexes, Floats
from pipeline.harmonics.envelope import Envelope, window_length
from synth.kernels.compiled import summing_kernel

WINDOW_SECONDS = 16.0
HOP_SECONDS = 1.0
KAISER_SHAPE = 14.0
BROKEN = 1024  # windows with gaps that are solved together: each takes its readings several times over
LEAST_COVERAGE = 0.7  # of the window's weight; an instant with less has no value
TERMS = 8


def sliding_envelope(time: Floats, step: float, first: Floats, difference: Floats, frequency: float) -> Envelope:
    """Envelope of both series at instants `HOP_SECONDS` apart (further where the window must be long).

    Parameters
    ----------
    time, first, difference : (n,) arrays
        s, rad, rad; NaN = missing.
    step : float
        Sampling step, s.
    frequency : float
        Carrier, rad s-1.
    """
    length = window_length(frequency, step, WINDOW_SECONDS, float(time[-1]) + step)
    hop = HOP_SECONDS * max(1.0, length / WINDOW_SECONDS)
    half = max(8, round(0.5 * length / step))
    every = max(1, round(hop / step))
    centres, fit, coverage, filters = _fits((first, difference), step, half, every, frequency)
    half_length = half * step
    fit[coverage < LEAST_COVERAGE] = np.nan
    carrier = np.exp(-1j * frequency * centres)
    amplitude: Complexes = (fit[:, :, 0] - 1j * fit[:, :, 1]) * carrier
    speed: Complexes = (fit[:, :, 2] - 1j * fit[:, :, 3]) * carrier / half_length
    return Envelope(
        time=centres,
        carrier=frequency,
        first=amplitude[0],
        difference=amplitude[1],
        first_speed=speed[0],
        difference_speed=speed[1],
        slow=fit[:, :, 6],
        slow_speed=fit[:, :, 7] / half_length,
        coverage=coverage[1],
        samples=coverage.mean(axis=1) * every,
        noise_gain=float(0.5 * np.sum(filters[:2] ** 2)),
        taps=filters[0] - 1j * filters[1],
    )


def _basis(tau: Floats, half_length: float, frequency: float) -> Floats:
    """The eight functions at `tau` seconds from the centre, (n, 8)."""
    x = tau / half_length
    cos, sin, one = np.cos(frequency * tau), np.sin(frequency * tau), np.ones_like(x)
    return np.stack([cos, sin, x * cos, x * sin, x * x * cos, x * x * sin, one, x], axis=-1)


def _kaiser(x: Floats) -> Floats:
    return np.asarray(np.i0(KAISER_SHAPE * np.sqrt(np.clip(1.0 - x * x, 0.0, None))) / np.i0(KAISER_SHAPE))


@functools.lru_cache(maxsize=64)
def _complete_window(half: int, step: float, frequency: float) -> tuple[Floats, Floats, Floats]:
    """Basis (2 half + 1, 8), weight, and the taps (8, 2 half + 1) of a window without gaps."""
    tau = np.arange(-half, half + 1) * step
    basis = _basis(tau, half * step, frequency)
    weight = _kaiser(tau / (half * step))
    weighted = weight[:, None] * basis
    return basis, weight, np.linalg.solve(basis.T @ weighted, weighted.T)


EVEN, ODD = (0, 3, 4, 6), (1, 2, 5, 7)
"""Rows of the taps that are even and odd about the centre, like the functions they belong to."""


@summing_kernel
def fit_windows(series: Floats, even: Floats, odd: Floats, every: int, out: Floats, first: int) -> None:
    """`out[i, first + k]`: taps i, even (4, half + 1) from the centre, odd (4, half) beside it; window k of series."""
    half = odd.shape[1]
    e0, e1, e2, e3 = even[0], even[1], even[2], even[3]
    o0, o1, o2, o3 = odd[0], odd[1], odd[2], odd[3]
    reverse = series[::-1].copy()  # loops index forward only
    last = series.size - 1
    for k in range((series.size - 2 * half - 1) // every + 1):
        centre = every * k + half
        middle = series[centre]
        after, before = series[centre + 1 : centre + 1 + half], reverse[last - centre + 1 : last - centre + 1 + half]
        s0, s1, s2, s3 = e0[0] * middle, e1[0] * middle, e2[0] * middle, e3[0] * middle
        d0 = d1 = d2 = d3 = 0.0
        for m in range(half):
            both, apart = after[m] + before[m], after[m] - before[m]
            s0 += e0[m + 1] * both
            s1 += e1[m + 1] * both
            s2 += e2[m + 1] * both
            s3 += e3[m + 1] * both
            d0 += o0[m] * apart
            d1 += o1[m] * apart
            d2 += o2[m] * apart
            d3 += o3[m] * apart
        to = first + k
        out[0, to], out[3, to], out[4, to], out[6, to] = s0, s1, s2, s3
        out[1, to], out[2, to], out[5, to], out[7, to] = d0, d1, d2, d3


def _fits(
    series: Sequence[Floats], step: float, half: int, every: int, frequency: float
) -> tuple[Floats, Floats, Floats, Floats]:
    basis, weight, filters = _complete_window(half, step, frequency)
    count = (series[0].size - 2 * half - 1) // every + 1
    centres = (np.arange(count) * every + half) * step
    even, odd = filters[EVEN, half:].copy(), filters[ODD, half + 1 :].copy()
    coverage = np.ones((2, count))
    transposed = np.empty((2, TERMS, count))
    fit = transposed.transpose(0, 2, 1)
    for which, values in enumerate(series):
        for some in portions(count * every, values, unit=every):
            windows = values[some.start : some.stop - every + 2 * half + 1]
            fit_windows(windows, even, odd, every, transposed[which], some.start // every)
        broken = np.flatnonzero(np.isnan(transposed[which, 0]))
        if broken.size:
            weighted = weight[:, None] * basis
            products = (weighted[:, :, None] * basis[:, None, :]).reshape(weight.size, TERMS * TERMS)
            views = np.lib.stride_tricks.sliding_window_view(values, 2 * half + 1)[::every]
            for begin in range(0, broken.size, BROKEN):
                here = broken[begin : begin + BROKEN]
                part = views[here]
                present = np.isfinite(part)
                coverage[which, here] = present @ weight / weight.sum()
                normal = (present.astype(np.float64) @ products).reshape(-1, TERMS, TERMS)
                right = np.where(present, part, 0.0) @ weighted
                usable = coverage[which, here] >= LEAST_COVERAGE
                fit[which, here[usable]] = np.linalg.solve(normal[usable], right[usable][:, :, None])[:, :, 0]
                release(values)
    return centres, fit, coverage, filters
