"""What the support does to a linear pendulum, exactly, at the times of the kicks and of the outputs."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from synth.phase import Floats, Phasors, phasors, turns
from synth.systems.harmonic_motion import Harmonics

_NEAR = 0.05  # of n: nearer harmonics are counted from rest, since their forced motion grows without bound


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

    def response(
        self, index: np.ndarray, nodes: Floats, frequency: float, damping: float, gravity: float
    ) -> tuple[Floats, Floats]:
        """Forced angle psi and rate psi' of a linear pendulum, psi'' + 2 gamma psi' + n^2 psi = -n^2 u.

        Harmonics near n are counted from rest at index 0: e^{i m t} - e^{lam t} over (i m - lam), which stays good at
        exact resonance.
        """
        damped = np.sqrt(frequency**2 - damping**2)
        lam = complex(-damping, damped)
        drive = -(frequency**2) / gravity
        near = np.abs(self.rate - frequency) < _NEAR * frequency
        away = np.where(near, 1.0, frequency**2 - self.rate**2 + 2j * damping * self.rate)
        factors = np.where(near, 0.0, drive / away)
        angle = self.grid(index, nodes, factors)
        rate = self.grid(index, nodes, factors * 1j * self.rate)
        if np.any(near):
            time = ((index[:, None] + nodes[None, :]) * self.step).ravel()
            extra = np.zeros(time.size, dtype=np.complex128)
            speed = np.zeros(time.size, dtype=np.complex128)
            free = np.exp(lam * time)
            other = np.exp(np.conj(lam) * time)
            for m, size in zip(self.rate[near], self.size[near], strict=True):
                detuning = 1j * m - lam
                whole = np.exp(1j * m * time)
                growing = free * _expm1_over(detuning, time)
                steady = (whole - other) / (1j * m - np.conj(lam))
                extra += drive * size * (growing - steady) / (lam - np.conj(lam))
                speed += drive * size * (lam * growing - np.conj(lam) * steady) / (lam - np.conj(lam))
            angle = angle + extra.real.reshape(angle.shape)
            rate = rate + speed.real.reshape(rate.shape)
        return angle, rate


def _expm1_over(detuning: complex, time: Floats) -> Phasors:
    """(e^{d t} - 1)/d, t itself at d = 0."""
    product = detuning * time
    if detuning == 0.0:
        return time.astype(np.complex128)
    # numpy's expm1 is exact for complex arguments
    result: Phasors = np.expm1(product) / detuning
    return result
