"""What every motion becomes: a sum of harmonics of the horizontal acceleration."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from synth.phase import Floats, Phasors


@dataclass(frozen=True)
class HarmonicSum:
    """x''(t) = Re sum acceleration * exp(i angular_frequency t).

    Attributes
    ----------
    angular_frequency : (harmonics,) float64
        rad/s, not negative; taken as exact.
    acceleration : (harmonics,) complex128
        Amplitude and phase, m/s^2.
    """

    angular_frequency: Floats
    acceleration: Phasors


def add(terms: Iterable[HarmonicSum]) -> HarmonicSum:
    """Sum of motions."""
    terms = list(terms)
    return HarmonicSum(
        np.concatenate([np.empty(0), *(term.angular_frequency for term in terms)]),
        np.concatenate([np.empty(0, dtype=np.complex128), *(term.acceleration for term in terms)]),
    )
