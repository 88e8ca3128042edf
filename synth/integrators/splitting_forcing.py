"""What the support does to a linear pendulum, exactly, at the times of the kicks and of the outputs."""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy as np

from synth.phase import Floats, Phasors, Turns, phasors, turns
from synth.systems.harmonic_motion import Harmonics

_NEAR = 0.05  # of n: nearer harmonics are counted from rest, since their forced motion grows without bound


class Swing(NamedTuple):
    """A linear pendulum on the grid of times."""

    frequency: float
    """n, rad/s."""
    damping: float
    """gamma, 1/s."""
    exact: Fraction
    """sqrt(n^2 - gamma^2), rad/s."""
    turns: Turns
    """Of the swing, by steps."""

    @property
    def damped(self) -> float:
        """`exact` as a double."""
        return float(self.exact)

    def phasors(self, index: np.ndarray, nodes: Floats, step: float) -> Phasors:
        """e^{i w t}, (index, nodes), with the phase at the grid right to the last bit."""
        between = np.exp(1j * self.damped * nodes * step)
        turned: Phasors = self.turns.phasors(index.astype(np.int64)).T * between[None, :]
        return turned


class Forcing:
    """Sums of harmonics on the grid of times `start + (k + node) step`.

    Parameters
    ----------
    motion : Harmonics or None
        Acceleration of the support.
    start : float
        Time of k = 0, s.
    step : Fraction
        s.
    """

    def __init__(self, motion: Harmonics | None, start: float, step: Fraction) -> None:
        if motion is None:
            motion = Harmonics(np.zeros((5, 1)))
        amplitude, *pieces, phase = motion.table
        parts = zip(*pieces, strict=True)
        turn = Fraction("6.283185307179586476925286766559005768394338798750211641949889184615632812572")
        exact = [sum((Fraction(float(part)) for part in row), Fraction(0)) * turn for row in parts]
        self.exact = exact
        self.rate = np.array([float(rate) for rate in exact])
        self.turns = turns(exact, step)
        self.step = float(step)
        begin = np.array([float(Fraction(start) * rate / turn % 1) for rate in exact])
        self.size: Phasors = amplitude * phasors(2.0 * np.pi * (begin + phase))

    def grid(self, index: np.ndarray, nodes: Floats, factors: Phasors) -> Floats:
        """Return sum over harmonics of Re[factor size e^{i rate t}], (index, nodes)."""
        whole = self.turns.phasors(index.astype(np.int64)).T
        part = (factors * self.size)[:, None] * np.exp(1j * self.rate[:, None] * (nodes * self.step)[None, :])
        result: Floats = whole.real @ part.real - whole.imag @ part.imag
        return result

    def level(self, index: np.ndarray, nodes: Floats) -> Floats:
        """Acceleration, m/s^2."""
        return self.grid(index, nodes, np.ones(self.size.size, dtype=np.complex128))

    def response(self, index: np.ndarray, nodes: Floats, swing: Swing, gravity: float) -> tuple[Floats, Floats]:
        """Forced angle psi and rate psi' of a linear pendulum, psi'' + 2 gamma psi' + n^2 psi = -n^2 u.

        Harmonics near n are counted from rest at index 0: e^{i m t} - e^{lam t} over (i m - lam), which stays good at
        exact resonance. Their phases too come from exact arithmetic: as a double, n t errs by 2e-12 in an hour.
        """
        frequency, damping = swing.frequency, swing.damping
        lam = complex(-damping, swing.damped)
        drive = -(frequency**2) / gravity
        near = np.abs(self.rate - frequency) < _NEAR * frequency
        away = np.where(near, 1.0, frequency**2 - self.rate**2 + 2j * damping * self.rate)
        factors = np.where(near, 0.0, drive / away)
        angle = self.grid(index, nodes, factors)
        rate = self.grid(index, nodes, factors * 1j * self.rate)
        if np.any(near):
            time = (index[:, None] + nodes[None, :]) * self.step
            free = swing.phasors(index, nodes, self.step) * np.exp(-damping * time)
            wholes = self.turns.phasors(index)
            for row in np.flatnonzero(near).tolist():
                m = float(self.rate[row])
                detuning = complex(damping, float(self.exact[row] - swing.exact))
                whole = wholes[row][:, None] * np.exp(1j * m * nodes * self.step)[None, :]
                growing = free * _expm1_over(detuning, time)
                steady = (whole - np.conj(free)) / (1j * m - np.conj(lam))
                size = drive * complex(self.size[row]) / (lam - np.conj(lam))
                angle = angle + (size * (growing - steady)).real
                rate = rate + (size * (lam * growing - np.conj(lam) * steady)).real
        return angle, rate


def _expm1_over(detuning: complex, time: Floats) -> Phasors:
    """(e^{d t} - 1)/d, t itself at d = 0."""
    product = detuning * time
    if detuning == 0.0:
        return time.astype(np.complex128)
    # numpy's expm1 is exact for complex arguments
    result: Phasors = np.expm1(product) / detuning
    return result
