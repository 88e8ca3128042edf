"""Size of a pixel on the film: from the scan's resolution, or from the marks and the nominal speed."""

from __future__ import annotations

import numpy as np

from data_schemas.errors import RecordError
from pipeline.film.parts import TimeAxis

_MM_PER_INCH = 25.4


def rows_per_second(axis: TimeAxis) -> float:
    """Mean speed of the film, from the marks; NaN without two."""
    if axis.index.size < 2:
        return float("nan")
    return float((axis.row[-1] - axis.row[0]) / ((axis.index[-1] - axis.index[0]) * axis.interval))


def film_scale(stated: float | None, speed: float | None, axis: TimeAxis) -> tuple[float, str | None]:
    """Size of a pixel, mm, and what had to be believed for it.

    Parameters
    ----------
    stated : float or None
        As the user or the file says, mm.
    speed : float or None
        Nominal speed of the film, mm s-1.

    Raises
    ------
    RecordError
        Neither is known: elongations would have no scale.
    """
    if stated is not None:
        return stated, None
    rate = rows_per_second(axis)
    if speed is None or not np.isfinite(rate):
        raise RecordError("the image says no resolution, which elongations need; give --dpi, or the film's --speed")
    dpi = _MM_PER_INCH * rate / speed
    return speed / rate, f"the image says no resolution; the marks at {speed:g} mm/s give {dpi:.4g} dpi"
