"""`general`: (36)/(38) fed with the model's phase speeds, which carry the finite arc to the difference pendulum.

`phi_i' = n_i (1 - Theta_i^2/16)` and `a_i' = -gamma_i a_i`, with Theta_i the separated harmonics. (38) is an identity
and corrects nothing by itself; fed with measured speeds it would only return the measured phase.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.correction import NON_ISOCHRONISM, by_periods, of_real_pendulums
from pipeline.estimate import Estimate
from pipeline.harmonics.narrowband import regression
from pipeline.methods.phases import corrected, phases
from pipeline.prepared import Prepared

ROUNDS = 2  # the acceleration's phase turns with n2, which it shifts by 1e-3 at most
INEXACT = 2e-3  # of what horizontal and vertical acceleration do: they act slowly but for that
DENIED = 0.5  # residual power without the acceleration over that with it, below which the record denies it


def estimate(prepared: Prepared) -> Estimate:
    """Correct by (38) with model speeds; arc terms are left out where the record says `restoring = linear`.

    The support's acceleration is reduced as it acts on real pendulums, unless the record does not state `restoring`
    and its residual is far smaller without: linear pendulums do not feel it.
    """
    found = phases(prepared)
    envelope, restoring, frequency = found.envelope, prepared.observation.restoring, prepared.fine.frequency
    if restoring == "linear":
        return corrected(prepared, found, {NON_ISOCHRONISM: by_periods(prepared, frequency)})
    slow = prepared.slow_motion
    told = (envelope.time >= slow.time[0]) & (envelope.time <= slow.time[-1])
    found = replace(found, weight=np.where(told, found.weight, 0.0))
    for _ in range(ROUNDS):
        made = corrected(prepared, found, of_real_pendulums(prepared, frequency))
        frequency = made.frequency
    motions = (replace(slow, zeta=None), slow)
    level, both = (regression(envelope.time, each.phase(frequency, envelope.time), found.weight) for each in motions)
    made = replace(made, sigma=float(np.hypot(made.sigma, INEXACT * (abs(level) + abs(both - level)))))
    if restoring is None:
        still = corrected(prepared, found, of_real_pendulums(prepared, prepared.fine.frequency, accelerated=False))
        if still.noise**2 * still.residual_colour < DENIED * made.noise**2 * made.residual_colour:
            return still
    return made
