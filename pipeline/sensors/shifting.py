"""A series as it was so many seconds later, between its samples."""

from __future__ import annotations

import numpy as np

from data_schemas.scratch import portions, room
from pipeline.arrays import Floats
from pipeline.projection.taps import CENTRE, NODES, fitted_basis


def advanced(series: Floats, step: float, seconds: float, frequency: float) -> Floats:
    """`series(t + seconds)` on the same grid; NaN where one of the eight samples around is missing or beyond the ends.

    Parameters
    ----------
    series : (n,) array
        Uniform samples, NaN = missing.
    step, seconds, frequency : float
        s, s, and the swing's circular frequency, rad s-1, where the interpolation is exact.

    Examples
    --------
    >>> import numpy as np
    >>> time = 0.04 * np.arange(400)
    >>> later = advanced(np.cos(6.2 * time), 0.04, 0.013, 6.2)
    >>> bool(np.nanmax(np.abs(later - np.cos(6.2 * (time + 0.013)))) < 1e-12)
    True
    """
    if seconds == 0.0:
        return series
    whole = int(np.floor(seconds / step))
    place = seconds / step - whole
    nodes = fitted_basis(np.arange(NODES) - CENTRE, frequency * step)
    weights = np.linalg.solve(nodes, fitted_basis(np.array([3.0 + place - CENTRE]), frequency * step))[:, 0]
    out = room(series.size)
    before = 3 - whole  # sample k comes from the eight from k - before on
    for part in portions(series.size, series, out):
        first, last = max(part.start - before, 0), min(part.stop - before, series.size - NODES + 1)
        out[part] = np.nan
        if first < last:
            moved = np.convolve(series[first : last + NODES - 1], weights[::-1], mode="valid")
            out[first + before : last + before] = moved
    return out
