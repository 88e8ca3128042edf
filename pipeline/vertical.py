"""Recorded vertical acceleration, its short gaps bridged, and what the bridges leave unknown.

It acts as gravity itself does: what is wrong with its mean, n2 takes for gravity.
"""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Floats
from pipeline.gaps import bridge, missing_stretches

MOST_MISSING = 0.1  # share that may be bridged
LONGEST = 2.0  # s; across longer gaps the phase of the difference tells better
WEIGHT = 1.1  # root mean square of the weight that least squares give to an instant, over its mean


def bridged(time: Floats, step: float | None, vertical: Floats, frequency: float) -> tuple[Floats | None, float]:
    """Bridge the gaps of a recorded vertical acceleration.

    Parameters
    ----------
    time : (n,) array
        s.
    step : float or None
        Of uniform times, s.
    vertical : (n,) array
        m s-2, NaN = missing.
    frequency : float
        Of the swing, rad s-1.

    Returns
    -------
    (n,) array or None
        None where too much is missing to count as recorded.
    float
        1 sigma of its mean from the bridges, m s-2.
    """
    gaps = missing_stretches(vertical)
    if not gaps:
        return vertical, 0.0
    longest = max(float(time[min(stop, time.size - 1)] - time[start]) for start, stop in gaps)
    if longest > LONGEST or sum(stop - start for start, stop in gaps) > MOST_MISSING * time.size:
        return None, 0.0
    spacing = float(time[-1]) / (time.size - 1)
    if step is None:
        from scipy.interpolate import CubicSpline

        missing = np.isnan(vertical)
        known, lost = time[~missing], time[missing]
        filled = vertical.copy()
        filled[missing] = CubicSpline(known, vertical[~missing])(lost)
        # a cubic errs by less than it departs from a straight line
        off = filled[missing] - np.interp(lost, known, vertical[~missing])
        squares = float(off @ off)
    else:
        filled, spans = bridge(vertical, step, frequency)
        if np.isnan(filled).any():
            return None, 0.0
        squares = sum((length * error) ** 2 for length, error in spans)  # a bridge errs one way
    return filled, WEIGHT * spacing * float(np.sqrt(squares)) / float(time[-1])
