"""The time axis of a film: gaps found, brought together, counted, checked, and the paper's motion made of them."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.film.edits import MarkEdits
from pipeline.film.marks.alignment import Alignment, Events, aligned, gathered, lasting, refined
from pipeline.film.marks.by_hand import Clock, with_marks
from pipeline.film.marks.checks import DISAGREE, LEAST_LEAD, certain_part, check
from pipeline.film.marks.counting import LEAST_MARKS, Count, counted, spacing_of
from pipeline.film.marks.drive import Drive, drive, honest_gaps
from pipeline.film.marks.minutes import Minutes, code_marks, doubts, find_minutes
from pipeline.film.marks.search import Gaps
from pipeline.film.marks.stands import Bars, Side, Stand, lengths, together
from pipeline.film.marks.swings import Swings, swings_at
from pipeline.film.parts import Floats, Marking, TimeAxis, Tracks

ROUNDS = 2  # of drive and shear
SPEED_TOLERANCE = 0.25  # of the stated speed
FEW_FALSE = 0.005  # share of marks that may be false
LEAST_PART = 0.2  # of the film, of a part that is read where others are uncertain
FINE = 16  # points of the paper's motion from mark to mark


@dataclass(frozen=True)
class Counted:
    """Events of a film and the count of marks among them, checked."""

    gaps: Gaps
    events: Events
    count: Count
    minutes: Minutes
    alignment: Alignment
    stands: list[Stand]
    whole: bool  # nothing was cut off where the number of marks is not certain
    doubts: list[tuple[float, float, float]]  # as `minutes.doubts`
    clock: int | None  # what clock times add to the marks' numbers
    contradicted: bool  # the minutes that codes show are not those of the clock times


def axis_of(
    gaps: Gaps,
    tracks: Tracks,
    marking: Marking,
    width: float,
    rows: int,
    bars: Bars | None = None,
    marks: MarkEdits | None = None,
) -> TimeAxis:
    """When each row of a film was exposed: the time axis that gaps make.

    Parameters
    ----------
    width, rows
        Of a gap, and of the film, px.
    bars
        Where the paper stood (`marks.stands`).
    marks
        Those that a person set.

    Raises
    ------
    RefusedError
        Marks cannot be found, or their number is not certain.
    TimeReversedError
        The film lies upside down.
    RecordError
        A person's marks contradict each other.
    """
    counted = count_gaps(gaps, tracks, marking, width, bars, marks)
    gaps, count, alignment = counted.gaps, counted.count, counted.alignment
    row, sigma, column = np.full((3, len(tracks.course), int(count.index[-1]) + 1), np.nan)
    for trace, member in enumerate(counted.events.member[:, count.event]):
        at, gap = count.index[member >= 0], member[member >= 0]
        row[trace, at], sigma[trace, at], column[trace, at] = gaps.row[gap], gaps.row_sigma[gap], gaps.column[gap]
    offset, shear, unsure = alignment.offset, alignment.shear, 0.0
    jumps = count.index[np.searchsorted(counted.events.row[count.event], [each.row for each in counted.stands])]
    found = drive(row - offset[:, None] - shear * column, sigma, marking.interval, jumps=jumps)
    for _ in range(ROUNDS):
        offset, shear, unsure = refined(row, sigma, column, found)
        freed = row - offset[:, None] - shear * column
        found = drive(freed, sigma, marking.interval, found, jumps=jumps)
    found = honest_gaps(freed, sigma, found)
    cycle = round(60.0 / marking.interval)
    shift = 0 if counted.minutes.residue is None else (-counted.minutes.residue) % cycle
    shift = shift if counted.clock is None else counted.clock
    seconds, seconds_sigma = times_of(found, rows, float(np.hypot(lasting(freed, found), unsure)))
    seen = np.flatnonzero((np.isfinite(row) & found.used).any(axis=0))
    return TimeAxis(
        index=(seen + shift).astype(np.int64),
        row=found.row[seen],
        row_sigma=found.row_sigma[seen],
        shear=shear,
        offset=offset,
        row_of_trace=row[:, seen],
        interval=marking.interval,
        seconds=seconds + shift * marking.interval,
        seconds_sigma=seconds_sigma,
        flags=_flags(counted, seen.size),
        rate_sigma=float(np.sqrt(np.mean((found.speed_sigma / np.maximum(found.speed, 1e-9)) ** 2))),
        doubts=tuple(
            ((first + shift) * marking.interval, (last + shift) * marking.interval, by)
            for first, last, by in counted.doubts
        ),
    )


def count_gaps(
    gaps: Gaps,
    tracks: Tracks,
    marking: Marking,
    width: float,
    bars: Bars | None = None,
    marks: MarkEdits | None = None,
) -> Counted:
    """Gaps brought together over the traces and counted; raises as `axis_of`."""
    traces = len(tracks.course)
    busiest = int(np.argmax(np.bincount(gaps.trace, minlength=traces)))
    spacing = spacing_of(gaps.row[gaps.trace == busiest])
    if marking.speed is not None and abs(spacing / (marking.speed * marking.interval) - 1.0) > SPEED_TOLERANCE:
        raise RefusedError(
            f"film: gaps lie {spacing:.1f} rows apart, but {marking.speed:.4g} rows per second and marks every "
            f"{marking.interval:g} s make {marking.speed * marking.interval:.1f}; state the right speed or interval"
        )
    alignment, clock = aligned(gaps, traces, spacing), None
    if marks is not None:
        gaps = with_marks(gaps, marks, tracks, alignment, spacing, width)
        clock = Clock.of(marks, tracks, alignment, marking.interval)
    events = gathered(gaps, alignment, traces, width)
    # an oblique image bends the swing, but its first harmonic keeps the phase of the swing's middle
    middle = np.array(
        [float(np.median(gaps.column[gaps.trace == k])) if (gaps.trace == k).any() else 0.0 for k in range(traces)]
    )
    places = events.row + (alignment.offset + alignment.shear * middle)[:, None]
    swings = swings_at(tracks, events.row, places, spacing)
    swings = swings.unsure(2.0 * np.pi / tracks.rows_per_swing * events.row_sigma)
    stands = together(bars, alignment.offset, alignment.shear, middle) if bars else []
    if marks is not None:
        stands = sorted([*stands, *(Stand(row, np.nan, True) for row in marks.breaks.tolist())])
    count, stands, whole = _past_stands(events, stands, swings, spacing, marking, clock)
    minutes = find_minutes(events, count, marking)
    part = certain_part(count, code_marks(minutes, events, count, marking.interval))
    if part.index.size < count.index.size:
        if part.index[-1] < LEAST_PART * count.index[-1]:
            raise RefusedError(
                "film: over several stretches without marks the number of marks is uncertain; cut the film there and "
                "read the parts one by one"
            )
        first, last = events.row[part.event[[0, -1]]]
        stands = [each for each in stands if first < each.row < last]
        count, whole, minutes = part, False, find_minutes(events, part, marking)
    check(minutes, events, count, swings)
    shift = None if clock is None else clock.offset(events, count, spacing)
    odd = minutes.against > DISAGREE * minutes.seen
    wrong = doubts(minutes, events, count, marking.interval) if odd else []
    cycle, residue = round(60.0 / marking.interval), minutes.residue
    against = shift is not None and residue is not None and (shift + residue) % cycle != 0
    return Counted(gaps, events, count, minutes, alignment, stands, whole, wrong, shift, against)


def _past_stands(
    events: Events, stands: list[Stand], swings: Swings, spacing: float, marking: Marking, clock: Clock | None
) -> tuple[Count, list[Stand], bool]:
    """Marks counted between the stands, and joined over those whose lengths codes or pendulums show.

    Given are the count of the longest part within which it is certain, the stands in it, and whether it is all.
    """
    if not stands:
        return counted(events.row, events.row_sigma, swings, spacing), [], True
    edges = [0, *np.searchsorted(events.row, [each.row for each in stands]).tolist(), events.size]
    cycle, whole, last = round(60.0 / marking.interval), True, -1
    parts: list[tuple[Count, list[Stand], int | None]] = []
    for at, (begin, end) in enumerate(itertools.pairwise(edges)):
        if end - begin < 2 * LEAST_MARKS:
            whole = False
            continue
        some = slice(begin, end)
        part = counted(events.row[some], events.row_sigma[some], swings.at(some), spacing)
        part = Count(part.event + begin, part.index, part.lead)
        minutes = find_minutes(events, part, marking)
        code = minutes.residue if minutes.seen > 2 * minutes.against else None
        number = np.zeros(0, dtype=np.int64)
        if parts and last == at - 1:
            before, within, minute = parts[-1]
            one, other = (
                Side(events.row[each.event], each.index, swings.at(each.event).phase) for each in (before, part)
            )
            times = [None if clock is None else clock.offset(events, each, spacing) for each in (before, part)]
            if times[0] is not None and times[1] is not None:
                number, cost = np.array([times[1] - times[0] - before.index[-1]]), np.zeros(1)
            elif np.isnan(stands[at - 1].length):  # a person does not know either
                number, cost = np.zeros(0, dtype=np.int64), np.zeros(0)
            else:
                number, cost = lengths(one, other, swings.advance, swings.sigma, stands[at - 1], spacing)
            if code is not None and minute is not None:
                agrees = (number + before.index[-1] + code - minute) % cycle == 0
                agrees &= cost < cost[0] + LEAST_LEAD  # a false gap may look like a code
                number, cost = number[agrees], cost[agrees]
            if cost.size > 1 and cost[1] - cost[0] < LEAST_LEAD:
                number = number[:0]
        last = at
        if not number.size:
            whole = whole and not parts
            parts.append((part, [], code))
            continue
        shift = int(before.index[-1] + number[0])
        joined = Count(
            np.concatenate([before.event, part.event]),
            np.concatenate([before.index, shift + part.index]),
            np.concatenate([before.lead, [np.inf], part.lead]),
        )
        found = minute if minute is not None else None if code is None else (code + shift) % cycle
        parts[-1] = joined, [*within, stands[at - 1]], found
    if not parts:
        raise RefusedError("film: the paper stood still again and again; cut the film and read the parts one by one")
    count, own, _ = max(parts, key=lambda each: each[0].index[-1])
    return count, own, whole


def _flags(counted: Counted, seen: int) -> tuple[str, ...]:
    minutes, count, events = counted.minutes, counted.count, counted.events
    false = count.event[-1] - count.event[0] + 1 - count.index.size - (minutes.seen if minutes.kind == "double" else 0)
    shown = (events.member >= 0).any(axis=1)
    flags = {
        "marks-without-minute-code": minutes.residue is None and counted.clock is None,
        "marks-direction-unknown": minutes.residue is None or minutes.kind != "double",
        "marks-codes-disagree": bool(counted.doubts) or counted.contradicted,
        "marks-offset-unsure": not counted.alignment.sure,
        "marks-false": false > max(2.0, FEW_FALSE * seen),
        "film-stood-still": bool(counted.stands),
        "film-cut": not counted.whole,
        "marks-one-trace": int(shown.sum()) == 1 and len(events.member) > 1,
    }
    return tuple(name for name, holds in flags.items() if holds)


def times_of(found: Drive, rows: int, lasting: float) -> tuple[Floats, Floats]:
    """Time since the first mark of the centre of each row, and 1 sigma, s; NaN beyond the marks.

    Between marks the motion is the polynomial of degree five that has row, speed and acceleration at both.

    The variance is the sum of three. At the marks, that of the drive's smoother, which knows the gaps' noise and how
    rough the paper ran, both as the film itself shows them; between two marks, what a motion as rough may do unseen
    while row and speed at both are held, `shake^2 (x (1 - x) h)^3 / 3 + roughness^2 (x (1 - x) h)^5 / 20` at the share
    x of the way h; and that of `lasting`, px: errors that neighbouring marks share, of their gaps, the traces' offsets
    and the shear, which no smoother tells from motion. It is that of a time read on any trace; the zero of time, common
    to all rows, is not in it.
    """
    from scipy.interpolate import BPoly, CubicSpline

    h, marks = found.model.step, np.arange(found.row.size)
    motion = BPoly.from_derivatives(h * marks, np.column_stack([found.row, found.speed, found.acceleration]))
    seconds, sigma = np.full((2, rows), np.nan)
    centre = np.arange(rows) + 0.5
    seen = np.flatnonzero(found.used.any(axis=0))
    lasts = [*(int(seen[seen < jump][-1]) for jump in found.jumps), found.row.size - 1]
    for first, last in zip([0, *found.jumps.tolist()], lasts, strict=True):  # beside a stand the paper ran and stood
        times = h * (first + np.arange((last - first) * FINE + 1) / FINE)
        at = motion(times)
        inside = (centre >= at[0]) & (centre <= at[-1])
        forward = np.maximum.accumulate(at) + 1e-9 * np.arange(at.size)
        seconds[inside] = CubicSpline(forward, times)(centre[inside])
    inside = np.isfinite(seconds)
    place = seconds[inside] / h
    variance = np.interp(place, marks, found.row_sigma**2 + lasting**2)
    unseen = (place % 1.0) * (1.0 - place % 1.0) * h
    shake, roughness = np.exp(2.0 * found.model.shake), np.exp(2.0 * found.model.roughness)
    variance += shake * unseen**3 / 3.0 + roughness * unseen**5 / 20.0
    sigma[inside] = np.sqrt(variance) / np.interp(place, marks, np.maximum(found.speed, 1e-9))
    return seconds, sigma
