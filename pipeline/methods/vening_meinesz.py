"""`vening-meinesz`: formula (9) at the film's minute marks, with amplitude and phase of the raw first pendulum.

It is the method of the 1930s and keeps its fault: the slow motion psi1 leaks into a1 and phi1 as (14) shows.
"""

from __future__ import annotations

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats
from pipeline.correction import NON_ISOCHRONISM, integrated
from pipeline.estimate import Estimate
from pipeline.methods.phases import corrected, phases
from pipeline.phase_speed import phase_speed
from pipeline.prepared import Prepared

MARK_SECONDS = 60.0
IDENTICAL = 1e-9  # of n1/n2
_NEIGHBOURS = 9


def estimate(prepared: Prepared) -> Estimate:
    """Read (9) at minute marks, join the readings by straight lines, integrate and regress.

    Raises
    ------
    RefusedError
        As `phases`; or the pendulums are identical: no fictitious one is to be formed of them, (3).
    """
    if abs(prepared.observation.frequency_ratio - 1.0) < IDENTICAL:
        raise RefusedError(
            "instrument/period: both pendulums have the same period: the fictitious pendulum is the difference itself; "
            "use the method uncorrected, or joint"
        )
    found = phases(prepared)
    envelope, seen = found.envelope, prepared.observation
    frequency = prepared.fine.frequency
    every = max(1, round(MARK_SECONDS / envelope.hop))
    marks = np.arange(0, envelope.time.size, every)
    marks = marks[np.isfinite(envelope.difference[marks])]
    first_frequency = seen.frequency_ratio * frequency
    value, slope = value_and_slope(seen.time, seen.theta, envelope.time[marks])
    raw = value - 1j * slope / first_frequency  # (4)
    difference = envelope.difference[marks] * np.exp(1j * envelope.carrier * envelope.time[marks])
    reading = phase_speed(first_frequency, frequency, np.abs(raw), np.abs(difference), np.angle(raw / difference))
    speed = np.interp(envelope.time, envelope.time[marks], reading - frequency)
    return corrected(prepared, found, {NON_ISOCHRONISM: integrated(speed, envelope.hop)})


def value_and_slope(time: Floats, series: Floats, instants: Floats) -> tuple[Floats, Floats]:
    """Elongation and its derivative at given instants, by the polynomial through the nine nearest samples."""
    present = np.isfinite(series)
    time, series = time[present], series[present]
    start = np.clip(np.searchsorted(time, instants) - _NEIGHBOURS // 2, 0, time.size - _NEIGHBOURS)
    value, slope = np.empty(instants.size), np.empty(instants.size)
    for k, instant in enumerate(instants):
        part = slice(start[k], start[k] + _NEIGHBOURS)
        fit = np.polynomial.Polynomial.fit(time[part] - instant, series[part], _NEIGHBOURS - 1)
        value[k], slope[k] = fit(0.0), fit.deriv()(0.0)
    return value, slope
