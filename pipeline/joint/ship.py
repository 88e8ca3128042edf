"""What is assumed of the ship: second derivatives of stationary displacements, and smooth vibration beside them.

A sea component of the displacement is a chain of three damped oscillators of one frequency w and damping l, driven by
white noise:

    p'' + 2 l p' + w^2 p = white,   r'' + 2 l r' + w^2 r = w^2 p,   v'' + 2 l v' + w^2 v = r,   output v''

The output vanishes at zero frequency as the fourth power, without which gravity could not be observed beside an unknown
vertical acceleration, and falls as the eighth above w, without which the acceleration at twice the frequency of the
swing, which acts as a change of gravity, would be left open. Vibration is a Matern process of smoothness 5/2: a rougher
one costs up to .05 mGal on noise-free records.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal, get_args

import numpy as np

from pipeline.arrays import Floats

Axis = Literal["horizontal", "transverse", "vertical", "tilt"]
"""Of an acceleration over reference gravity; or the angle, rad, of the case from which elongations are measured.
Transverse: what all pendulums but the first feel, whose planes of swing are not parallel to its own."""
FASTEST = 60.0  # s-1, rate of a vibration that the steps of a lattice follow
ROUGHEST = 10.0  # of gravity, rms of a sea: none is rougher, and rounding would take the sign of its covariance
LOUDEST = 0.05  # the same of a line of vertical vibration: a ship that shakes so is not lived in
FASTEST_HEAVE = 7.0  # rad s-1, of the sea: what is faster has no sidebands, or acts as gravity does
NARROWEST, BROADEST, LINE = 0.01, 0.7, 1e-4  # of the frequency, a sea's damping; least of a line's
SWELL = 3.0  # rad s-1: what is narrower than a sea, and slower, is one still


def _chain(frequency: float, damping: float, oscillators: int) -> Floats:
    one = np.array([[0.0, 1.0], [-(frequency**2), -2.0 * damping]])
    return np.kron(np.eye(oscillators), one)


def _resonance(own: float, damping: float, frequency: Floats) -> Floats:
    return np.asarray(1.0 / ((own**2 - frequency**2) ** 2 + (2.0 * damping * frequency) ** 2))


@dataclass(frozen=True)
class Oscillators:
    """A chain of damped oscillators driven by white noise; an acceleration in units of reference gravity."""

    frequency: float
    damping: float  # Of each oscillator, rad s-1 and s-1
    rms: float  # Of the acceleration over reference gravity
    axis: Axis = "horizontal"

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

    def density(self, frequency: Floats) -> Floats:
        """Two-sided power spectral density."""
        unit = self.rms**2 * 512.0 / 3.0 * self.damping**5 * self.frequency**2
        return unit * frequency**4 * _resonance(self.frequency, self.damping, frequency) ** 3


@dataclass(frozen=True)
class Engine(Oscillators):
    """A narrow line: the speed of the second of two oscillators."""

    def system(self) -> tuple[Floats, Floats, int]:
        """Drift matrix (4, 4), output row (4,), and the state that is driven."""
        drift = _chain(self.frequency, self.damping, 2)
        drift[3, 0] = self.frequency**2
        return drift, np.array([0.0, 0.0, 0.0, 1.0]), 1

    def density(self, frequency: Floats) -> Floats:
        """Two-sided power spectral density."""
        unit = self.rms**2 * 32.0 * self.damping**3 * self.frequency**2
        return unit * frequency**2 * _resonance(self.frequency, self.damping, frequency) ** 2


@dataclass(frozen=True)
class Vibration:
    """A smooth broad-band component: Matern process of smoothness 5/2."""

    rate: float  # Inverse of the correlation time, s-1
    rms: float  # Of the acceleration over reference gravity
    axis: Axis = "horizontal"

    def system(self) -> tuple[Floats, Floats, int]:
        """Drift matrix (3, 3), output row (3,), and the state that is driven."""
        a = self.rate
        drift = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-(a**3), -3.0 * a**2, -3.0 * a]])
        return drift, np.array([1.0, 0.0, 0.0]), 2

    @property
    def peak(self) -> float:
        """Frequency up to which it is white, rad s-1."""
        return self.rate

    def density(self, frequency: Floats) -> Floats:
        """Two-sided power spectral density."""
        return np.asarray(self.rms**2 * 16.0 / 3.0 * self.rate**5 / (self.rate**2 + frequency**2) ** 3)


Component = Sea | Vibration | Engine


@dataclass(frozen=True)
class Ship:
    """All components as one linear system driven by white noise."""

    drift: Floats  # (s, s) block diagonal
    drive: Floats  # (s, s) intensity of the white noise, diagonal
    stationary: Floats  # (s, s) covariance in the steady state
    horizontal: Floats
    transverse: Floats
    vertical: Floats
    tilt: Floats  # (s,) rows that give the accelerations over reference gravity, and the case's angle, rad

    @staticmethod
    @lru_cache(maxsize=4)
    def of(components: tuple[Component, ...]) -> "Ship":
        """Lay the components side by side."""
        from scipy.linalg import block_diag, solve_continuous_lyapunov

        drifts, drives, steady = [], [], []
        size, at = sum(component.system()[1].size for component in components), 0
        rows = {axis: np.zeros(size) for axis in get_args(Axis)}
        for component in components:
            drift, row, driven = component.system()
            drive = np.zeros_like(drift)
            drive[driven, driven] = 1.0
            covariance = solve_continuous_lyapunov(drift, -drive)
            scale = component.rms**2 / float(row @ covariance @ row)
            drifts.append(drift)
            drives.append(scale * drive)
            steady.append(scale * 0.5 * (covariance + covariance.T))
            rows[component.axis][at : at + row.size] = row
            at += row.size
        if not components:
            return Ship(*np.zeros((3, 0, 0)), **rows)
        return Ship(block_diag(*drifts), block_diag(*drives), block_diag(*steady), **rows)


def density(components: tuple[Component, ...], frequency: Floats, axis: Axis) -> Floats:
    """Two-sided power spectral density of the acceleration over reference gravity at frequencies in rad s-1, (f,)."""
    return sum((each.density(frequency) for each in components if each.axis == axis), np.zeros(frequency.shape))


def parameters(components: tuple[Component, ...]) -> Floats:
    """Logarithms of frequency or rate, relative damping and size of all components."""
    out: list[float] = []
    for each in components:
        width = [] if isinstance(each, Vibration) else [each.damping / each.frequency]
        out += [each.peak, *width, each.rms]
    return np.log(out)


def spreads(components: tuple[Component, ...], loose: float = 1.0) -> Floats:
    """1 sigma of the logarithms of `parameters` about what a spectrum gives; of widths and sizes so much looser."""
    out: list[float] = []
    for each in components:
        out += [0.3, 2.0 * loose] if isinstance(each, Vibration) else [0.2, 0.7 * loose, 1.0 * loose]
    return np.array(out)


def assemble(like: tuple[Component, ...], vector: Floats) -> tuple[Component, ...]:
    """Components of the same kinds with other numbers; a sea that is too narrow for one becomes a line."""
    values = iter(np.exp(vector).tolist())
    out: list[Component] = []
    for each in like:
        if isinstance(each, Vibration):
            out.append(replace(each, rate=min(next(values), FASTEST), rms=next(values)))
            continue
        frequency, width, size = next(values), next(values), min(next(values), ROUGHEST)
        kind = Engine if isinstance(each, Engine) or (width < NARROWEST and frequency > SWELL) else Sea
        if each.axis == "vertical":
            frequency, size = (min(frequency, FASTEST_HEAVE), size) if kind is Sea else (frequency, min(size, LOUDEST))
        width = max(width, NARROWEST if kind is Sea else LINE)
        out.append(kind(frequency, frequency * min(width, BROADEST), size, each.axis))
    return tuple(out)
