r"""A linear pendulum on a moving support, in closed form.

    theta'' + 2 gamma theta' + n^2 theta = -n^2 u,   u = x''/g = Re sum U_k exp(i w_k t)         (P 1)

with lambda = -gamma + i omega, omega^2 = n^2 - gamma^2. A harmonic away from n is answered by the steady

    -n^2 U / ((n - w)(n + w) + 2 i gamma w) * exp(i w t)

which belongs to the slow part psi. A harmonic m close to n is answered by a beat that starts from zero,

    G (exp(i m t) - exp(lambda t)) / mu,   mu = i m - lambda,   G = -n^2 U / (i m - conj(lambda))   (P 30, 31)

and belongs to the free harmonic: at gamma = 0 it is beta sin(nu t) sin((n - nu) t + delta) with the sign of
beta corrected, and at exact resonance (mu = 0) it is G t exp(lambda t). So theta = Re Z + psi with

    Z = Z(0) exp(lambda t) + sum of beats

in which Re Z + psi satisfies the equation of motion exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from data_schemas.scene_pendulum import FreeStart, Start
from synth.motion.harmonic_sum import HarmonicSum
from synth.phase import Phasors, damped_frequency

NEAR_RESONANT_BAND = (0.8, 1.25)
"""Harmonics between these multiples of n count to the free harmonic, all others to the slow part."""


@dataclass(frozen=True)
class Response:
    """Motion of one pendulum, as coefficients of known functions of time.

    Attributes
    ----------
    frequency, damping_rate : float
        n in rad/s, gamma in 1/s.
    damped_frequency : Fraction
        omega in rad/s, beyond double precision.
    start : complex
        Z(0), rad.
    forced : (harmonics,) complex128
        Coefficient of exp(i w t) in psi, rad; zero for near-resonant harmonics.
    near : (beats,) int64
        Which harmonics are near-resonant.
    gain : (beats,) complex128
        G, rad/s.
    split : (beats,) complex128
        mu = i m - lambda, rad/s; exact in the difference of the two frequencies.
    """

    frequency: float
    damping_rate: float
    damped_frequency: Fraction
    start: complex
    forced: Phasors
    near: NDArray[np.int64]
    gain: Phasors
    split: Phasors


def respond(frequency: float, damping_rate: float, start: Start, motion: HarmonicSum, gravity: float) -> Response:
    """Answer of a linear pendulum to a sum of harmonics.

    Parameters
    ----------
    frequency, damping_rate
        n > gamma >= 0; the pendulum must swing.
    start
        State at t = 0.
    motion
        Horizontal acceleration of the support.
    gravity
        m/s^2.
    """
    omega = damped_frequency(frequency, damping_rate)
    w = motion.angular_frequency
    force = -(frequency**2) * motion.acceleration / gravity  # -n^2 U
    low, high = NEAR_RESONANT_BAND
    is_near = (w > low * frequency) & (w < high * frequency)
    steady = np.where(is_near, 1.0, (frequency - w) * (frequency + w) + 2j * damping_rate * w)
    forced = np.where(is_near, 0.0, force / steady)
    near = np.flatnonzero(is_near)
    m = w[near]
    gain = force[near] / (damping_rate + 1j * (m + float(omega)))
    split = damping_rate + 1j * np.array([float(Fraction(each) - omega) for each in m.tolist()])
    if isinstance(start, FreeStart):
        free = start.amplitude * complex(np.exp(1j * start.phase))
    else:
        # Beats start from zero with the velocity Re G; psi starts from its own state.
        angle = start.angle - float(np.sum(forced.real))
        speed = start.angular_velocity - float(np.sum((1j * w * forced).real)) - float(np.sum(gain.real))
        free = complex(angle, -(speed + damping_rate * angle) / float(omega))
    return Response(frequency, damping_rate, omega, free, forced, near, gain, split)
