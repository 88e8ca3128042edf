"""The envelope of a near-resonant harmonic and the slow part beside it, by weighted least squares in windows.

In a window the series is fitted by {cos, sin, 1, t}, or with {t cos, t sin, t^2 cos, t^2 sin} beside them: a harmonic
with an amplitude and phase that may change quadratically, on a slow part. Where all samples are there the fit is one
set of filter taps, for all windows a few small matrix products; where samples are missing the same fit is solved on
those present, so a gap is never filled.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Complexes, Floats

IMAGE_BEATS = 2.0  # beats with the image at the negative frequency that a window must hold to tell them apart
BLOCK_SECONDS = 4.0
WINDOW_SECONDS = 16.0
HOP_SECONDS = 1.0
KAISER_SHAPE = 14.0
BLOCK_COVERAGE, LEAST_COVERAGE = 0.5, 0.7  # of a window's weight; an instant with less has no value
PLAIN, WHOLE = 4, 8  # functions of the basis


@dataclass(frozen=True)
class Envelope:
    """`theta(t) = Re[Z(t) exp(i n0 t)] + slow(t)` for the first pendulum and for the difference.

    Attributes
    ----------
    time : (k,) array
        Uniform instants, s from the first sample of the record.
    carrier : float
        n0, rad s-1.
    first, difference : (k,) complex arrays
        Z1 and D relative to the carrier, rad; NaN where the window holds too few samples.
    first_speed, difference_speed : (k,) complex arrays
        Their time derivatives, rad s-1.
    slow : (2, k) array
        Slow part of first pendulum and difference, rad.
    coverage : (k,) array
        Share of the window's weight that held samples of the difference, 0..1.
    samples : (2,) array
        Number of samples of first pendulum and difference that each instant stands for (hop x rate x coverage).
    noise_gain : float
        Variance of one component of an envelope (mean of the two) per variance of white reading noise, complete window.
    taps : (m,) complex array
        Weights of a complete window's samples in the amplitude, counted from its own centre.
    """

    time: Floats
    carrier: float
    first: Complexes
    difference: Complexes
    first_speed: Complexes
    difference_speed: Complexes
    slow: Floats
    coverage: Floats
    samples: Floats
    noise_gain: float
    taps: Complexes

    def influence(self, by_instant: Complexes, count: int, every: int) -> Floats:
        """Influence of every sample of the difference on `Re sum conj(by_instant) D`, (count,).

        `count` samples, from window to window `every` of them.

        Counting each instant's noise as white and round is right only where the image of the harmonic is far off.
        """
        out = np.zeros(count)
        turned = np.conj(by_instant) * np.exp(-1j * self.carrier * self.time)
        for k, weight in enumerate(turned):
            out[k * every : k * every + self.taps.size] += (weight * self.taps).real
        return out

    @property
    def share(self) -> Complexes:
        """Z1/D, NaN where either is missing."""
        out = np.full(self.first.size, np.nan, dtype=np.complex128)
        present = np.isfinite(self.first) & np.isfinite(self.difference) & (self.difference != 0.0)
        np.divide(self.first, self.difference, out=out, where=present)
        return out

    @property
    def hop(self) -> float:
        """Distance of the instants, s."""
        return float(self.time[1] - self.time[0])


def image_distance(frequency: float, mean_step: float) -> float:
    """Distance of the harmonic from its image after sampling, rad s-1.

    At half-second marks a pendulum of 1.01 s is sampled twice a swing, and its image lies at 0.124 rad s-1.
    """
    nyquist = np.pi / mean_step
    folded = np.abs((2.0 * frequency + nyquist) % (2.0 * nyquist) - nyquist)
    return float(folded)


def window_length(frequency: float, mean_step: float, wanted: float, duration: float) -> float:
    """Length of the window, s: `wanted`, longer where the image is near, at most a third of the record."""
    needed = IMAGE_BEATS * 2.0 * np.pi / max(image_distance(frequency, mean_step), 1e-9)
    return float(min(max(wanted, needed), duration / 3.0))


def fill(values: Complexes) -> Complexes:
    """Linear interpolation of an INPUT's envelope across missing instants (never of the difference)."""
    present = np.isfinite(values)
    if present.all():
        return values
    where = np.arange(values.size)
    return np.asarray(
        np.interp(where, where[present], values.real[present])
        + 1j * np.interp(where, where[present], values.imag[present])
    )


@dataclass(frozen=True)
class Window:
    """Basis (rows, terms) and weight (rows,) of a window, and the taps (terms, rows) of one without gaps."""

    basis: Floats
    weight: Floats
    taps: Floats


