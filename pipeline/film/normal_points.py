"""Normal points, and their phase beside that of the places at the marks.

A normal point makes one sample at an instant of the readings of the rows about it, none used twice: the course there
plus the rows' mean departure from it. The course's prior holds a frequency; to keep that out of the phase, departures
are first described by a line and a swing in adjoining blocks (`describe`): only second order in the row's distance
survives, and the noise of the samples stays white.

The phases by the rows and at the marks are compared as departures from the same course. Each half minute these are
fitted by a line, the course and its rate, whose share is the difference in time. Its uncertainty is estimated from the
scatter of sums over two seconds, and from what neighbours share. The film is flagged where one half minute lies so far
out, or so many beyond three sigma, as happens in one honest film of four hundred.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from data_schemas.variables import ELONGATION_FLAGS
from pipeline.film.parts import Floats, Samples, Strobe, TimeAxis, Tracks

BLOCK_SWINGS = 2.0  # a block: long enough to tell a swing from a line, short beside any change of the swing
FEWEST_READINGS = 24  # readings in a block: four a term
REACH = 0.75  # rows from the nearest reading to a sample that has readings on one side alone
RIDGE = 1e-9  # of the diagonal, for blocks of which only one end was read
LOST = np.uint16(ELONGATION_FLAGS["lost"])
BLOCK, CLUSTER = 30.0, 2.0  # s; the latter four marks, two swings
STEP = 0.01  # s, over which the course's rate is taken
FEWEST = 12  # samples in such a block: three a term
FEWEST_BLOCKS = 6  # for a drift and its scatter
MOST_SIGMAS = 3.0
SUMS = round(BLOCK / CLUSTER)
FREE = SUMS - 4  # degrees of freedom that a block's uncertainty has
CHANCE = 0.0027  # of three sigma


def normal_points(tracks: Tracks, axis: TimeAxis, rate: float) -> Samples:
    """Samples at whole multiples of 1/rate, `rate` a second, from the readings of each row; none without times."""
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
    length = max(2, round(BLOCK_SWINGS * period * rate))  # samples in a block
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
        between = np.full((2, count), np.inf)  # what lies before its first row or behind its last is no reading
        for each, sign in zip(between, (1.0, -1.0), strict=True):
            np.minimum.at(each, at, sign * (seconds[rows] - out.time[at]))
        column[np.maximum(between[0], between[1]) > REACH * period / tracks.rows_per_swing] = np.nan
        out.column[trace], out.sigma[trace] = column, np.where(np.isfinite(column), weights**-0.5, np.nan)
    # a sample carries the flags of its accepted rows; one without any those of all its rows, or lost
    flags = np.zeros((2, count), dtype=np.uint16)
    for each, inside in zip(flags, (accepted, sample >= 0), strict=True):
        np.bitwise_or.at(each, sample[inside], tracks.qc[trace][inside])
    out.qc[trace] = np.where(np.isfinite(column), flags[0], np.where(flags[1] == 0, LOST, flags[1]))


def course_at(tracks: Tracks, axis: TimeAxis, trace: int, seconds: Floats, instants: Floats) -> Floats:
    """Column of a trace's course at instants, s, px, rows timed by `row_times`; NaN where not known."""
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
    """Time at which light of a trace fell on places, s: the axis at row - offset - shear column; NaN outside."""
    place = row - axis.offset[trace] - axis.shear * column
    return np.asarray(np.interp(place, np.arange(axis.seconds.size) + 0.5, axis.seconds, left=np.nan, right=np.nan))


def describe(terms: Floats, departure: Floats, weight: Floats, block: NDArray[np.int64], count: int) -> Floats:
    """Coefficients of terms (readings, terms) by block, (count, terms); weights: inverse variances; 0 if too few."""
    coefficients = np.zeros((count, terms.shape[1]))
    edges = np.searchsorted(block, np.arange(count + 1))
    for number in np.flatnonzero(np.diff(edges) >= FEWEST_READINGS):
        part = slice(edges[number], edges[number + 1])
        weighted = terms[part] * weight[part, None]
        matrix = weighted.T @ terms[part]
        matrix[np.diag_indices_from(matrix)] *= 1.0 + RIDGE
        coefficients[number] = np.linalg.lstsq(matrix, weighted.T @ departure[part], rcond=1e-12)[0]
    return coefficients


def swing_terms(place: Floats, turns: Floats, slow: int, powers: int) -> Floats:
    """A slow course and a swing whose size changes, (..., slow + 2 powers): powers of `place`, alone and on waves."""
    angle = 2.0 * np.pi * turns
    waves = ((np.ones_like(place), slow), (np.cos(angle), powers), (np.sin(angle), powers))
    return np.stack([place**k * wave for wave, most in waves for k in range(most)], axis=-1)


