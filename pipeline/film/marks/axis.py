"""The time axis of a film: marks that were counted, and the paper's motion made of them.

The drive's model takes errors for independent from mark to mark. Dirt, bends of the course and oblique strokes are not;
but the paper moves all traces at once: what lasts in their differences is error.
"""

import itertools
import math

import numpy as np

from pipeline.film.edits import NO_MARKS, MarkEdits
from pipeline.film.marks.drive import Drive, aliased, drive, honest_gaps, slips
from pipeline.film.marks.numbering import Counted, number_marks
from pipeline.film.marks.search import GapSearch
from pipeline.film.parts import Floats, Marking, TimeAxis, Tracks

ROUNDS = 2  # of drive and shear
FEW_FALSE = 0.005  # share of marks that may be false
FINE = 16  # points of the paper's motion from mark to mark
ENOUGH = 24  # marks seen on several traces, from which these alone give offsets and shear
LAGS, ENOUGH_PAIRS = 4, 40  # marks: two swings; pairs of marks a lag
SHARED = 0.3  # of the marks' floor, where one trace shows the marks


def axis_of(search: GapSearch, tracks: Tracks, marking: Marking, marks: MarkEdits = NO_MARKS) -> TimeAxis:
    """The time axis that gaps make, or marks across the film; `marks` are those that a person set.

    `RefusedError`: no marks, or uncertain ones; `TimeReversedError`: upside down; `RecordError`: `marks` contradict.
    """
    counted, across = number_marks(search, tracks, marking, marks), search.across
    gaps, count, alignment, minutes = counted.gaps, counted.count, counted.alignment, counted.minutes
    row, sigma, column = np.full((3, len(counted.events.member), int(count.index[-1]) + 1), np.nan)
    for trace, member in enumerate(counted.events.member[:, count.event]):
        at, gap = count.index[member >= 0], member[member >= 0]
        row[trace, at], sigma[trace, at], column[trace, at] = gaps.row[gap], gaps.row_sigma[gap], gaps.column[gap]
    offset, shear, step = alignment.offset, alignment.shear, marking.interval
    jumps = count.index[np.searchsorted(counted.events.row[count.event], [each.row for each in counted.stands])]
    freed = row - offset[: len(row), None] - shear * column
    jumps = np.union1d(jumps, slips(freed)) if across is None else jumps
    paper = drive(freed, sigma, step, jumps=jumps)
    if across is None:
        for _ in range(ROUNDS):
            offset, shear, unsure = refined(row, sigma, column, paper)
            freed = row - offset[:, None] - shear * column
            paper = drive(freed, sigma, step, paper, jumps=jumps)
    else:
        unsure = across.shear_sigma * float(np.nanstd(tracks.course - np.nanmean(tracks.course, axis=1)[:, None]))
    paper = honest_gaps(freed, sigma, paper)
    shift = -(minutes.residue or 0) % minutes.cycle if counted.clock is None else counted.clock
    hidden, hidden_speed = aliased(freed, paper)
    lasts = float(np.linalg.norm([lasting(freed, paper), unsure, hidden]))
    seconds, seconds_sigma = times_of(paper, tracks.course.shape[1], lasts)
    seen = np.flatnonzero(paper.used.any(axis=0))
    relative = (paper.speed_sigma**2 + hidden_speed**2) / np.maximum(paper.speed, 1e-9) ** 2
    return TimeAxis(
        index=(seen + shift).astype(np.int64),
        row=paper.row[seen],
        row_sigma=paper.row_sigma[seen],
        shear=shear,
        offset=offset,
        row_of_trace=row[:, seen] if across is None else np.full((len(tracks.course), seen.size), np.nan),
        interval=step,
        seconds=seconds + shift * step,
        seconds_sigma=seconds_sigma,
        flags=_flags(counted, seen.size, marking.directed, across is not None),
        rate_sigma=float(np.sqrt(np.mean(relative))),
        doubts=tuple(((a + shift) * step, (b + shift) * step, by) for a, b, by in counted.doubts),
        kind="gaps" if across is None else across.kind,
        mark_sigma=_mark_sigma(freed, sigma, paper, hidden),
    )


def _mark_sigma(freed: Floats, sigma: Floats, paper: Drive, hidden: float) -> float:
    """1 sigma, s, of a mark's time, of all traces together: scatter, motion unseen between marks, missing marks."""
    weight = np.where(paper.used, 1.0 / (sigma**2 + paper.model.own**2), 0.0)
    seen = weight.any(axis=0)
    rest = np.nansum(weight * (freed - paper.row), axis=0)[seen] / weight.sum(axis=0)[seen]
    h, shake, roughness = paper.model.step, np.exp(2.0 * paper.model.shake), np.exp(2.0 * paper.model.roughness)
    unseen = shake * h**3 / 420.0 + roughness * h**5 / 55440.0 + hidden**2
    # marks that are missing side by side are late together
    together = np.bincount(np.cumsum(seen)[~seen], paper.row_sigma[~seen])
    unseen += np.sum(together**2) / seen.size
    return float(np.sqrt(np.mean(rest**2 + paper.row_sigma[seen] ** 2) + unseen) / np.median(paper.speed))


