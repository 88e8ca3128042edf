"""The envelope of a near-resonant harmonic and the slow part beside it, by weighted least squares in windows.

In a window, weighted by Kaiser, the series is fitted by {1, t} and {1, t, t^2} x {cos, sin}: a harmonic with an
amplitude and phase that may change quadratically, on a slow part. Where all samples are there the fit is one set of
filter taps, for all windows a few small matrix products; where samples are missing the same fit is solved on those
present, so a gap is never filled.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Complexes, Floats

IMAGE_BEATS = 2.0  # beats with the image at the negative frequency that a window must hold to tell them apart
WINDOW_SECONDS = 16.0
HOP_SECONDS = 1.0
KAISER_SHAPE = 14.0
LEAST_COVERAGE = 0.7  # of a window's weight; an instant with less has no value


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


def window_length(frequency: float, mean_step: float, duration: float) -> float:
    """Length of the window, s, longer where the image is near, at most a third of the record."""
    needed = IMAGE_BEATS * 2.0 * np.pi / max(image_distance(frequency, mean_step), 1e-9)
    return float(min(max(WINDOW_SECONDS, needed), duration / 3.0))


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


def sliding_envelope(time: Floats, step: float, first: Floats, difference: Floats, frequency: float) -> Envelope:
    """Envelope of both series at instants `HOP_SECONDS` apart (further where the window must be long).

    Flat at the pendulum's frequency, and some 95 dB down where swell is.

    Parameters
    ----------
    time, first, difference : (n,) arrays
        s, rad, rad; NaN = missing.
    step : float
        Sampling step, s.
    frequency : float
        Carrier, rad s-1.
    """
    length = window_length(frequency, step, float(time[-1]) + step)
    half = max(8, round(0.5 * length / step))
    every = max(1, round(HOP_SECONDS * max(1.0, length / WINDOW_SECONDS) / step))
    basis, weight = window(half, step, frequency)
    fits = [fit_windows(series, basis, weight, every) for series in (first, difference)]
    fit, coverage = (np.stack(each) for each in zip(*fits, strict=True))
    centres = (np.arange(fit.shape[2]) * every + half) * step
    carrier = np.exp(-1j * frequency * centres)
    amplitude: Complexes = (fit[:, 0] - 1j * fit[:, 1]) * carrier
    speed: Complexes = (fit[:, 4] - 1j * fit[:, 5]) * carrier / (half * step)
    taps = weighted_inverse(basis, weight)[:2]
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
        noise_gain=float(0.5 * np.sum(taps**2)),
        taps=taps[0] - 1j * taps[1],
    )


def window(half: int, step: float, frequency: float) -> tuple[Floats, Floats]:
    """Basis (rows, 8) and Kaiser weight (rows,) of a window of `2 half + 1` samples."""
    x = np.arange(-half, half + 1) / half
    cos, sin = np.cos(frequency * half * step * x), np.sin(frequency * half * step * x)
    basis = np.stack([cos, sin, np.ones_like(x), x, x * cos, x * sin, x * x * cos, x * x * sin], axis=-1)
    return basis, np.kaiser(x.size, KAISER_SHAPE)


def weighted_inverse(basis: Floats, weight: Floats) -> Floats:
    """Taps (8, rows) that give the coefficients of a basis (rows, 8) by weighted least squares."""
    weighted = weight * basis.T
    return np.asarray(np.linalg.pinv(weighted @ basis) @ weighted)


def fit_windows(series: Floats, basis: Floats, weight: Floats, every: int) -> tuple[Floats, Floats]:
    """Coefficients (8, k) of windows `every` samples apart, NaN where too little is there; coverage (k,)."""
    rows, terms = basis.shape
    hops = -(-rows // every)  # a window as so many stretches from one window's start to the next
    taps = np.pad(weighted_inverse(basis, weight), ((0, 0), (0, hops * every - rows)))
    count = (series.size - rows) // every + 1
    out, coverage = np.zeros((terms, count)), np.ones(count)
    here = series[: (count - 1 + hops) * every]
    stretches = np.pad(here, (0, (count - 1 + hops) * every - here.size)).reshape(-1, every)
    for hop in range(hops):
        out += taps[:, hop * every : (hop + 1) * every] @ stretches[hop : hop + count].T
    for k in np.flatnonzero(np.isnan(out[0])):
        values = series[k * every : k * every + rows]
        present = np.isfinite(values)
        coverage[k] = weight[present].sum() / weight.sum()
        out[:, k] = np.nan
        if coverage[k] >= LEAST_COVERAGE and present.sum() >= 2 * terms:
            out[:, k] = weighted_inverse(basis[present], weight[present]) @ values[present]
    return out, coverage
