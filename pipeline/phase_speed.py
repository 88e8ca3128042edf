"""The formulas of Panteleev (1958) for the phase speed of difference pendulums, each as a function.

Numbers follow the paper; where the printed formula is wrong the corrected one stands here, and the errata page
links the proof. All angles rad, all speeds rad s-1; every argument may be an array. n1, n2 are `frequency_1` and
`frequency_2`; a1 (or Theta1) and a `amplitude_1` and `amplitude`; phi1 - phi (or Phi1 - phi) the `lead`.
"""

import numpy as np
from numpy.typing import ArrayLike

from pipeline.arrays import Floats


def phase_speed(
    frequency_1: ArrayLike, frequency_2: ArrayLike, amplitude_1: ArrayLike, amplitude: ArrayLike, lead: ArrayLike,
    damping_difference: ArrayLike = 0.0,
) -> Floats:  # fmt: skip
    """Phase speed of the fictitious pendulum, (9), and of the difference pendulum, (25), (27) and (38).

    `phi' = n2 + (n1-n2) (a1/a) cos(phi1-phi) - (gamma1-gamma2) (a1/a) sin(phi1-phi)`, the damping added. With a1, phi1
    of the raw `theta1 - i theta1'/n1` this is (9), and the slow motion leaks in as (14) shows; with the separated
    harmonic Theta1, Phi1 it is (27). `damping_difference` is gamma1 - gamma2, s-1. With the phase speeds of any two
    harmonics for n1 and n2, and `a2'/a2 - a1'/a1` for the damping, it is the identity (38).
    """
    turn = np.subtract(frequency_1, frequency_2) * np.cos(lead) - np.multiply(damping_difference, np.sin(lead))
    return np.asarray(frequency_2 + turn * np.asarray(amplitude_1) / np.asarray(amplitude))


def leaking(
    frequency_1: float, frequency_2: float, free_amplitude_1: ArrayLike, amplitude: ArrayLike, free_lead: ArrayLike,
    phase: ArrayLike, slow: ArrayLike, slow_speed: ArrayLike,
) -> Floats:  # fmt: skip
    """Phase speed (14): (9) with the slow motion psi1 written out.

    `phi' = n2 + (n1-n2) [(Theta1/a) cos(Phi1-phi) + (psi1/a) cos phi - psi1'/(n1 a) sin phi]`; the paper prints
    omega' for psi1'.
    """
    leak = np.asarray(slow) * np.cos(phase) - np.asarray(slow_speed) / frequency_1 * np.sin(phase)
    inner = np.asarray(free_amplitude_1) * np.cos(free_lead) + leak
    return np.asarray(frequency_2 + (frequency_1 - frequency_2) * inner / np.asarray(amplitude))


def near_resonant_amplitude(frequency: float, half_detuning: float, acceleration_ratio: float) -> float:
    """beta of (30)-(31): `-n1^2/(n1+m) alpha/nu`, m = n1 - 2 nu; the paper prints it without the minus.

    n1 is `frequency`, nu `half_detuning`, not zero (the limit is a linear growth, see (30)), and alpha, amplitude of
    x''/g, `acceleration_ratio`.
    """
    drive = frequency - 2.0 * half_detuning
    return -(frequency**2) / (frequency + drive) * acceleration_ratio / half_detuning


def disturbed_speed(
    time: ArrayLike, frequency: float, half_detuning: float, forced_amplitude: float, drive_phase: float,
    free_amplitude: float, free_phase: float,
) -> Floats:  # fmt: skip
    """Phase speed of a single pendulum under near-resonant forcing, (39) corrected; `forced_amplitude` is beta of (31).

    `phi' = n1 + nu {[theta01^2 - theta01 beta cos(phi01-delta)]/a^2 - 1}` with
    `a^2 = theta01^2 + beta^2 sin^2(nu t) - 2 theta01 beta sin(nu t) sin(nu t + phi01 - delta)`;
    print has sin(phi01-delta), a_2, alpha and cos(nu t - phi0 + delta).
    """
    theta, beta, nu = free_amplitude, forced_amplitude, half_detuning
    wave = np.sin(nu * np.asarray(time))
    offset = free_phase - drive_phase
    square = theta**2 + (beta * wave) ** 2 - 2.0 * theta * beta * wave * np.sin(nu * np.asarray(time) + offset)
    return np.asarray(frequency + nu * ((theta**2 - theta * beta * np.cos(offset)) / square - 1.0))


def speed_of_difference(amplitude: Floats, lead: ArrayLike, speed: Floats, growth: Floats) -> Floats:
    """Phase speed of the difference of any two harmonics, (36) with a^2 of (37).

    `amplitude`, `speed` and `growth` (2, ...) are a_i, phi_i' and a_i' of the two, `lead` is phi1 - phi2.
    """
    one, two = amplitude
    cos, sin = np.cos(lead), np.sin(lead)
    square = one**2 + two**2 - 2.0 * one * two * cos
    turn = two * (two - one * cos) * (speed[0] - speed[1]) + (growth[0] * two - one * growth[1]) * sin
    return np.asarray(speed[0] - turn / square)


def amplitude_rate(
    frequency_difference: float, amplitude_1: ArrayLike, amplitude: ArrayLike, lead: ArrayLike, damping: float = 0.0,
    damping_difference: float = 0.0,
) -> Floats:  # fmt: skip
    """a' of the difference pendulum, (26) and (27), rad s-1: `-Theta1 (n1-n2) sin(Phi1-phi)`, the damping added.

    `-gamma2 a - (gamma1-gamma2) Theta1 cos(Phi1-phi)` is what damping adds.
    """
    turn = frequency_difference * np.sin(lead) + damping_difference * np.cos(lead)
    return np.asarray(-damping * np.asarray(amplitude) - np.asarray(amplitude_1) * turn)
