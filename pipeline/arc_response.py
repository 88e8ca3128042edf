"""What the finite arcs add to the difference of two pendulums, by the separated harmonics."""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Complexes, Floats
from pipeline.harmonics.envelope import fill
from pipeline.harmonics.narrowband import running_integral
from pipeline.prepared import Prepared


def arc_response(prepared: Prepared, frequency: float, gamma: float) -> Floats:
    """What the finite arcs add to the difference, rad, at the samples within the envelope's span; zero at its start."""
    seen, envelope = prepared.observation, prepared.sliding
    forcing = arc_forcing(envelope.first, envelope.difference, frequency)
    mu = complex(-gamma, frequency - envelope.carrier)
    growth = np.exp(mu * (envelope.time - envelope.time[0]))
    response = growth * running_integral(forcing / growth, envelope.hop)
    at = np.clip(seen.time, envelope.time[0], envelope.time[-1])
    smooth = np.interp(at, envelope.time, response.real) + 1j * np.interp(at, envelope.time, response.imag)
    return np.asarray((smooth * np.exp(1j * envelope.carrier * seen.time)).real)


def arc_forcing(first: Complexes, difference: Complexes, frequency: float) -> Complexes:
    """`-(i n/16) (|Z1|^2 Z1 - |Z2|^2 Z2)`: the finite arc as a forcing of the difference, rad s-1."""
    first, difference = fill(first), fill(difference)
    second = first - difference
    return np.asarray(-1j * frequency / 16.0 * (np.abs(first) ** 2 * first - np.abs(second) ** 2 * second))