@functools.lru_cache(maxsize=64)
def window(rows: int, step: float, frequency: float, terms: int) -> Window:
    """A window of so many samples: all of one weight, or by Kaiser where the basis is whole."""
    tau = (np.arange(rows) - 0.5 * (rows - 1)) * step
    x = tau / half_length(rows, step, terms)
    cos, sin = np.cos(frequency * tau), np.sin(frequency * tau)
    functions = [cos, sin, np.ones_like(x), x, x * cos, x * sin, x * x * cos, x * x * sin]
    basis = np.stack(functions[:terms], axis=-1)
    weight = np.ones(rows)
    if terms == WHOLE:
        weight = np.i0(KAISER_SHAPE * np.sqrt(np.clip(1.0 - x * x, 0.0, None))) / np.i0(KAISER_SHAPE)
    weighted = weight * basis.T
    return Window(basis, weight, np.linalg.pinv(weighted @ basis) @ weighted)


def half_length(rows: int, step: float, terms: int) -> float:
    """Half the length of a window, s: up to its last sample, or to where the next block begins."""
    return 0.5 * step * (rows - 1 if terms == WHOLE else rows)


def block_envelope(time: Floats, step: float, first: Floats, difference: Floats, frequency: float) -> Envelope:
    """Cheap envelope of both series at the centres of adjoining blocks: starts the exact fits, weighs their budget.

    Parameters
    ----------
    time, first, difference : (n,) arrays
        s, rad, rad; NaN = missing.
    step : float
        Sampling step, s.
    frequency : float
        Carrier, rad s-1.
    """
    length = window_length(frequency, step, BLOCK_SECONDS, float(time[-1]) + step)
    rows = max(4, round(length / step))
    return _envelope(first, difference, step, frequency, rows, rows, PLAIN)


def sliding_envelope(time: Floats, step: float, first: Floats, difference: Floats, frequency: float) -> Envelope:
    """Envelope of both series at instants `HOP_SECONDS` apart (further where the window must be long).

    Flat at the pendulum's frequency, and some 95 dB down where swell is; parameters as of `block_envelope`.
    """
    length = window_length(frequency, step, WINDOW_SECONDS, float(time[-1]) + step)
    half = max(8, round(0.5 * length / step))
    every = max(1, round(HOP_SECONDS * max(1.0, length / WINDOW_SECONDS) / step))
    return _envelope(first, difference, step, frequency, 2 * half + 1, every, WHOLE)


def _envelope(
    first: Floats, difference: Floats, step: float, frequency: float, rows: int, every: int, terms: int
) -> Envelope:
    made, half = window(rows, step, frequency, terms), half_length(rows, step, terms)
    least = LEAST_COVERAGE if terms == WHOLE else BLOCK_COVERAGE
    fits = [fit_windows(series, made, every, least) for series in (first, difference)]
    fit, coverage = (np.stack(each) for each in zip(*fits, strict=True))
    centres = (np.arange(fit.shape[2]) * every + 0.5 * (rows - 1)) * step
    carrier = np.exp(-1j * frequency * centres)
    amplitude: Complexes = (fit[:, 0] - 1j * fit[:, 1]) * carrier
    if terms == WHOLE:
        speed: Complexes = (fit[:, 4] - 1j * fit[:, 5]) * carrier / half
    else:
        speed = np.asarray(np.gradient(amplitude, every * step, axis=1))
    return Envelope(
        time=centres,
        carrier=frequency,
        first=amplitude[0],
        difference=amplitude[1],
        first_speed=speed[0],
        difference_speed=speed[1],
        slow=fit[:, 2],
        coverage=coverage[1],
        samples=coverage.mean(axis=1) * every,
        noise_gain=float(0.5 * np.sum(made.taps[:2] ** 2)),
        taps=made.taps[0] - 1j * made.taps[1],
    )


def fit_windows(series: Floats, made: Window, every: int, least: float) -> tuple[Floats, Floats]:
    """Coefficients (terms, k) of windows `every` samples apart, NaN where too little is there; coverage (k,)."""
    rows, terms = made.basis.shape
    hops = -(-rows // every)  # a window as so many stretches from one window's start to the next
    taps = np.zeros((terms, hops * every))
    taps[:, :rows] = made.taps
    count = (series.size - rows) // every + 1
    out, coverage = np.zeros((terms, count)), np.ones(count)
    here = series[: (count - 1 + hops) * every]
    stretches = np.pad(here, (0, (count - 1 + hops) * every - here.size)).reshape(-1, every)
    for hop in range(hops):
        out += taps[:, hop * every : (hop + 1) * every] @ stretches[hop : hop + count].T
    for k in np.flatnonzero(np.isnan(out[0])):
        values = series[k * every : k * every + rows]
        present = np.isfinite(values)
        coverage[k] = made.weight[present].sum() / made.weight.sum()
        out[:, k] = np.nan
        if coverage[k] >= least and present.sum() >= 2 * terms:
            weighted = made.weight[present] * made.basis[present].T
            out[:, k] = np.linalg.pinv(weighted @ made.basis[present]) @ (weighted @ values[present])
    return out, coverage