class PhaseDifference(NamedTuple):
    """Phase by the strobe less phase by the rows between the marks."""

    start: Floats  # (blocks,) s, of each half minute
    phase: Floats  # (traces, blocks) rad; NaN where either has too few samples
    sigma: Floats  # (traces, blocks) rad, 1 sigma of both readings' noise

    @property
    def contradicts(self) -> bool:
        """Whether the two readings of the film differ by more than chance does, 0.27 %."""
        from scipy.special import bdtrc, stdtr

        with np.errstate(invalid="ignore", divide="ignore"):
            away = np.abs(self.phase / self.sigma)
        away = away[np.isfinite(away)]
        if away.size == 0:
            return False
        farthest = away.size * 2.0 * float(stdtr(FREE, -away.max()))
        beyond = int(np.count_nonzero(away > MOST_SIGMAS))
        many = float(bdtrc(beyond - 1, away.size, 2.0 * float(stdtr(FREE, -MOST_SIGMAS)))) if beyond else 1.0
        return min(farthest, many) < CHANCE


def clock_uncertainty(difference: PhaseDifference, period: float) -> float | None:
    """Relative 1 sigma of the axis's rate, by the readings' drift over all traces; None for a short film."""
    drifts, weights = [], []
    for phase, sigma in zip(difference.phase, difference.sigma, strict=True):
        known = np.isfinite(phase) & (sigma > 0.0)
        if np.count_nonzero(known) < FEWEST_BLOCKS:
            continue
        start = difference.start[known]
        (drift, _), covariance = np.polyfit(start - start.mean(), phase[known], 1, w=1.0 / sigma[known], cov=True)
        drifts.append(float(drift))
        weights.append(1.0 / float(covariance[0, 0]))
    if not drifts:
        return None
    # the traces share the axis, so that their errors are one: the mean drift, and the error of the best of them
    mean = float(np.average(drifts, weights=weights))
    return float(np.hypot(mean, max(weights) ** -0.5)) * period / (2.0 * np.pi)


def compare(tracks: Tracks, axis: TimeAxis, samples: Samples, strobe: Strobe) -> PhaseDifference:
    """Phase of every trace each half minute by the strobe less that by the normal points of the rows."""
    marks = np.asarray(strobe.index * axis.interval, dtype=np.float64)
    begin = np.floor(min(samples.time[0], marks[0]) / BLOCK) * BLOCK
    start = np.arange(begin, max(samples.time[-1], marks[-1]), BLOCK)
    leads = np.empty((2, 2, len(tracks.course), start.size))  # (strobe and rows, lead and sigma, traces, blocks), s
    for trace in range(len(tracks.course)):
        seconds = row_times(tracks, axis, trace)
        readings = ((marks, strobe.position, strobe.sigma), (samples.time, samples.column, samples.sigma))
        for which, (times, column, sigma) in enumerate(readings):
            before, course, after = (course_at(tracks, axis, trace, seconds, times + by) for by in (-STEP, 0.0, STEP))
            speed, away = 0.5 * (after - before) / STEP, column[trace] - course
            for block, first in enumerate(start):
                leads[which, :, trace, block] = _lead(times - first, away, sigma[trace], course, speed)
    rows = float(np.median(1.0 / np.diff(axis.seconds[np.isfinite(axis.seconds)])))  # a second
    rate = 2.0 * np.pi / tracks.rows_per_swing * rows
    return PhaseDifference(start, rate * (leads[0, 0] - leads[1, 0]), rate * np.hypot(leads[0, 1], leads[1, 1]))


def _lead(times: Floats, values: Floats, sigma: Floats, course: Floats, speed: Floats) -> tuple[float, float]:
    """By how much a reading leads the course in the half minute from 0, s, and 1 sigma; NaN with too few samples."""
    inside = (times >= 0.0) & (times < BLOCK) & np.isfinite(values + speed) & (sigma > 0.0)
    if np.count_nonzero(inside) < FEWEST:
        return np.nan, np.nan
    t = times[inside]
    place = course[inside] - course[inside].mean()
    columns = np.stack([speed[inside], place, np.ones_like(t), t - 0.5 * BLOCK], axis=1) / sigma[inside, None]
    inverse = np.linalg.pinv(columns.T @ columns)
    reduced = values[inside] / sigma[inside]
    fit = inverse @ (columns.T @ reduced)
    # covariance of White (1980), clustered, with the neighbours' share of Newey and West (1987) and the factor for few
    # sums; never below that of the samples' own noise
    pulls = columns * (reduced - columns @ fit)[:, None]
    sums = np.zeros((SUMS, 4))
    np.add.at(sums, np.minimum((t / CLUSTER).astype(np.int64), SUMS - 1), pulls)
    shared = sums[1:].T @ sums[:-1]
    scattered = inverse @ (sums.T @ sums + 0.5 * (shared + shared.T)) @ inverse * (SUMS / FREE)
    return float(fit[0]), float(np.sqrt(max(inverse[0, 0], scattered[0, 0])))
