"""A plain sum of harmonics."""

from __future__ import annotations

import math

import numpy as np

from data_schemas.scene_motion import HarmonicMotion
from synth.motion.harmonic_sum import HarmonicSum


def harmonics(term: HarmonicMotion) -> HarmonicSum:
    """Turn the lists of a scene into phasors; a period T becomes 2 pi/T."""
    amplitude = np.array(term.amplitude)
    phase = np.zeros_like(amplitude) if term.phase is None else np.array(term.phase)
    if term.angular_frequency is not None:
        rate = np.array(term.angular_frequency)
    else:
        rate = 2 * math.pi / np.array(term.period)
    return HarmonicSum(rate, amplitude * np.exp(1j * phase))
