"""What the phase of a difference pendulum gains over n2 t, part by part: unequal periods, finite arcs, acceleration.

Each part is a phase at the envelope's instants, from the separated harmonics. (36) and (38) are identities; fed with
the model's `phi_i' = n_i (1 - Theta_i^2/16)` and `a_i' = -gamma_i a_i` they carry the finite arc to the difference.
"""

import numpy as np

from pipeline.arrays import Floats
from pipeline.harmonics.envelope import KAISER_SHAPE, weighted_inverse
from pipeline.harmonics.narrowband import running_integral
from pipeline.prepared import Prepared

NON_ISOCHRONISM, ARC, ACCELERATION = "non_isochronism", "arc", "acceleration"
PARTS = {
    NON_ISOCHRONISM: "unequal periods and damping, (27)",
    ARC: "finite arcs, (38)",
    ACCELERATION: "horizontal and vertical acceleration of the support",
}


def by_periods(prepared: Prepared, frequency: float) -> Floats:
    """Phase gained by (27), rad, with n2 = `frequency`, rad s-1."""
    return integrated(model_speed(prepared, frequency, arc=False), prepared.sliding.hop)


def of_real_pendulums(prepared: Prepared, frequency: float) -> dict[str, Floats]:
    """All parts of real pendulums, rad."""
    plain, bent = (model_speed(prepared, frequency, arc=arc) for arc in (False, True))
    hop, accelerated = prepared.sliding.hop, _through_window(prepared, frequency)
    return {NON_ISOCHRONISM: integrated(plain, hop), ARC: integrated(bent - plain, hop), ACCELERATION: accelerated}


def _through_window(prepared: Prepared, frequency: float) -> Floats:
    """Phase that the support's acceleration gives, rad, as the envelope's windows show it."""
    envelope, slow = prepared.sliding, prepared.slow_motion
    half = round(0.5 * (envelope.taps.size - 1) * prepared.observation.step / slow.step)
    x = np.linspace(-1.0, 1.0, 2 * half + 1)
    # what a fit with an amplitude that changes quadratically makes of one that changes in another way
    taps = weighted_inverse(np.stack([np.ones_like(x), x, x * x], axis=-1), np.kaiser(x.size, KAISER_SHAPE))[0]
    time = np.arange(envelope.time[0] - slow.step, envelope.time[-1] + 2.0 * slow.step, slow.step)
    around = slow.step * np.arange(1, half + 1)
    gained = slow.phase(frequency, np.concatenate([time[0] - around[::-1], time, time[-1] + around]))
    return np.asarray(np.interp(envelope.time, time, np.correlate(gained, taps, "valid")))


def model_speed(prepared: Prepared, frequency: float, *, arc: bool) -> Floats:
    """`phi' - n2` of the difference by (38), rad s-1; without arcs it is (27)."""
    seen, envelope = prepared.observation, prepared.sliding
    first, share = envelope.first, envelope.share
    second = first - envelope.difference
    bend = frequency / 16.0 if arc else 0.0
    speed_2 = frequency - bend * np.abs(second) ** 2
    apart = seen.frequency_ratio * (frequency - bend * np.abs(first) ** 2) - speed_2
    # (38) with (a1/a) e^{i (phi1 - phi)} = Z1/D
    return np.asarray(speed_2 - frequency + apart * share.real - seen.damping_difference * share.imag)


def integrated(speed: Floats, hop: float) -> Floats:
    """Phase that a speed, rad s-1 at instants `hop` s apart, adds up to."""
    return np.asarray(running_integral(speed.astype(np.complex128), hop).real)
