"""Phase and amplitude of every pendulum at common instants, one a swing: weighted fits of a few swings each.

In a Hann window a reading is {1, x} x {cos, sin} at the pendulum's own frequency, on a constant. Missing readings are
left out, never filled; an instant with less than half of its window has no phase.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats, unwrapped

SWINGS = 6.0  # Length of a window, in swings: what the phases of both do within it is averaged
LEAST_COVERAGE = 0.5
_LEAST_SWINGS = 12.0
_LEAST_READINGS = 12  # of a window
_TERMS = 5
_PADDING = 4


class Phases(NamedTuple):
    """Of every pendulum; phi(t) = frequency t + what drifts, theta = amplitude cos phi."""

    time: Floats  # (instants,) evenly spaced, s from the record's first reading
    phase: Floats  # (pendulums, instants) rad, unwrapped; NaN where too little was read
    amplitude: Floats  # (pendulums, instants) rad
    sigma: Floats  # (pendulums, instants) rad: one sigma of the phase, from what the fit leaves
    frequency: Floats  # (pendulums,) mean, rad s-1
    window: float  # s


def phases(time: Floats, elongation: Floats) -> Phases:
    """Follow the phases of pendulums by elongations (pendulums, n), rad, NaN = missing, at times (n,), s, from 0 on.

    `RefusedError` if one does not swing, for too few swings or readings.

    Examples
    --------
    >>> t = np.arange(2000) * 0.05
    >>> found = phases(t, np.stack([0.1 * np.cos(6.0 * t), 0.2 * np.sin(6.1 * t)]))
    >>> np.round(found.frequency, 6), np.round(found.amplitude[:, 0], 6)
    (array([6. , 6.1]), array([0.1, 0.2]))
    """
    start = np.array([_frequency(time, row) for row in elongation])
    period = 2.0 * np.pi / float(start.min())
    duration, spacing = float(time[-1]), float(np.median(np.diff(time)))
    if duration < _LEAST_SWINGS * period:
        raise RefusedError(f"synchrony: {duration / period:.1f} swings are too few; record {_LEAST_SWINGS:g} or more")
    window = max(SWINGS * period, _LEAST_READINGS * spacing)
    if window > 0.5 * duration:
        raise RefusedError(f"synchrony: readings {spacing:g} s apart are too few for {duration:g} s; record more often")
    centres = np.arange(0.5 * window, duration - 0.5 * window + 0.25 * period, period)
    rows = [_followed(time, row, centres, window, each) for row, each in zip(elongation, start, strict=True)]
    turned = np.stack([row[0] for row in rows])
    known = np.isfinite(turned)
    if known.sum(axis=1).min() < 2:
        raise RefusedError("synchrony: a pendulum was hardly read; leave its trace out")
    mean = np.array([np.polyfit(centres[at], each[at], 1)[0] for at, each in zip(known, turned, strict=True)])
    return Phases(centres, turned, np.stack([row[1] for row in rows]), np.stack([row[2] for row in rows]), mean, window)


def _frequency(time: Floats, values: Floats) -> float:
    """Largest peak of the spectrum, rad/s, to a tenth of a line."""
    present = np.isfinite(values)
    if present.sum() < _LEAST_READINGS or not np.ptp(values[present]) > 0.0:
        raise RefusedError("synchrony: a pendulum does not swing, or was hardly read; leave its trace out")
    step = float(np.median(np.diff(time)))
    grid = np.arange(round(float(time[-1]) / step) + 1) * step
    even = np.interp(grid, time[present], values[present])
    size = np.abs(np.fft.rfft((even - even.mean()) * np.hanning(even.size), _PADDING * even.size))
    top = int(np.clip(np.argmax(size), 1, size.size - 2))
    before, here, after = np.log(np.maximum(size[top - 1 : top + 2], 1e-300))
    bend = before - 2.0 * here + after
    shift = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return float(2.0 * np.pi * (top + shift) / (_PADDING * even.size * step))


def _followed(
    time: Floats, values: Floats, centres: Floats, window: float, frequency: float
) -> tuple[Floats, Floats, Floats]:
    """Unwrapped phase, amplitude and sigma of the phase at the centres."""
    harmonic = np.full(centres.size, np.nan + 0j, dtype=np.complex128)
    sigma = np.full(centres.size, np.nan)
    low, high = np.searchsorted(time, centres - 0.5 * window), np.searchsorted(time, centres + 0.5 * window, "right")
    spacing = float(np.median(np.diff(time)))
    for k, centre in enumerate(centres):
        part = slice(low[k], high[k])
        present = np.isfinite(values[part])
        tau, seen = time[part][present] - centre, values[part][present]
        weight = np.cos(np.pi * tau / window) ** 2
        if tau.size <= 2 * _TERMS or weight.sum() < LEAST_COVERAGE * 0.5 * window / spacing:
            continue
        harmonic[k], sigma[k] = _fit(tau, seen, weight, frequency)
    size = np.abs(harmonic)
    with np.errstate(invalid="ignore", divide="ignore"):
        sigma = sigma / size
    carrier = frequency * centres
    # across a gap the nearest turn is taken
    return unwrapped((harmonic * np.exp(-1j * carrier))[None])[0] + carrier, size, sigma


def _fit(tau: Floats, seen: Floats, weight: Floats, frequency: float) -> tuple[complex, float]:
    """The harmonic at the centre, and one sigma of one of its two parts."""
    cosine, sine = np.cos(frequency * tau), np.sin(frequency * tau)
    basis = np.stack([cosine, sine, tau * cosine, tau * sine, np.ones_like(tau)])
    weighted = basis * weight
    normal = weighted @ basis.T
    inverse = np.linalg.inv(normal)
    parts = inverse @ (weighted @ seen)
    left = seen - parts @ basis
    variance = float(weight @ (left * left)) / float(weight.sum()) * seen.size / (seen.size - _TERMS)
    spread = inverse @ (weighted @ weighted.T) @ inverse
    return complex(parts[0], -parts[1]), float(np.sqrt(0.5 * variance * (spread[0, 0] + spread[1, 1])))
