"""`general`: (36)/(38) fed with the model's phase speeds, which carry the finite arc to the difference pendulum.

`phi_i' = n_i (1 - Theta_i^2/16)` and `a_i' = -gamma_i a_i`, with Theta_i the separated harmonics. (38) is an identity
and corrects nothing by itself; fed with measured speeds it would only return the measured phase.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.arrays import Floats
from pipeline.estimate import Estimate
from pipeline.harmonics.envelope import Envelope
from pipeline.methods.phases import corrected, phases
from pipeline.prepared import Prepared

ROUNDS = 2  # the acceleration's phase turns with n2, which it shifts by 1e-3 at most
DENIED = 0.5  # residual power without the acceleration over that with it, below which the record denies it


def estimate(prepared: Prepared) -> Estimate:
    """Correct by (38) with model speeds; arc terms are left out where the record says `restoring = linear`.

    The support's acceleration is reduced as it acts on real pendulums, unless the record does not state `restoring`
    and its residual is far smaller without: linear pendulums do not feel it.
    """
    found = phases(prepared)
    envelope, seen = found.envelope, prepared.observation
    frequency = prepared.fine.frequency
    if seen.restoring == "linear":
        return corrected(prepared, found, model_speed(envelope, frequency, prepared, arc=False))
    slow = prepared.slow_motion
    told = (envelope.time >= slow.time[0]) & (envelope.time <= slow.time[-1])
    found = replace(found, weight=np.where(told, found.weight, 0.0))

    def turned(frequency: float, gained: Floats | None) -> Estimate:
        speed = model_speed(envelope, frequency, prepared, arc=True)
        plain = model_speed(envelope, frequency, prepared, arc=False)
        return corrected(prepared, found, speed, speed - plain, gained)

    for _ in range(ROUNDS):
        made = turned(frequency, slow.phase(frequency, envelope.time))
        frequency = made.frequency
    if seen.restoring is None:
        still = turned(prepared.fine.frequency, None)
        if still.noise**2 * still.residual_colour < DENIED * made.noise**2 * made.residual_colour:
            return still
    return made


def model_speed(envelope: Envelope, frequency: float, prepared: Prepared, *, arc: bool) -> Floats:
    """`phi' - n2` of the difference by (38), rad s-1."""
    seen = prepared.observation
    first, share = envelope.first, envelope.share
    second = first - envelope.difference
    rates = np.zeros(2) if seen.damping_rate is None else seen.damping_rate
    bend = frequency / 16.0 if arc else 0.0
    speed_2 = frequency - bend * np.abs(second) ** 2
    apart = seen.frequency_ratio * (frequency - bend * np.abs(first) ** 2) - speed_2
    # (38) with (a1/a) e^{i (phi1 - phi)} = Z1/D
    return np.asarray(speed_2 - frequency + apart * share.real - (rates[0] - rates[1]) * share.imag)
