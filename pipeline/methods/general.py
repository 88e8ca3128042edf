"""`general`: (36)/(38) fed with the model's phase speeds, which carry the finite arc to the difference pendulum.

`phi_i' = n_i (1 - Theta_i^2/16)` and `a_i' = -gamma_i a_i`, with Theta_i the separated harmonics. (38) is an identity
and corrects nothing by itself; fed with measured speeds it would only return the measured phase.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.correction import ACCELERATION, NON_ISOCHRONISM, by_periods, of_real_pendulums
from pipeline.estimate import Estimate
from pipeline.harmonics.narrowband import regression
from pipeline.methods.phases import corrected, phases
from pipeline.prepared import Prepared

ROUNDS = 2  # the acceleration's phase turns with n2, which it shifts by 1e-3 at most
INEXACT = 2e-3  # of what horizontal and vertical acceleration do: they act slowly but for that
DENIED = 0.5  # residual power by one law over that by the other, below which the record denies this


def estimate(prepared: Prepared) -> Estimate:
    """Correct by (38) with model speeds, arcs and the support's acceleration as they act on real pendulums.

    Of linear pendulums, which feel neither, (27) is left where the record says `restoring = linear`. Where it states
    no law and the residual denies the acceleration, that is left out and sigma holds the arcs; where the residual is
    alike by both laws, sigma holds both.
    """
    found = phases(prepared)
    envelope, restoring, frequency = found.envelope, prepared.observation.restoring, prepared.fine.frequency
    linear = corrected(prepared, found, {NON_ISOCHRONISM: by_periods(prepared, frequency)})
    if restoring == "linear":
        return linear
    slow = prepared.slow_motion
    told = (envelope.time >= slow.time[0]) & (envelope.time <= slow.time[-1])
    found = replace(found, weight=np.where(told, found.weight, 0.0))
    for _ in range(ROUNDS):
        made = corrected(prepared, found, of_real_pendulums(prepared, frequency))
        frequency = made.frequency
    motions = (replace(slow, zeta=None), slow)
    level, both = (regression(envelope.time, each.phase(frequency, envelope.time), found.weight) for each in motions)
    made = replace(made, sigma=float(np.hypot(made.sigma, INEXACT * (abs(level) + abs(both - level)))))
    if restoring is not None:
        return made
    power, powers = (each.noise**2 * each.residual_colour for each in (linear, made))
    if power < DENIED * powers:
        real = of_real_pendulums(prepared, prepared.fine.frequency)
        made = corrected(prepared, found, {name: shift for name, shift in real.items() if name != ACCELERATION})
    elif powers < DENIED * power:
        return made
    return replace(made, sigma=float(np.hypot(made.sigma, made.frequency - linear.frequency)))
