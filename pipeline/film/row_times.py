"""When each row of each trace was exposed: a trace lies later along the film, and light at its column falls later."""

from __future__ import annotations

import numpy as np

from pipeline.film.parts import Floats, TimeAxis, Tracks


def row_times(tracks: Tracks, axis: TimeAxis, trace: int) -> Floats:
    """Time at which a trace crossed the centre line of each row, (rows,) s; NaN where it is not known."""
    return time_at(axis, trace, np.arange(tracks.course.shape[1], dtype=np.float64) + 0.5, tracks.course[trace])


def time_at(axis: TimeAxis, trace: int, row: Floats, column: Floats) -> Floats:
    """Time at which light of a trace fell on places of the film, s; NaN outside the axis.

    The axis gives the time of a row at column 0 of the first trace. The image lags by `shear` rows a column and by
    the trace's `offset`, so that row r of the trace shows what the axis has at r - offset - shear * column.
    """
    rows = np.arange(axis.seconds.size) + 0.5
    place = row - axis.offset[trace] - axis.shear * column
    return np.asarray(np.interp(place, rows, axis.seconds, left=np.nan, right=np.nan))
