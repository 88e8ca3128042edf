"""What is assumed of the ship: second derivatives of stationary displacements, and smooth vibration beside them.

The ship stays where it is. A sea component of its displacement is a chain of three damped oscillators of one frequency
w and damping l, driven by white noise:

    p'' + 2 l p' + w^2 p = white,   r'' + 2 l r' + w^2 r = w^2 p,   v'' + 2 l v' + w^2 v = r,   output v''

The output vanishes at zero frequency as the fourth power, without which gravity could not be observed beside an
unknown vertical acceleration, and falls as the eighth power above w, without which the acceleration at twice the
frequency of the swing, which acts as a change of gravity, would be left open. Vibration is a Matern process of
smoothness 5/2: a rougher one costs up to .05 mGal on noise-free records.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from pipeline.arrays import Floats

Axis = Literal["horizontal", "transverse", "vertical", "tilt"]
"""Of an acceleration over reference gravity; or the angle, rad, of the case from which elongations are measured."""


def _chain(frequency: float, damping: float, oscillators: int) -> Floats:
    drift = np.zeros((2 * oscillators, 2 * oscillators))
    for k in range(0, 2 * oscillators, 2):
        drift[k, k + 1], drift[k + 1, k], drift[k + 1, k + 1] = 1.0, -(frequency**2), -2.0 * damping
    return drift


def _answer(own: float, damping: float, frequency: Floats) -> Floats:
    return np.asarray(1.0 / ((own**2 - frequency**2) ** 2 + (2.0 * damping * frequency) ** 2))


@dataclass(frozen=True)
class Oscillators:
    """A chain of damped oscillators driven by white noise; an acceleration in units of reference gravity."""

    frequency: float
    damping: float  # Of each oscillator, rad s-1 and s-1
    rms: float  # Of the acceleration over reference gravity
    axis: Axis = "horizontal"
    """Transverse: what all pendulums but the first feel, whose planes of swing are not parallel to its own."""

    @property
    def peak(self) -> float:
        """Frequency that it is named by, rad s-1."""
        return self.frequency


@dataclass(frozen=True)
class Sea(Oscillators):
    """Acceleration of a displacement that three oscillators pass on, as above."""

    def system(self) -> tuple[Floats, Floats, int]:
        """Drift matrix (6, 6), output row (6,), and the state that is driven."""
        w, l = self.frequency, self.damping  # noqa: E741  # symbols of the equation above
        drift = _chain(w, l, 3)
        drift[3, 0], drift[5, 2] = w * w, 1.0
        return drift, np.array([0.0, 0.0, 1.0, 0.0, -w * w, -2.0 * l]), 1

    @property
    def unit_variance(self) -> float:
        """Variance under a drive of unit intensity."""
        return 3.0 * self.frequency**2 / (512.0 * self.damping**5)

    def shape(self, frequency: Floats) -> Floats:
        """Two-sided spectral density for a drive of unit intensity."""
        return self.frequency**4 * frequency**4 * _answer(self.frequency, self.damping, frequency) ** 3


@dataclass(frozen=True)
class Engine(Oscillators):
    """A narrow line: the speed of the second of two oscillators."""

    def system(self) -> tuple[Floats, Floats, int]:
        """Drift matrix (4, 4), output row (4,), and the state that is driven."""
        drift = _chain(self.frequency, self.damping, 2)
        drift[3, 0] = self.frequency**2
        return drift, np.array([0.0, 0.0, 0.0, 1.0]), 1

    @property
    def unit_variance(self) -> float:
        """Variance under a drive of unit intensity."""
        return self.frequency**2 / (32.0 * self.damping**3)

    def shape(self, frequency: Floats) -> Floats:
        """Two-sided spectral density for a drive of unit intensity."""
        return self.frequency**4 * frequency**2 * _answer(self.frequency, self.damping, frequency) ** 2


@dataclass(frozen=True)
class Vibration:
    """A smooth broad-band component: Matern process of smoothness 5/2."""

    rate: float  # Inverse of the correlation time, s-1
    rms: float  # Of the acceleration over reference gravity
    axis: Axis = "horizontal"
    """Transverse: what all pendulums but the first feel, whose planes of swing are not parallel to its own."""

    def system(self) -> tuple[Floats, Floats, int]:
        """Drift matrix (3, 3), output row (3,), and the state that is driven."""
        a = self.rate
        drift = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-(a**3), -3.0 * a**2, -3.0 * a]])
        return drift, np.array([1.0, 0.0, 0.0]), 2

    @property
    def peak(self) -> float:
        """Frequency up to which it is white, rad s-1."""
        return self.rate

    @property
    def unit_variance(self) -> float:
        """Variance under a drive of unit intensity."""
        return 3.0 / (16.0 * self.rate**5)

    def shape(self, frequency: Floats) -> Floats:
        """Two-sided spectral density for a drive of unit intensity."""
        return 1.0 / (self.rate**2 + frequency**2) ** 3


Component = Sea | Vibration | Engine


@dataclass(frozen=True)
class Ship:
    """All components as one linear system driven by white noise.

    Attributes
    ----------
    drift : (s, s) array
        Block diagonal.
    drive : (s, s) array
        Intensity of the white noise, diagonal.
    horizontal, vertical : (s,) arrays
        Rows that give the two accelerations over reference gravity.
    tilt : (s,) array
        The same of the case's angle, rad.
    stationary : (s, s) array
        Covariance in the steady state.
    """

    drift: Floats
    drive: Floats
    horizontal: Floats
    transverse: Floats
    vertical: Floats
    tilt: Floats
    stationary: Floats

    @staticmethod
    @lru_cache(maxsize=4)
    def of(components: tuple[Component, ...]) -> Ship:
        """Lay the components side by side."""
        from scipy.linalg import solve_continuous_lyapunov

        systems = [component.system() for component in components]
        size = sum(row.size for _, row, _ in systems)
        drift, drive, stationary = np.zeros((size, size)), np.zeros((size, size)), np.zeros((size, size))
        rows = {axis: np.zeros(size) for axis in ("horizontal", "transverse", "vertical", "tilt")}
        at = 0
        for component, (own, row, driven) in zip(components, systems, strict=True):
            here = slice(at, at + row.size)
            white = np.zeros_like(own)
            white[driven, driven] = 1.0
            steady = solve_continuous_lyapunov(own, -white)
            scale = component.rms**2 / component.unit_variance
            drift[here, here], rows[component.axis][here] = own, row
            drive[here, here], stationary[here, here] = scale * white, scale * 0.5 * (steady + steady.T)
            at += row.size
        return Ship(drift=drift, drive=drive, **rows, stationary=stationary)


def density(components: tuple[Component, ...], frequency: Floats, axis: Axis) -> Floats:
    """Two-sided power spectral density of the acceleration over reference gravity at frequencies in rad s-1, (f,)."""
    total = np.zeros(frequency.shape)
    for component in components:
        if component.axis == axis:
            total += component.rms**2 / component.unit_variance * component.shape(frequency)
    return total
