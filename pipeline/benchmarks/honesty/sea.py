"""Random motion of a ship as sums of harmonics: seas of a JONSWAP form, and single lines of machinery."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Complexes = NDArray[np.complex128]
Floats = NDArray[np.float64]

_HARMONICS = 48
_LOW, _HIGH = 0.6, 2.6
"""Of the peak's frequency: below there is nothing; depth, or a hull longer than the waves, cuts above."""
_PEAK_FACTOR = 3.3  # Hasselmann and others, JONSWAP, 1973
_HULL = 0.5  # rad: how far from 90 degrees a hull turns sway against heave


class Motion(NamedTuple):
    """Accelerations of the support, Re sum (amplitude e^{i rate t}), m/s^2."""

    rate: Floats
    """rad/s, (harmonics,)."""
    across: Complexes
    """x'', (harmonics,)."""
    along: Complexes
    """z'', up positive, (harmonics,)."""


def jonswap(frequency: Floats, peak: float) -> Floats:
    """Spectrum of the surface's elevation, in arbitrary units, by frequency in Hz."""
    width = np.where(frequency <= peak, 0.07, 0.09)
    bump = _PEAK_FACTOR ** np.exp(-0.5 * ((frequency / peak - 1.0) / width) ** 2)
    return frequency**-5.0 * np.exp(-1.25 * (peak / frequency) ** 4) * bump


def sea(random: np.random.Generator, period: float, across: float, along: float) -> Motion:
    """A sea of given peak period, with harmonics at random frequencies, amplitudes and phases.

    Parameters
    ----------
    random : Generator
    period : float
        Of the peak, s.
    across, along : float
        Root mean square of x'' and z'', m/s^2.

    Returns
    -------
    Motion
        Particles move in circles, x'' a quarter of a swing from z'', but for what a hull adds to each harmonic.
    """
    edges = np.linspace(_LOW, _HIGH, _HARMONICS + 1) / period
    frequency = random.uniform(edges[:-1], edges[1:])
    # the acceleration's spectrum is w^4 times the elevation's; Rayleigh amplitudes make a Gaussian sea
    size = np.sqrt(jonswap(frequency, 1.0 / period)) * frequency**2 * random.rayleigh(size=_HARMONICS)
    size /= math.sqrt(0.5 * float(np.sum(size**2)))
    phase = random.uniform(0.0, 2.0 * math.pi, _HARMONICS)
    turned = phase + random.choice([-1, 1]) * 0.5 * math.pi + random.uniform(-_HULL, _HULL, _HARMONICS)
    return Motion(2.0 * math.pi * frequency, across * size * np.exp(1j * turned), along * size * np.exp(1j * phase))


def line(random: np.random.Generator, frequency: float, across: float, along: float) -> Motion:
    """One harmonic of given frequency in Hz and amplitudes in m/s^2, of random phases."""
    phases = np.exp(1j * random.uniform(0.0, 2.0 * math.pi, 2))
    return Motion(np.array([2.0 * math.pi * frequency]), across * phases[:1], along * phases[1:])


def total(parts: list[Motion]) -> Motion:
    """All harmonics of several motions."""
    return Motion(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def at(times: Floats, rate: Floats, amplitude: Complexes) -> Floats:
    """The acceleration at given times."""
    out = np.zeros(times.size)
    for speed, size in zip(rate, amplitude, strict=True):
        out += (size * np.exp(1j * speed * times)).real
    return out
