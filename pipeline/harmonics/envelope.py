"""The envelope of a near-resonant harmonic, and what sets the window in which it can be told apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Complexes, Floats

IMAGE_BEATS = 2.0  # beats with the image at the negative frequency that a window must hold to tell them apart


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
