"""A harmonic close to a pendulum's own frequency: u = alpha cos(m t + delta), n - m = 2 nu (P 29)."""

from __future__ import annotations

import numpy as np

from data_schemas.scene_motion import NearResonantMotion
from synth.motion.harmonic_sum import HarmonicSum


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
