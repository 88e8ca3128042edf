"""`shooting`: exact inversion of the nonlinear identity, all finite arcs and the support's acceleration included."""

from __future__ import annotations

import numpy as np

from pipeline.estimate import Estimate
from pipeline.inversion.prepare import invert
from pipeline.methods import projection
from pipeline.prepared import Prepared


def estimate(prepared: Prepared) -> Estimate:
    """Fit n2 with n1/n2 held; vertical acceleration from the record, or none.

    Where the record says `restoring = linear`, the nonlinear identity is the linear one.
    """
    if prepared.observation.restoring == "linear":
        return projection.estimate(prepared)
    projection.require_clean(prepared)
    found = invert(prepared)
    return Estimate(
        frequency=found.frequency,
        uncorrected=float(np.hypot(prepared.nominal + prepared.rough_slope, found.damping_rate)),
        sigma=found.sigma,
        noise=found.noise,
        damping_rate=found.damping_rate,
        samples=found.samples,
        residual_colour=found.colour,
        acceleration_reduced=True,
    )