def _flags(counted: Counted, seen: int, directed: bool, beside: bool) -> tuple[str, ...]:
    minutes, count, events = counted.minutes, counted.count, counted.events
    false = count.event[-1] - count.event[0] + 1 - count.index.size - (minutes.seen if minutes.kind == "double" else 0)
    shown = (events.member >= 0).any(axis=1)
    raised = {
        "marks-without-minute-code": minutes.residue is None and counted.clock is None,
        "marks-direction-unknown": not directed and (minutes.residue is None or minutes.kind != "double"),
        "marks-codes-disagree": bool(counted.doubts) or counted.contradicted,
        "marks-beside-traces": beside,
        "marks-offset-unsure": not counted.alignment.sure,
        "marks-false": false > max(2.0, FEW_FALSE * seen),
        "film-stood-still": bool(counted.stands),
        "film-cut": not counted.whole,
        "marks-one-trace": int(shown.sum()) == 1 and len(events.member) > 1,
    }
    return tuple(name for name, holds in raised.items() if holds)


def times_of(paper: Drive, rows: int, lasting: float) -> tuple[Floats, Floats]:
    """Time since the first mark of the centre of each row, and 1 sigma, s; NaN beyond the marks.

    Between marks the motion is the polynomial of degree five that has row, speed and acceleration at both. The variance
    is the smoother's, what motion may do unseen, `shake^2 (x (1 - x) h)^3 / 3 + roughness^2 (x (1 - x) h)^5 / 20` at
    the share x of the way h, and `lasting`^2, px2: errors that neighbouring marks share.
    """
    from scipy.interpolate import BPoly, CubicSpline

    h, marks = paper.model.step, np.arange(paper.row.size)
    motion = BPoly.from_derivatives(h * marks, np.column_stack([paper.row, paper.speed, paper.acceleration]))
    seconds, sigma = np.full((2, rows), np.nan)
    centre = np.arange(rows) + 0.5
    seen = np.flatnonzero(paper.used.any(axis=0))
    lasts = [*(int(seen[seen < jump][-1]) for jump in paper.jumps), paper.row.size - 1]
    for first, last in zip([0, *paper.jumps.tolist()], lasts, strict=True):  # beside a stand the paper ran and stood
        if first == last:
            continue
        times = h * (first + np.arange((last - first) * FINE + 1) / FINE)
        at = motion(times)
        inside = (centre >= at[0]) & (centre <= at[-1])
        forward = np.maximum.accumulate(at) + 1e-9 * np.arange(at.size)
        seconds[inside] = CubicSpline(forward, times)(centre[inside])
    inside = np.isfinite(seconds)
    place = seconds[inside] / h
    variance = np.interp(place, marks, paper.row_sigma**2 + lasting**2)
    unseen = (place % 1.0) * (1.0 - place % 1.0) * h
    shake, roughness = np.exp(2.0 * paper.model.shake), np.exp(2.0 * paper.model.roughness)
    variance += shake * unseen**3 / 3.0 + roughness * unseen**5 / 20.0
    sigma[inside] = np.sqrt(variance) / np.interp(place, marks, np.maximum(paper.speed, 1e-9))
    return seconds, sigma


def refined(rows: Floats, sigma: Floats, columns: Floats, paper: Drive) -> tuple[Floats, float, float]:
    """Offsets of the traces, the first one's 0, shear, and what their errors make of a row, 1 sigma, by least squares.

    The row of a mark on several traces (traces, marks) is free; with too few of them rows are held to the motion.
    """
    traces = len(rows)
    used = paper.used & np.isfinite(rows) & np.isfinite(columns)
    several = used.sum(axis=0) > 1
    among = several.sum() >= ENOUGH  # themselves, what they share is no error
    shared = 0.0 if among else paper.model.floor
    weight = np.where(used, 1.0 / (sigma**2 + paper.model.own**2 + shared**2), 0.0)
    each_one = np.broadcast_to(np.eye(traces)[:, :, None], (traces, *rows.shape))
    terms = np.stack([*each_one, np.where(used, columns, 0.0), np.where(used, rows - paper.row, 0.0)])
    if among:
        weight[:, ~several] = 0.0
    mean = np.einsum("km,pkm->pm", weight, terms) / np.maximum(weight.sum(axis=0), 1e-300)
    terms[:, :, several] -= mean[:, None, several]
    normal = np.einsum("km,pkm,qkm->pq", weight, terms, terms)
    free = [*range(1, traces), traces] if traces > 1 else [0, 1]  # of one trace, what lies even is the paper's
    matrix = normal[np.ix_(free, free)]
    spread = np.linalg.inv(matrix + np.diag(1e-9 * np.diag(matrix) + 1e-12))
    *offset, shear = spread @ normal[free, traces + 1]
    # what all gaps share is the zero of time
    by = np.column_stack([np.eye(traces)[np.nonzero(used)[0]], columns[used]])
    by -= weight[used] @ by / max(float(weight[used].sum()), 1e-300)
    variance = np.einsum("ni,ij,nj->n", by[:, free], spread, by[:, free])
    unsure = float(np.sqrt(np.mean(variance))) if variance.size else 0.0
    return np.array([0.0, *offset[: traces - 1]]), float(shear), unsure


def lasting(rows: Floats, paper: Drive) -> float:
    """1 sigma of a mark's lasting error, px, of `rows` (traces, marks) freed of offsets and shear; NaN = missing."""
    residual = np.where(paper.used, rows - paper.row, np.nan)
    apart = [one - other for one, other in itertools.combinations(residual, 2)]
    products = [each[lag:] * each[:-lag] for each in apart for lag in range(1, LAGS + 1)]
    several = [known for each in products if (known := each[np.isfinite(each)]).size >= ENOUGH_PAIRS]
    if not several:
        return SHARED * math.hypot(paper.model.floor, paper.model.own)
    together = np.concatenate(several)
    chance = float(np.std(together)) / np.sqrt(together.size)
    of_one = 0.5 * max(float(np.mean(together)) - chance, 0.0)  # variance of a trace; a difference has two
    return float(np.sqrt(of_one / len(rows)))
