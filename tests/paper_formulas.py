"""Formulas of Panteleev (1958) that no method computes by: (26) of raw components, (30), (32), (37).

Numbers follow the paper; where the printed formula is wrong the corrected one stands here. All angles rad, all speeds
rad s-1; every argument may be an array.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pipeline.arrays import Floats


def raw_components(
    frequency_1: float,
    free_amplitude: ArrayLike,
    free_lead: ArrayLike,
    phase: ArrayLike,
    free_phase: ArrayLike,
    free_speed: ArrayLike,
    relative_amplitude_speed: ArrayLike,
) -> tuple[Floats, Floats]:
    """`a1 cos(phi1-phi)` and `a1 sin(phi1-phi)` of `vartheta1 - i vartheta1'/n1` from the harmonic's own, (26).

    Left sides have phi1, not the printed Phi1. `relative_amplitude_speed` is Theta1'/Theta1, `free_speed` is Phi1'.
    """
    theta = np.asarray(free_amplitude)
    extra = (np.asarray(free_speed) - frequency_1) * np.sin(free_phase) - np.asarray(relative_amplitude_speed) * np.cos(
        free_phase
    )
    cosine = theta * np.cos(free_lead) + theta / frequency_1 * np.sin(phase) * extra
    sine = theta * np.sin(free_lead) + theta / frequency_1 * np.cos(phase) * extra
    return np.asarray(cosine), np.asarray(sine)


def near_resonant_motion(
    time: ArrayLike,
    frequency: float,
    half_detuning: float,
    acceleration_ratio: float,
    drive_phase: float,
    free_amplitude: float,
    free_phase: float,
) -> Floats:
    """Elongation (30) of one pendulum under `x''/g = alpha cos(m t + delta)`, m = n1 - 2 nu.

    `theta01 cos(n1 t + phi01) + beta sin(nu t) sin[(n1-nu) t + delta]`; at nu = 0 beta sin(nu t) becomes
    -(n1/2) alpha t.
    """
    t = np.asarray(time, dtype=np.float64)
    nu = half_detuning
    drive = frequency - 2.0 * nu
    envelope = -(frequency**2) / (frequency + drive) * acceleration_ratio * t * np.sinc(nu * t / np.pi)
    return np.asarray(
        free_amplitude * np.cos(frequency * t + free_phase) + envelope * np.sin((frequency - nu) * t + drive_phase)
    )


def quadrature_form(envelope: ArrayLike, carrier_phase: ArrayLike) -> Floats:
    """The forced harmonic of (30) written as a cosine, (32): `E sin(p) = -E cos(p + pi/2)`."""
    return np.asarray(-np.asarray(envelope) * np.cos(np.asarray(carrier_phase) + 0.5 * np.pi))


def difference_amplitude(amplitude_1: ArrayLike, amplitude_2: ArrayLike, lead: ArrayLike) -> Floats:
    """Amplitude of the difference of two harmonics, (37); `lead` = phi1 - phi2."""
    one, two = np.asarray(amplitude_1), np.asarray(amplitude_2)
    return np.asarray(np.sqrt(one**2 + two**2 - 2.0 * one * two * np.cos(lead)))
