"""The pendulums as a clock: the phase of each trace's swing at given rows.

Over a mark's interval a pendulum's phase advances by the same amount to 1e-3 and better, whatever the paper does; a
count of marks that slips by one shows as half a swing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.film.parts import Floats, Tracks

HALF = 0.75  # swings on either side in which the phase is fitted
LEAST = 4.0  # px, of the swing's amplitude
FARTHEST, CARRIED = 1.2, 0.3  # windows' halves over which a phase is carried; rad, 1 sigma, of one half
RANGE, STEP = (0.85, 1.15), 0.005  # speeds for which the fit is prepared


def phases(tracks: Tracks, rows: Floats, stretch: Floats) -> tuple[Floats, Floats]:
    """Phase of every trace's swing at rows of that trace, rad, and the variance it has from being carried there.

    Where the trace is lost near a row, the phase is that of the nearest whole piece, carried on at its frequency; both
    results are (traces, n), NaN where that is too far or the swing too small.

    Parameters
    ----------
    rows : (traces, n) array
    stretch : (n,) array
        Rows per second there over the film's mean.
    """
    half = max(round(HALF * tracks.rows_per_swing), 3)
    x = np.arange(-half, half + 1.0)
    speed = np.round(np.clip(np.nan_to_num(stretch, nan=1.0), *RANGE) / STEP).astype(np.int64)
    out, doubt = np.full(rows.shape, np.nan), np.full(rows.shape, np.nan)
    for trace, course in enumerate(tracks.course):
        middle = np.nan_to_num(rows[trace], nan=-1e9) - 0.5
        near = _nearest_whole(course, np.round(middle).astype(np.int64), half)
        carried = middle - near
        inside = (near >= 0) & (np.abs(carried) <= FARTHEST * half)
        for which in np.unique(speed[inside]):
            turn = 2.0 * np.pi / (tracks.rows_per_swing * which * STEP)
            basis = np.stack([np.cos(turn * x), np.sin(turn * x), *[(x / half) ** k for k in range(4)]])
            taps = np.linalg.pinv(basis.T)[:2]
            at = np.flatnonzero(inside & (speed == which))
            cos, sin = taps @ course[near[at][:, None] + np.arange(-half, half + 1)].T
            known = np.hypot(cos, sin) > LEAST
            out[trace, at] = np.where(known, np.arctan2(-sin, cos) + turn * carried[at], np.nan)
            doubt[trace, at] = (CARRIED * np.maximum(np.abs(carried[at]) - 1.0, 0.0) / half) ** 2
    return out, doubt


def _nearest_whole(course: Floats, rows: NDArray[np.int64], half: int) -> NDArray[np.int64]:
    """Rows nearest to given ones around which a curve is known for `half` rows; -1 where there are none."""
    lost = np.concatenate([[0], np.cumsum(~np.isfinite(course))])
    whole = half + np.flatnonzero(lost[2 * half + 1 :] == lost[: -2 * half - 1])
    if whole.size == 0:
        return np.full(rows.size, -1, dtype=np.int64)
    after = np.minimum(np.searchsorted(whole, rows), whole.size - 1)
    before = np.maximum(after - 1, 0)
    return np.asarray(
        np.where(np.abs(whole[after] - rows) <= np.abs(whole[before] - rows), whole[after], whole[before])
    )


def stretched(rows: Floats, spacing: float) -> Floats:
    """Rows per second around each event over the film's mean, by the distances of its neighbours."""
    apart = np.diff(rows)
    good = np.abs(apart - spacing) < 0.13 * spacing
    if good.sum() < 3:
        return np.ones(rows.size)
    at, apart = 0.5 * (rows[1:] + rows[:-1])[good], apart[good]
    held = np.pad(apart, 2, mode="edge")
    calm = np.median(np.stack([held[k : k + apart.size] for k in range(5)]), axis=0)
    return np.asarray(np.interp(rows, at, calm) / spacing)


def advance(rows: Floats, phase: Floats, spacing: Floats) -> tuple[Floats, Floats]:
    """Phase by which each trace advances from mark to mark, rad in -pi to pi, and its 1 sigma; NaN where unknown.

    Parameters
    ----------
    rows : (events,) array
    phase : (traces, events) array
    spacing : (events,) array
        Rows between marks around each event.
    """
    mean, spread = np.full(len(phase), np.nan), np.full(len(phase), np.nan)
    next_one = np.abs(np.diff(rows) - spacing[1:]) < 0.06 * spacing[1:]
    for trace, each in enumerate(phase):
        step = np.diff(each)[next_one]
        step = step[np.isfinite(step)]
        if step.size < 8:
            continue
        centre = np.angle(np.exp(1j * step).sum())
        for _ in range(5):
            away = np.angle(np.exp(1j * (step - centre)))
            centre += np.median(away)
        away = np.angle(np.exp(1j * (step - centre)))
        mean[trace], spread[trace] = centre, max(1.4826 * float(np.median(np.abs(away))), 0.01)
    return mean, spread
