"""Tests of a count of marks against minute codes and pendulums, and what is to be distrusted of a time axis.

Over a mark's interval a pendulum's phase advances by the same amount to 1e-3 and better, whatever the paper does; a
count of marks that slips by one shows as half a swing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RefusedError
from pipeline.film.marks.alignment import Events
from pipeline.film.marks.counting import LEAST_LEAD, Count
from pipeline.film.marks.minutes import Minutes
from pipeline.film.parts import Floats, Strobe, TimeAxis, Tracks

NEAR = 8  # marks on either side that a pendulum's phase is averaged over
JUMP = 1.0  # rad: a third of what one mark too many makes
DISAGREE = 0.12  # of the codes, that may be false gaps in the place of one
MANY, LONG = 0.1, 5.0  # share of marks missing; s

HALF = 0.75  # swings on either side in which the phase is fitted
LEAST = 4.0  # px, of the swing's amplitude
FARTHEST, CARRIED = 1.2, 0.3  # windows' halves over which a phase is carried; rad, 1 sigma, of one half
RANGE, STEP = (0.85, 1.15), 0.005  # speeds for which the fit is prepared


def check_minutes(minutes: Minutes) -> None:
    """Refuse a count that the minute codes contradict.

    Raises
    ------
    RefusedError
        More codes are out of step than chance puts there.
    """
    if minutes.residue is not None and minutes.against > max(1.0, DISAGREE * minutes.seen):
        raise RefusedError(
            f"film: {minutes.against} of {minutes.seen + minutes.against} minute codes are out of step with the count "
            "of marks; cut the film where marks are missing and read the parts one by one"
        )


def check_leads(codes: Floats, events: Events, count: Count) -> None:
    """Refuse a count that could as well be another, where no minute codes on both sides confirm it.

    Parameters
    ----------
    codes : array
        Numbers of the minute marks whose codes were seen and agree.

    Raises
    ------
    RefusedError
        Over some stretch the number of marks is uncertain.
    """
    for at in np.flatnonzero(count.lead < LEAST_LEAD):
        before, after = count.index[at], count.index[at + 1]
        if (codes <= before).any() and (codes >= after).any():
            continue
        raise RefusedError(
            f"film: {after - before - 1} marks in a row are missing after row {events.row[count.event[at]]:.0f} and "
            "their number is uncertain; cut the film there and read the parts one by one"
        )


def jumps(index: Floats, phase: Floats, advance: Floats) -> Floats:
    """Jump of the pendulums' phase from before each mark to after it, the smallest of all traces, rad; NaN = unknown.

    Parameters
    ----------
    index : (marks,) array
    phase : (traces, marks) array
    advance : (traces,) array
        Phase from mark to mark, rad.
    """
    out = np.full((len(phase), index.size), np.nan)
    for trace, each in enumerate(phase):
        if not np.isfinite(advance[trace]):
            continue
        known = np.flatnonzero(np.isfinite(each))
        turned = np.exp(1j * (each[known] - advance[trace] * index[known]))
        if known.size < 2 * NEAR:
            continue
        total = np.concatenate([[0.0], np.cumsum(turned)])
        sums = total[NEAR:] - total[:-NEAR]  # of NEAR marks, by their first
        # the slow part of the phase: what two neighbouring stretches of the same length differ by is the pendulum's own
        out[trace, known[NEAR : known.size - NEAR + 1]] = np.abs(np.angle(sums[NEAR:] * np.conj(sums[:-NEAR])))
    known_any = np.isfinite(out).any(axis=0)
    least = np.full(index.size, np.nan)
    least[known_any] = np.nanmin(out[:, known_any], axis=0)
    return least


def check_swings(index: Floats, rows: Floats, phase: Floats, advance: Floats) -> None:
    """Refuse a count by which all pendulums would have lost or gained part of a swing at once.

    Raises
    ------
    RefusedError
        They jump.
    """
    jump = jumps(index, phase, advance)
    if not np.isfinite(jump).any():
        return
    worst = int(np.nanargmax(jump))
    if jump[worst] > JUMP:
        raise RefusedError(
            f"film: near row {rows[worst]:.0f} all pendulums jump by {jump[worst]:.1f} rad against the count of marks; "
            "cut the film there and read the parts one by one"
        )


def marks_seen(axis: TimeAxis, strobe: Strobe) -> NDArray[np.int64]:
    """Numbers of the marks that a trace shows, (marks,).

    A mark in the turning points of all traces may be too faint to be searched for, and yet be read where it is due.
    """
    return np.union1d(axis.index, strobe.index[np.isfinite(strobe.position).any(axis=0)])


def marks_flags(axis: TimeAxis, strobe: Strobe) -> tuple[str, ...]:
    """What to distrust of the marks: the axis's flags, and marks that no trace shows."""
    seen = marks_seen(axis, strobe)
    missing = {
        "marks-many-missing": seen.size < (1.0 - MANY) * (axis.index[-1] - axis.index[0] + 1),
        "marks-long-gap": bool((np.diff(seen) * axis.interval > LONG).any()),
    }
    return (*axis.flags, *(name for name, holds in missing.items() if holds))


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
