"""Sliding weighted least squares: the separated harmonic and the slow part at uniform instants.

In a Kaiser window the series is fitted by {1, t, t^2} x {cos, sin} + {1, t}: the harmonic with an amplitude and phase
that may change quadratically, on a slow part. Where all samples are there the fit is one set of filter taps, flat
at the pendulum's frequency and some 95 dB down where swell lives; where samples are missing the same fit is
solved on those present, so a gap is never filled.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.arrays import Complexes, Floats
from pipeline.harmonics.envelope import Envelope, window_length

Series = tuple[Floats, Floats]
"""Times and values."""

WINDOW_SECONDS = 16.0
HOP_SECONDS = 1.0
KAISER_SHAPE = 14.0
LEAST_COVERAGE = 0.7  # of the window's weight; an instant with less has no value
TERMS = 8


def sliding_envelope(
    time: Floats,
    step: float | None,
    first: Floats,
    difference: Floats,
    frequency: float,
    first_step: float | None = None,
) -> Envelope:
    """Envelope of both series at instants `HOP_SECONDS` apart (further where the window must be long).

    Parameters
    ----------
    time, first, difference : (n,) arrays
        s, rad, rad; NaN = missing.
    step : float or None
        Sampling step when uniform.
    frequency : float
        Carrier, rad s-1.
    first_step : float, optional
        Step of `first` where it stands on a grid of its own, s.
    """
    taps = None
    mean_step = step if step is not None else float(time[-1]) / (time.size - 1)
    length = window_length(frequency, mean_step, WINDOW_SECONDS, float(time[-1]) + mean_step)
    hop = HOP_SECONDS * max(1.0, length / WINDOW_SECONDS)
    if step is not None:
        half = max(8, round(0.5 * length / step))
        every = max(1, round(hop / step))
        centres, fit, coverage, filters = _uniform(np.stack([first, difference]), step, half, every, frequency)
        hop, half_length = every * step, half * step
        taps = filters[0] - 1j * filters[1]
    else:
        first_time = time if first_step is None else np.arange(first.size) * first_step
        pairs = ((first_time, first), (time, difference))
        half_length = 0.5 * length
        centres = np.arange(half_length, float(time[-1]) - half_length + 0.5 * hop, hop)
        fit, coverage = _uneven(pairs, centres, half_length, frequency)
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
        samples=coverage.mean(axis=1) * hop / mean_step,
        noise_gain=_noise_gain(half_length, mean_step, frequency),
        taps=taps,
    )


def _basis(tau: Floats, half_length: float, frequency: float) -> Floats:
    """The eight functions at `tau` seconds from the centre, (n, 8)."""
    x = tau / half_length
    cos, sin, one = np.cos(frequency * tau), np.sin(frequency * tau), np.ones_like(x)
    return np.stack([cos, sin, x * cos, x * sin, x * x * cos, x * x * sin, one, x], axis=-1)


def _kaiser(x: Floats) -> Floats:
    return np.asarray(np.i0(KAISER_SHAPE * np.sqrt(np.clip(1.0 - x * x, 0.0, None))) / np.i0(KAISER_SHAPE))


def _noise_gain(half_length: float, step: float, frequency: float) -> float:
    half = max(8, round(half_length / step))
    tau = np.arange(-half, half + 1) * step
    basis = _basis(tau, half * step, frequency)
    weighted = _kaiser(tau / (half * step))[:, None] * basis
    return float(0.5 * np.sum(np.linalg.solve(basis.T @ weighted, weighted.T)[:2] ** 2))


def _uniform(
    series: Floats, step: float, half: int, every: int, frequency: float
) -> tuple[Floats, Floats, Floats, Floats]:
    tau = np.arange(-half, half + 1) * step
    basis = _basis(tau, half * step, frequency)
    weight = _kaiser(tau / (half * step))
    weighted = weight[:, None] * basis
    windows = np.lib.stride_tricks.sliding_window_view(series, 2 * half + 1, axis=1)[:, ::every]
    centres = (np.arange(windows.shape[1]) * every + half) * step
    filters = np.linalg.solve(basis.T @ weighted, weighted.T)
    fit = windows @ filters.T
    coverage = np.ones(fit.shape[:2])
    products = (weighted[:, :, None] * basis[:, None, :]).reshape(tau.size, TERMS * TERMS)
    for which in range(2):
        broken = np.flatnonzero(np.isnan(fit[which, :, 0]))
        if broken.size:
            part = windows[which, broken]
            present = np.isfinite(part)
            coverage[which, broken] = present @ weight / weight.sum()
            normal = (present.astype(np.float64) @ products).reshape(-1, TERMS, TERMS)
            right = np.where(present, part, 0.0) @ weighted
            usable = coverage[which, broken] >= LEAST_COVERAGE
            fit[which, broken[usable]] = np.linalg.solve(normal[usable], right[usable][:, :, None])[:, :, 0]
    return centres, fit, coverage, filters


def _uneven(series: Sequence[Series], centres: Floats, half_length: float, frequency: float) -> tuple[Floats, Floats]:
    fit = np.full((2, centres.size, TERMS), np.nan)
    coverage = np.zeros((2, centres.size))
    for which, (time, values) in enumerate(series):
        low = np.searchsorted(time, centres - half_length)
        high = np.searchsorted(time, centres + half_length)
        spread = float(time[-1]) / (time.size - 1)
        full = _kaiser(np.arange(-half_length, half_length, spread) / half_length).sum()
        for k, centre in enumerate(centres):
            part = slice(low[k], high[k])
            present = np.isfinite(values[part])
            tau = time[part][present] - centre
            weight = _kaiser(tau / half_length)
            coverage[which, k] = weight.sum() / full
            if coverage[which, k] >= LEAST_COVERAGE and tau.size > TERMS:
                root = np.sqrt(weight)
                basis = root[:, None] * _basis(tau, half_length, frequency)
                fit[which, k] = np.linalg.lstsq(basis, root * values[part][present], rcond=None)[0]
    return fit, np.minimum(coverage, 1.0)
