"""Paper that wanders sideways under the light: what the slow part of a difference's trace shows.

A ship's motion moves the pendulums alike, and their difference hardly at all. Paper that wanders moves every line on it
by the same distance: so what is slow in the difference's trace is the paper's, and is taken off all traces. What is
faster than a few swings, a crease, is left.
"""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Floats

SWINGS = 3.0  # of a window in which the slow part is told from the swing
LEAST = 24  # samples of a window
SHOWS = 2.0  # px, 1 sigma of a wander that is taken off


def wander(time: Floats, column: Floats, sums: Floats, period: float) -> Floats | None:
    """How far the paper has wandered at each sample, px, (samples,); None where no difference shows that it did.

    Parameters
    ----------
    time : (samples,) array
        s.
    column : (traces, samples) array
        Of the traces, px; NaN where nothing was read.
    sums : (traces,) array
        Of the pendulums' weights in each trace: 0 of a difference.
    period : float
        Of the swing, s.
    """
    slow = [slow_part(time, each, period) for each, total in zip(column, sums, strict=True) if abs(total) < 1e-9]
    known = [each for each in slow if each is not None]
    if not known:
        return None
    common = np.mean(known, axis=0)
    common = common - common.mean()
    return common if float(np.std(common)) > SHOWS else None


def slow_part(time: Floats, column: Floats, period: float) -> Floats | None:
    """The trace without its swing, (samples,) px, by least squares in windows of some swings; None with too few."""
    from scipy.interpolate import CubicSpline

    middles, values = [], []
    for middle in np.arange(time[0] + 0.5 * SWINGS * period, time[-1], period):
        inside = (np.abs(time - middle) < 0.5 * SWINGS * period) & np.isfinite(column)
        if np.count_nonzero(inside) < LEAST or np.ptp(time[inside]) < 0.7 * SWINGS * period:
            continue
        t = (time[inside] - middle) / (SWINGS * period)
        cosine, sine = np.cos(2.0 * np.pi * SWINGS * t), np.sin(2.0 * np.pi * SWINGS * t)
        terms = np.stack([np.ones_like(t), t, t**2, t**3, cosine, sine, t * cosine, t * sine], axis=1)
        values.append(float(np.linalg.lstsq(terms, column[inside], rcond=None)[0][0]))
        middles.append(middle)
    if len(middles) < 4:
        return None
    return np.asarray(CubicSpline(middles, values)(np.clip(time, middles[0], middles[-1])))
