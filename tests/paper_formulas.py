"""Formulas of Panteleev (1958) that no method computes by: (26), (27) of the amplitude, (30), (32), (36)-(38).

Numbers follow the paper; where the printed formula is wrong the corrected one stands here. All angles rad, all speeds
rad s-1; every argument may be an array.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pipeline.arrays import Floats


def amplitude_speed(
    frequency_1: float,
    frequency_2: float,
    free_amplitude_1: ArrayLike,
    amplitude: ArrayLike,
    free_lead: ArrayLike,
    damping_rate_2: float = 0.0,
    damping_difference: float = 0.0,
) -> Floats:
    """Amplitude's rate of change, second of (27), with damping.

    `a' = -Theta1 (n1-n2) sin(Phi1-phi) - gamma2 a - (gamma1-gamma2) Theta1 cos(Phi1-phi)`.
    """
    theta = np.asarray(free_amplitude_1)
    return np.asarray(
        -theta * (frequency_1 - frequency_2) * np.sin(free_lead)
        - damping_rate_2 * np.asarray(amplitude)
        - damping_difference * theta * np.cos(free_lead)
    )


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


def difference_speed(
    speed_1: ArrayLike,
    speed_2: ArrayLike,
    amplitude_1: ArrayLike,
    amplitude_2: ArrayLike,
    amplitude_speed_1: ArrayLike,
    amplitude_speed_2: ArrayLike,
    lead: ArrayLike,
) -> Floats:
    """Phase speed of the difference of any two harmonics, (36): an identity.

    `phi' = phi1' - {a2 [a2 - a1 cos(phi1-phi2)] (phi1'-phi2') + (a1' a2 - a1 a2') sin(phi1-phi2)} / a^2`.
    """
    one, two, lead = np.asarray(amplitude_1), np.asarray(amplitude_2), np.asarray(lead)
    square = one**2 + two**2 - 2.0 * one * two * np.cos(lead)
    turning = two * (two - one * np.cos(lead)) * (np.asarray(speed_1) - np.asarray(speed_2))
    growing = (np.asarray(amplitude_speed_1) * two - one * np.asarray(amplitude_speed_2)) * np.sin(lead)
    return np.asarray(speed_1 - (turning + growing) / square)


def difference_speed_by_phase(
    speed_1: ArrayLike,
    speed_2: ArrayLike,
    share: ArrayLike,
    lead: ArrayLike,
    relative_speed_1: ArrayLike,
    relative_speed_2: ArrayLike,
) -> Floats:
    """The same in the form (38), with `share` = a1/a, `lead` = phi1 - phi and relative speeds a'/a of the two.

    `phi' = phi2' + (a1/a) [(phi1'-phi2') cos(phi1-phi) + (a1'/a1 - a2'/a2) sin(phi1-phi)]`.
    """
    inner = (np.asarray(speed_1) - np.asarray(speed_2)) * np.cos(lead) + (
        np.asarray(relative_speed_1) - np.asarray(relative_speed_2)
    ) * np.sin(lead)
    return np.asarray(np.asarray(speed_2) + np.asarray(share) * inner)
