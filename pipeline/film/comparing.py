"""Two readings of one film compared: the phase of each trace by the rows between the marks, and by the marks alone.

Both are taken as departures from the same course, so that what they share (swell, amplitude) drops out. Each half
minute, the departures are fitted by a line and a swing; the swing across the course's own is the difference in phase.
The time axis errs alike over a few marks, and the course over a few rows: the uncertainty is told from the scatter of
sums over two seconds, and from what neighbouring sums share.

A half minute disagrees beyond three sigma; the record says which. That a film does is another question: of a hundred
honest half minutes some lie beyond three sigma. The film is flagged where a half minute lies further out, or more of
them do, than happens in one honest film of four hundred.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.film.normal_points import Samples, course_at, row_times
from pipeline.film.parts import Floats, Strobe, TimeAxis, Tracks

BLOCK = 30.0  # s
_CLUSTER = 2.0  # s: four marks, two swings
_FEWEST = 12  # readings in a block: three a term
_FEWEST_BLOCKS = 6  # for a drift and its scatter
MOST_SIGMAS = 3.0
_SUMS = round(BLOCK / _CLUSTER)
_FREE = _SUMS - 4  # degrees of freedom that a block's uncertainty has
_CHANCE = 0.0027  # of three sigma


@dataclass(frozen=True)
class PhaseDifference:
    """Phase by the strobe less phase by the rows between the marks.

    Attributes
    ----------
    start : (blocks,) array
        s, of each half minute.
    phase, sigma : (traces, blocks) arrays
        rad, and 1 sigma of both readings' noise; NaN where either has too few readings.
    """

    start: Floats
    phase: Floats
    sigma: Floats

    @property
    def disagree(self) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        """Where the difference is more than three sigma, (traces, blocks)."""
        with np.errstate(invalid="ignore"):
            return np.asarray(np.abs(self.phase) > MOST_SIGMAS * self.sigma)

    @property
    def contradicts(self) -> bool:
        """Whether the two readings of the film differ by more than chance does, 0.27 %."""
        from scipy.special import bdtrc, stdtr

        with np.errstate(invalid="ignore", divide="ignore"):
            away = self.phase / self.sigma
        seen = np.abs(away[np.isfinite(away)])
        if seen.size == 0:
            return False
        farthest = seen.size * 2.0 * float(stdtr(_FREE, -seen.max())) < _CHANCE
        beyond = int(np.count_nonzero(seen > MOST_SIGMAS))
        usual = 2.0 * float(stdtr(_FREE, -MOST_SIGMAS))
        many = beyond > 0 and float(bdtrc(beyond - 1, seen.size, usual)) < _CHANCE
        return bool(farthest or many)


def clock_uncertainty(difference: PhaseDifference, period: float) -> float | None:
    """Relative 1 sigma of the time axis's rate, told from how the two readings drift apart; None for a short film.

    The strobe reads at the marks and needs no times between them. Slow errors of the time axis, which no noise of
    single readings shows, are a drift of its phase against that of the rows, the same on all traces.

    Parameters
    ----------
    period : float
        Of the swing, s.
    """
    found, weight = [], []
    for phase, sigma in zip(difference.phase, difference.sigma, strict=True):
        seen = np.isfinite(phase) & (sigma > 0.0)
        if np.count_nonzero(seen) < _FEWEST_BLOCKS:
            continue
        start = difference.start[seen]
        (drift, _), covariance = np.polyfit(start - start.mean(), phase[seen], 1, w=1.0 / sigma[seen], cov=True)
        found.append(float(drift))
        weight.append(1.0 / float(covariance[0, 0]))
    if not found:
        return None
    # the traces share the axis, so that their errors are one: the mean drift, and the error of the best of them
    mean = float(np.average(found, weights=weight))
    return float(np.hypot(mean, max(weight) ** -0.5)) * period / (2.0 * np.pi)


def compare(tracks: Tracks, axis: TimeAxis, samples: Samples, strobe: Strobe) -> PhaseDifference:
    """Phase of every trace each half minute by either reading.

    Parameters
    ----------
    samples : Samples
        The normal points of the rows.
    strobe : Strobe
        The readings at the marks.
    """
    marks = np.asarray(strobe.index * axis.interval, dtype=np.float64)
    begin = np.floor(min(samples.time[0], marks[0]) / BLOCK) * BLOCK
    start = np.arange(begin, max(samples.time[-1], marks[-1]), BLOCK)
    shape = (tracks.course.shape[0], start.size)
    phase, sigma = np.full(shape, np.nan), np.full(shape, np.nan)
    for trace in range(shape[0]):
        seconds = row_times(tracks, axis, trace)
        timed = np.flatnonzero(np.isfinite(seconds))
        if timed.size < 2:
            continue
        period = tracks.rows_per_swing * float(seconds[timed[-1]] - seconds[timed[0]]) / float(timed[-1] - timed[0])
        period = _refined(samples, trace, start, period)
        by_rows = samples.column[trace] - course_at(tracks, axis, trace, seconds, samples.time)
        by_marks = strobe.position[trace] - course_at(tracks, axis, trace, seconds, marks)
        for block, first in enumerate(start):
            fits = [
                _swing(times, departure, spread, first, period)
                for times, departure, spread in (
                    (marks, by_marks, strobe.sigma[trace]),
                    (samples.time, by_rows, samples.sigma[trace]),
                )
            ]
            course = _swing(samples.time, samples.column[trace], samples.sigma[trace], first, period)
            if course is None or fits[0] is None or fits[1] is None:
                continue
            (cosine, sine), _ = course
            across = np.array([sine, -cosine]) / (cosine**2 + sine**2)  # d phase / d (cos, sin)
            phase[trace, block] = across @ (fits[0][0] - fits[1][0])
            sigma[trace, block] = np.sqrt(across @ (fits[0][1] + fits[1][1]) @ across)
    return PhaseDifference(start, phase, sigma)


def _refined(samples: Samples, trace: int, start: Floats, period: float) -> float:
    """Period of a trace's swing, s: a small error would turn the phase within half a minute."""
    for _ in range(2):
        drift = []
        for first in start:
            inside = (samples.time >= first) & (samples.time < first + BLOCK) & np.isfinite(samples.column[trace])
            if np.count_nonzero(inside) < 2 * _FEWEST:
                continue
            t = samples.time[inside] - first - 0.5 * BLOCK
            phase = 2.0 * np.pi / period * t
            swing = np.stack([np.cos(phase), np.sin(phase)], axis=1)
            columns = np.concatenate([swing, t[:, None] * swing, np.ones_like(swing)], axis=1)
            columns[:, 5] = t
            a, b, c, d = np.linalg.lstsq(columns, samples.column[trace, inside], rcond=None)[0][:4]
            drift.append((b * c - a * d) / (a * a + b * b))  # of the phase of a cos + b sin, rad s-1
        if drift:
            period /= 1.0 + float(np.median(drift)) * period / (2.0 * np.pi)
    return period


