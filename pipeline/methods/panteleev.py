"""`panteleev`: formula (27) on separated harmonics, integrated and subtracted before the regression.

Averaging the correction and subtracting it from a slope would be wrong by up to 97 mGal, because the two weigh
time differently.
"""

from __future__ import annotations

import numpy as np

from pipeline.estimate import Estimate
from pipeline.methods.phases import corrected, phases
from pipeline.phase_speed import panteleev
from pipeline.prepared import Prepared


def estimate(prepared: Prepared) -> Estimate:
    """Correct by (27) with the damping difference."""
    found = phases(prepared)
    envelope, seen = found.envelope, prepared.observation
    frequency = prepared.fine.frequency  # the correction needs n2 to the relative size of n1-n2 only
    speed = panteleev(
        seen.frequency_ratio * frequency,
        frequency,
        np.abs(envelope.share),
        1.0,
        np.angle(envelope.share),
        seen.damping_difference,
    )
    return corrected(prepared, found, speed - frequency)
