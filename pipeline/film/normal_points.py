"""Normal points: the readings of the rows between two instants as one sample at the instant, no reading used twice.

A sample is the course at its instant plus the mean departure of the rows' readings from the course. The course is the
tracker's smooth curve, whose prior holds a frequency; what of it survives in a sample is second order in the row's
distance from the instant. To keep that out of the phase, the departures are first described by a line and a swing of
slowly changing size (`describe`), in adjoining blocks of a few swings: of the description too only second order
survives, and its noise with it, so that the noise of the samples stays white.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from data_schemas.variables_record import ELONGATION_FLAGS
from pipeline.film.parts import Floats, Samples, TimeAxis, Tracks

_SWINGS = 2.0  # a block: long enough to tell a swing from a line, short beside any change of the swing
_FEWEST = 24  # readings in a block: four a term
_RIDGE = 1e-9  # of the diagonal, for blocks of which only one end was read
LOST = np.uint16(ELONGATION_FLAGS["lost"])


def normal_points(tracks: Tracks, axis: TimeAxis, rate: float) -> Samples:
    """Samples at whole multiples of 1/rate, `rate` a second, from the readings of each row.

    They reach from the first instant that any trace reaches to the last; there are none where the axis knows no time.
    """
    known = axis.seconds[np.isfinite(axis.seconds)]
    first, last = (int(np.ceil(known[0] * rate)), int(np.floor(known[-1] * rate))) if known.size else (0, -1)
    number = np.arange(first, last + 1)
    shape = (len(tracks.course), number.size)
    samples = Samples(number / rate, np.full(shape, np.nan), np.full(shape, np.nan), np.full(shape, LOST))
    for trace in range(shape[0] if known.size else 0):
        _fill(tracks, axis, trace, first, rate, samples)
    return samples


def _fill(tracks: Tracks, axis: TimeAxis, trace: int, first: int, rate: float, out: Samples) -> None:
    """Write the samples of one trace, the `first` at that multiple of 1/rate."""
    seconds, count = row_times(tracks, axis, trace), out.time.size
    timed = np.flatnonzero(np.isfinite(seconds))
    if timed.size < 2:
        return
    sample = np.full(seconds.size, -1)  # of each row
    sample[timed] = np.rint(seconds[timed] * rate).astype(np.int64) - first
    sample[(sample < 0) | (sample >= count)] = -1
    departure = tracks.position[trace] - tracks.course[trace]
    accepted = (sample >= 0) & np.isfinite(departure)
    rows = np.flatnonzero(accepted)
    rows = rows[np.argsort(sample[rows], kind="stable")]  # shear may turn steep strokes back in time
    weight, departure, at = tracks.sigma[trace][rows] ** -2.0, departure[rows], sample[rows]

    period = tracks.rows_per_swing * float(seconds[timed[-1]] - seconds[timed[0]]) / float(timed[-1] - timed[0])
    length = max(2, round(_SWINGS * period * rate))  # samples in a block
    start, span = (first - 0.5) / rate, length / rate
    block = np.arange(count) // length

    def terms(times: Floats, blocks: NDArray[np.int64]) -> Floats:
        since = times - start
        return swing_terms(2.0 * (since / span - blocks) - 1.0, since / period, 2, 2)

    read = terms(seconds[rows], block[at])
    swing = describe(read, departure, weight, block[at], int(block[-1]) + 1)
    weights = np.bincount(at, weight, count)
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = np.bincount(at, weight * (departure - np.sum(read * swing[block[at]], axis=1)), count) / weights
        smooth = np.sum(terms(out.time, block) * swing[block], axis=1)
        column = course_at(tracks, axis, trace, seconds, out.time) + smooth + mean
        out.column[trace], out.sigma[trace] = column, np.where(np.isfinite(column), weights**-0.5, np.nan)
    # a sample carries the flags of its accepted rows; one without any those of all its rows, or lost
    flags = np.zeros((2, count), dtype=np.uint16)
    for each, inside in zip(flags, (accepted, sample >= 0), strict=True):
        np.bitwise_or.at(each, sample[inside], tracks.qc[trace][inside])
    out.qc[trace] = np.where(np.isfinite(column), flags[0], np.where(flags[1] == 0, LOST, flags[1]))


def course_at(tracks: Tracks, axis: TimeAxis, trace: int, seconds: Floats, instants: Floats) -> Floats:
    """Column of a trace's course at any instants, s, px; NaN where the trace or its time is not known.

    `seconds` (rows,) are those of `row_times`.
    """
    timed = np.flatnonzero(np.isfinite(seconds))
    if timed.size < 2:
        return np.full(instants.shape, np.nan)
    ordered = np.maximum.accumulate(seconds[timed])
    row = np.interp(instants, ordered, timed + 0.5, left=np.nan, right=np.nan)
    # Shear makes time curved within a row: one step of Newton after the straight line.
    speed = np.interp(instants, 0.5 * (ordered[1:] + ordered[:-1]), np.diff(timed) / np.maximum(np.diff(ordered), 1e-9))
    row += speed * (instants - time_at(axis, trace, row, between_rows(tracks, trace, row)))
    return between_rows(tracks, trace, row)


def between_rows(tracks: Tracks, trace: int, row: Floats) -> Floats:
    """Course at any places along the film, px, or NaN: Hermite's quintic between the centres of two rows."""
    place = row - 0.5
    low = np.clip(np.floor(np.nan_to_num(place)).astype(np.int64), 0, tracks.course.shape[1] - 2)
    u = place - low
    (c0, c1), (s0, s1), (k0, k1) = (
        (each[trace][low], each[trace][low + 1]) for each in (tracks.course, tracks.slope, tracks.curvature)
    )
    rise, steeper, bent = c1 - c0 - s0 - 0.5 * k0, s1 - s0 - k0, k1 - k0
    return np.asarray(
        c0 + u * s0 + 0.5 * u * u * k0
        + u**3 * (10.0 * rise - 4.0 * steeper + 0.5 * bent)
        + u**4 * (-15.0 * rise + 7.0 * steeper - bent)
        + u**5 * (6.0 * rise - 3.0 * steeper + 0.5 * bent)
    )  # fmt: skip


