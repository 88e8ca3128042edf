"""Two readings of one film compared: the phase of each trace by the rows between the marks, and by the marks alone.

Both are taken as departures from the same course, so that what they share (swell, amplitude) drops out. Each half
minute, the departures are fitted by a line, the course and its rate; the latter's share is the difference in time.
The time axis errs alike over a few marks, and the course over a few rows: the uncertainty is estimated from the scatter
of sums over two seconds, and from what neighbouring sums share.

Of a hundred honest half minutes some lie beyond three sigma. The film is flagged where one lies further out, or more of
them do, than happens in one honest film of four hundred.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pipeline.film.normal_points import course_at, row_times
from pipeline.film.parts import Floats, Samples, Strobe, TimeAxis, Tracks

BLOCK, CLUSTER = 30.0, 2.0  # s; the latter four marks, two swings
STEP = 0.01  # s, over which the course's rate is taken
FEWEST = 12  # samples in a block: three a term
FEWEST_BLOCKS = 6  # for a drift and its scatter
MOST_SIGMAS = 3.0
SUMS = round(BLOCK / CLUSTER)
FREE = SUMS - 4  # degrees of freedom that a block's uncertainty has
CHANCE = 0.0027  # of three sigma


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
    """Relative 1 sigma of the time axis's rate, by how the two readings drift apart; None for a short film.

    The strobe reads at the marks and needs no times between them. Slow errors of the time axis, which no noise of
    single samples shows, are a drift of its phase against that of the rows, the same on all traces. `period` is that of
    the swing, s.
    """
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
