"""A plain sum of harmonics, and one close to a pendulum: u = alpha cos(m t + delta), n - m = 2 nu (P 29)."""

from __future__ import annotations

import math

import numpy as np

from data_schemas.scene_motion import Harmonics, NearResonantMotion
from synth.motion.harmonic_sum import HarmonicSum


def harmonics(term: Harmonics) -> HarmonicSum:
    """Turn the lists of a scene into phasors; a period T becomes 2 pi/T."""
    amplitude = np.array(term.amplitude)
    phase = np.zeros_like(amplitude) if term.phase is None else np.array(term.phase)
    if term.angular_frequency is not None:
        rate = np.array(term.angular_frequency)
    else:
        rate = 2 * math.pi / np.array(term.period)
    return HarmonicSum(rate, amplitude * np.exp(1j * phase))


def near_resonant(term: NearResonantMotion, frequency: float) -> HarmonicSum:
    """Place the harmonic beside a pendulum.

    Parameters
    ----------
    term
        Its detuning nu, or the time pi/nu between the vanishings of the beat.
    frequency
        n of the pendulum it is close to, rad/s.
    """
    phasor = term.amplitude * complex(np.exp(1j * term.phase))
    return HarmonicSum(np.array([frequency - 2 * term.nu]), np.array([phasor]))