def _swing(times: Floats, values: Floats, spread: Floats, first: float, period: float) -> tuple[Floats, Floats] | None:
    """Coefficients of cos and sin in the half minute from `first`, and their covariance; None with too few readings."""
    inside = (times >= first) & (times < first + BLOCK) & np.isfinite(values) & (spread > 0.0)
    if np.count_nonzero(inside) < _FEWEST:
        return None
    t = times[inside] - first - 0.5 * BLOCK
    phase = 2.0 * np.pi / period * t
    columns = np.stack([np.cos(phase), np.sin(phase), np.ones_like(t), t], axis=1) / spread[inside, None]
    inverse = np.linalg.pinv(columns.T @ columns)
    reduced = values[inside] / spread[inside]
    fitted = inverse @ (columns.T @ reduced)
    # covariance of White (1980), clustered, with the neighbours' share of Newey and West (1987) and the factor for few
    # sums; never below that of the readings' own noise
    pulls = columns * (reduced - columns @ fitted)[:, None]
    sums = np.zeros((_SUMS, 4))
    np.add.at(sums, np.minimum(((t + 0.5 * BLOCK) / _CLUSTER).astype(np.int64), _SUMS - 1), pulls)
    shared = sums[1:].T @ sums[:-1]
    scattered = inverse @ (sums.T @ sums + 0.5 * (shared + shared.T)) @ inverse * (_SUMS / _FREE)
    growth = np.maximum(1.0, np.diag(scattered) / np.diag(inverse))
    covariance = inverse * np.sqrt(np.outer(growth, growth))
    return fitted[:2], np.asarray(covariance[:2, :2], dtype=np.float64)
