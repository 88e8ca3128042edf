"""`complex`: the complex form of (27), which has no singularity where the amplitude passes through zero."""

from __future__ import annotations

import numpy as np

from pipeline.estimate import Estimate
from pipeline.harmonics.envelope import fill
from pipeline.harmonics.narrowband import regression, running_integral
from pipeline.methods.phases import component_variance, passes_zero, phases, with_noise
from pipeline.prepared import Prepared


def estimate(prepared: Prepared) -> Estimate:
    """Least squares for n2 with n1/n2 held."""
    found = phases(prepared, through_zero=True)
    envelope, seen = found.envelope, prepared.observation
    fit = prepared.fine
    present = found.weight > 0.0
    slope = regression(envelope.time[present], found.phase[present], found.weight[present])
    speed = None
    if not passes_zero(np.abs(envelope.difference)):
        kappa = 1j * fit.frequency * (seen.frequency_ratio - 1.0) - seen.damping_difference
        speed = (kappa * envelope.share).imag
    return with_noise(
        prepared,
        envelope,
        component_variance(np.abs(envelope.difference - fit.model) ** 2, envelope),
        frequency=float(np.hypot(fit.frequency, fit.damping_rate)),
        uncorrected=float(np.hypot(envelope.carrier + slope, fit.damping_rate)),
        damping_rate=fit.damping_rate,
        speed_correction=speed,
        phase_correction=None
        if speed is None
        else running_integral(fill(speed.astype(np.complex128)), envelope.hop).real,
    )
