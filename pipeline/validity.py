"""What the terms that Panteleev (1958) neglects are worth on a given record, in mGal.

Each figure is the error of gravity that leaving the term out would cause, positive where gravity would come out too
large. A term is known as a correction of the phase speed; it is integrated and regressed with the weights of the
phase, as the correction itself is. Between (26) and (27) the paper drops, averaged over a swing,

    (n1-n2) (Theta1/2 n1 a) [(Phi1' - n1) cos(Phi1-phi) + (Theta1'/Theta1) sin(Phi1-phi)]

and before (24) `(n1-n2) xi/g`, whose part that turns with the pendulum is `(Z1' - i n1 Z1)/(i n1)`: twice as much. It
drops psi1-psi2 after (18), damping and the finite arc throughout.
"""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Complexes, Floats
from pipeline.gravity import MGAL
from pipeline.harmonics.envelope import Envelope, fill
from pipeline.harmonics.narrowband import regression
from pipeline.methods.general import model_speed
from pipeline.methods.phases import Phases, integrate, phases
from pipeline.prepared import Prepared

SLOW_BAND = 0.8  # of n2: faster motion belongs to the free harmonic


def neglected_terms(prepared: Prepared) -> dict[str, float]:
    """Size of every term that the paper neglects, mGal.

    Parameters
    ----------
    prepared : Prepared
        A record made ready; its harmonics are separated here if they are not yet.

    Returns
    -------
    dict of str to float
        `first_speed` (n1-n2)(Phi1'-n1); `first_growth` (n1-n2) Theta1'/Theta1; `forcing` (n1-n2) xi/g;
        `slow_difference` psi1-psi2; `damping_difference` gamma1-gamma2 (0 where the record states none);
        `finite_arc` -n Theta^2/16 of both pendulums.

    Raises
    ------
    RefusedError
        The difference has no usable phase.
    """
    found = phases(prepared)
    envelope, seen = found.envelope, prepared.observation
    frequency = prepared.rough.frequency
    first_frequency = seen.frequency_ratio * frequency
    own = 1j * (envelope.carrier - first_frequency)
    relative = (envelope.first_speed / envelope.first + own) / first_frequency  # Theta1'/Theta1 + i (Phi1'-n1), over n1
    share = envelope.share
    half = 0.5 * (first_frequency - frequency)
    arc = model_speed(envelope, frequency, prepared, arc=True) - model_speed(envelope, frequency, prepared, arc=False)
    speeds = {
        "first_speed": half * relative.imag * share.real,
        "first_growth": half * relative.real * share.imag,
        "forcing": 2.0 * half * (relative.imag * share.real + relative.real * share.imag),
        "damping_difference": -seen.damping_difference * share.imag,
        "finite_arc": arc,
    }
    scale = 2.0 * seen.reference_gravity * frequency / prepared.nominal**2 / MGAL  # mGal per rad s-1
    worth = {name: scale * _slope(found, speed) for name, speed in speeds.items()}
    worth["slow_difference"] = scale * _slow_slope(prepared, envelope, first_frequency, frequency)
    return worth


def _slope(found: Phases, speed: Floats) -> float:
    """What a term of the phase speed adds to the slope of the regression, rad s-1."""
    present = found.weight > 0.0
    return regression(
        found.envelope.time[present], integrate(speed, found.envelope.hop)[present], found.weight[present]
    )


def _slow_slope(prepared: Prepared, envelope: Envelope, first_frequency: float, frequency: float) -> float:
    """Slope that psi1-psi2, read as part of the harmonic, would add to the phase of `theta - i theta'/n`, rad s-1."""
    seen = prepared.observation
    count = seen.time.size
    time = np.linspace(0.0, float(seen.time[-1]), count)
    swing = _at(envelope, fill(envelope.first), time).real
    known = np.isfinite(seen.theta)
    slow = np.interp(time, seen.time[known], seen.theta[known]) - swing
    rate = 2.0 * np.pi * np.fft.rfftfreq(count, float(time[1]))
    inside = rate < SLOW_BAND * frequency
    # the exact identity for one harmonic: d'' + n2^2 d = (1 - r) psi1''
    answer = np.zeros(rate.size)
    answer[inside] = (
        -(1.0 - (frequency / first_frequency) ** 2) * rate[inside] ** 2 / (frequency**2 - rate[inside] ** 2)
    )
    spectrum = np.fft.rfft(slow) * answer
    value, speed = np.fft.irfft(spectrum, count), np.fft.irfft(1j * rate * spectrum, count)
    difference = _at(envelope, fill(envelope.difference), time)
    shift = ((value - 1j * speed / frequency) / difference).imag
    within = (time >= envelope.time[0]) & (time <= envelope.time[-1])
    return regression(time[within], shift[within], np.abs(difference[within]) ** 2)


def _at(envelope: Envelope, values: Complexes, time: Floats) -> Complexes:
    """A harmonic at given times."""
    smooth = np.interp(time, envelope.time, values.real) + 1j * np.interp(time, envelope.time, values.imag)
    return np.asarray(smooth * np.exp(1j * envelope.carrier * time))
