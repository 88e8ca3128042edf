"""Two readings of one film compared: the phase of each trace by the rows between the marks, and by the marks alone.

Both are taken as departures from the same course, so that what they share (swell, amplitude) drops out. Each half
minute, the departures are fitted by a line, the course and its rate; the latter's share is the difference in time.
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
_STEP = 0.01  # s, over which the course's rate is taken
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
    """Phase of every trace each half minute by the strobe less that by the normal points of the rows."""
    marks = np.asarray(strobe.index * axis.interval, dtype=np.float64)
    begin = np.floor(min(samples.time[0], marks[0]) / BLOCK) * BLOCK
    start = np.arange(begin, max(samples.time[-1], marks[-1]), BLOCK)
    phase, sigma = np.full((2, len(tracks.course), start.size), np.nan)
    rate = (
        2.0 * np.pi / tracks.rows_per_swing * float(np.median(1.0 / np.diff(axis.seconds[np.isfinite(axis.seconds)])))
    )
    for trace in range(len(phase)):
        seconds = row_times(tracks, axis, trace)
        readings = []
        for times, column, spread in (
            (marks, strobe.position[trace], strobe.sigma[trace]),
            (samples.time, samples.column[trace], samples.sigma[trace]),
        ):
            before, course, after = (
                course_at(tracks, axis, trace, seconds, times + late) for late in (-_STEP, 0.0, _STEP)
            )
            readings.append((times, column - course, spread, course, 0.5 * (after - before) / _STEP))
        for block, first in enumerate(start):
            fits = [_lead(first, *reading) for reading in readings]
            if fits[0] is not None and fits[1] is not None:
                phase[trace, block] = rate * (fits[0][0] - fits[1][0])
                sigma[trace, block] = rate * np.hypot(fits[0][1], fits[1][1])
    return PhaseDifference(start, phase, sigma)


def _lead(
    first: float, times: Floats, values: Floats, spread: Floats, course: Floats, speed: Floats
) -> tuple[float, float] | None:
    """By how much a reading leads the course in the half minute from `first`, s, and 1 sigma; None with too few."""
    inside = (times >= first) & (times < first + BLOCK) & np.isfinite(values + speed) & (spread > 0.0)
    if np.count_nonzero(inside) < _FEWEST:
        return None
    t = times[inside] - first - 0.5 * BLOCK
    place = course[inside] - course[inside].mean()
    columns = np.stack([speed[inside], place, np.ones_like(t), t], axis=1) / spread[inside, None]
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
    return float(fitted[0]), float(np.sqrt(max(inverse[0, 0], scattered[0, 0])))