def row_times(tracks: Tracks, axis: TimeAxis, trace: int) -> Floats:
    """Time at which a trace crossed the centre line of each row, (rows,) s; NaN where it is not known."""
    return time_at(axis, trace, np.arange(tracks.course.shape[1], dtype=np.float64) + 0.5, tracks.course[trace])


def time_at(axis: TimeAxis, trace: int, row: Floats, column: Floats) -> Floats:
    """Time at which light of a trace fell on places of the film, s; NaN outside the axis.

    The axis gives the time of a row at column 0 of the first trace. The image lags by `shear` rows a column and by
    the trace's `offset`, so that row r of the trace shows what the axis has at r - offset - shear * column.
    """
    place = row - axis.offset[trace] - axis.shear * column
    return np.asarray(np.interp(place, np.arange(axis.seconds.size) + 0.5, axis.seconds, left=np.nan, right=np.nan))


def describe(terms: Floats, departure: Floats, weight: Floats, block: NDArray[np.int64], count: int) -> Floats:
    """Coefficients of the terms in each of `count` blocks, (count, terms); zero where one holds too few readings.

    Terms (readings, terms), departures (any unit) and weights (inverse variances) are in order of their `block`.
    """
    coefficients = np.zeros((count, terms.shape[1]))
    edges = np.searchsorted(block, np.arange(count + 1))
    for number in np.flatnonzero(np.diff(edges) >= _FEWEST):
        part = slice(edges[number], edges[number + 1])
        weighted = terms[part] * weight[part, None]
        matrix = weighted.T @ terms[part]
        matrix[np.diag_indices_from(matrix)] *= 1.0 + _RIDGE
        coefficients[number] = np.linalg.lstsq(matrix, weighted.T @ departure[part], rcond=1e-12)[0]
    return coefficients


def swing_terms(place: Floats, turns: Floats, slow: int, powers: int) -> Floats:
    """A slow course and a swing whose size changes, (..., slow + 2 powers): powers of `place`, alone and on waves."""
    angle = 2.0 * np.pi * turns
    waves = ((np.ones_like(place), slow), (np.cos(angle), powers), (np.sin(angle), powers))
    return np.stack([place**k * wave for wave, most in waves for k in range(most)], axis=-1)
