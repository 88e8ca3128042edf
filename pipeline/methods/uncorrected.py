"""`uncorrected`: the slope of the difference's phase, as if the two pendulums were isochronous."""

from __future__ import annotations

from pipeline.estimate import Estimate
from pipeline.methods.phases import corrected, phases
from pipeline.prepared import Prepared


def estimate(prepared: Prepared) -> Estimate:
    """Regress the phase of the difference without any correction."""
    return corrected(prepared, phases(prepared), None)
