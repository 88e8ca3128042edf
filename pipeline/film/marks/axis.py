"""The time axis of a film: gaps found, brought together, counted, checked, and the paper's motion made of them."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RefusedError
from pipeline.arrays import median_present
from pipeline.film.edits import MarkEdits
from pipeline.film.emulsion import FilmEmulsion, shown_darkness
from pipeline.film.marks.alignment import Alignment, Events, aligned, gathered, lasting, refined
from pipeline.film.marks.by_hand import Clock, with_marks
from pipeline.film.marks.checks import DISAGREE, LEAST_LEAD, certain_part, check
from pipeline.film.marks.counting import LEAST_MARKS, Count, counted, spacing_of
from pipeline.film.marks.drive import Drive, aliased, drive, honest_gaps, slips
from pipeline.film.marks.lines import Lines, NoMarksError, fitted, ticks, widened
from pipeline.film.marks.minutes import Minutes, TimeReversedError, code_marks, doubts, find_minutes
from pipeline.film.marks.pieces import over_pieces
from pipeline.film.marks.search import Gaps, find_gaps, learned_width
from pipeline.film.marks.stands import (
    Bars,
    Side,
    Stand,
    bars,
    free_columns,
    lengths,
    light_across,
    swept,
    together,
)
from pipeline.film.marks.swings import Swings, swings_at
from pipeline.film.parts import Emulsion, Floats, Marking, TimeAxis, Tracks
from pipeline.film.scan.opening import OpenScan

ROUNDS = 2  # of drive and shear
SPEED_TOLERANCE = 0.25  # of the stated speed
FEW_FALSE = 0.005  # share of marks that may be false
LEAST_PART = 0.2  # of the film, of a part that is read where others are uncertain
SIDES: tuple[Literal["left"], Literal["right"]] = ("left", "right")
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


def time_axis(
    scan: OpenScan,
    emulsion: Emulsion,
    tracks: Tracks,
    marking: Marking,
    jobs: int = 1,
    film: FilmEmulsion | None = None,
    found: GapSearch | RefusedError | None = None,
    marks: MarkEdits | None = None,
) -> TimeAxis:
    """When each row of a film was exposed, by gaps in its traces or by marks beside them, as `film` shows those.

    What marks the film is as `marking` says. Otherwise dark lines count, which leave no gaps; then gaps; then the rest.
    `jobs` threads may work. `found` is what `search_gaps` gave, if it was asked; `marks` are those that a person set.

    Raises
    ------
    RefusedError
        Marks cannot be found, or their number is not certain.
    TimeReversedError
        The film lies upside down.
    RecordError
        A person's marks contradict each other.
    """
    across, kind = None if film is None else film.blank.across, kind_of(marking, film)
    if film is not None and kind != "gaps":
        return _beside(scan, emulsion, tracks, marking, jobs, film, kind, marks)
    try:
        if isinstance(found, RefusedError):
            raise found
        gaps, bars, width = search_gaps(scan, emulsion, tracks, marking, jobs) if found is None else found
        return axis_of(gaps, tracks, marking, width, scan.rows, bars, marks=marks)
    except TimeReversedError:
        raise
    except RefusedError as fault:
        if film is None or marking.kind is not None:
            raise
        beside = "edge" if across is None else across.kind
        try:
            return _beside(scan, emulsion, tracks, marking, jobs, film, beside, marks)
        except NoMarksError:
            raise fault from None


def kind_of(marking: Marking, film: FilmEmulsion | None) -> str:
    """Where marks are looked for first; see `Marking`."""
    across = None if film is None else film.blank.across
    return marking.kind or ("dark-lines" if across is not None and across.kind == "dark-lines" else "gaps")


class GapSearch(NamedTuple):
    """Gaps on the traces, where the paper stood, and the width of a gap, px."""

    gaps: Gaps
    bars: Bars
    width: float


def search_gaps(scan: OpenScan, emulsion: Emulsion, tracks: Tracks, marking: Marking, jobs: int = 1) -> GapSearch:
    """Look for gaps on the traces of a film; raises as `search.learned_width`."""
    if marking.gap is not None and marking.speed is not None:
        width = marking.gap * marking.speed
    else:
        width = learned_width(scan, emulsion, tracks)
    return GapSearch(*find_gaps(scan, emulsion, tracks, width, jobs), width)


def _beside(
    scan: OpenScan,
    emulsion: Emulsion,
    tracks: Tracks,
    marking: Marking,
    jobs: int,
    film: FilmEmulsion,
    kind: str,
    marks: MarkEdits | None,
) -> TimeAxis:
    """The time axis by marks beside the traces; raises as `time_axis`."""
    lines = film.blank.across
    if kind == "edge":
        lines = ticks(partial(shown_darkness, film, scan), scan.rows, free_columns(tracks, scan.columns))
    if lines is None or lines.kind != kind:
        raise NoMarksError(f"film: no {kind.replace('-', ' ')} run across it; state another mark_kind")
    if not np.isfinite(tracks.position).any():
        raise RefusedError(
            f"film: {kind.replace('-', ' ')} mark it, and swings as dense as these are read in gaps alone; "
            "scan a faster film, or read it with --reading continuous"
        )
    own = swept(tracks, scan.columns)

    def light(begin: int, stop: int, first: int, exposure: NDArray[np.float32]) -> Floats:
        return light_across(exposure[begin - first : stop - first], own)

    shown = bars(np.concatenate(over_pieces(scan, emulsion, light, jobs), axis=2), own, tracks, emulsion)
    return axis_of(fitted(lines), tracks, marking, 1.0, scan.rows, shown, lines, marks)


def axis_of(
    gaps: Gaps,
    tracks: Tracks,
    marking: Marking,
    width: float,
    rows: int,
    bars: Bars | None = None,
    across: Lines | None = None,
    marks: MarkEdits | None = None,
) -> TimeAxis:
    """The time axis that gaps make, or marks `across`; `width` of a gap and `rows` of the film in px.

    `marks` are those that a person set. Raises as `time_axis`.
    """
    counted = count_gaps(gaps, tracks, marking, width, bars, across, marks)
    gaps, count, alignment = counted.gaps, counted.count, counted.alignment
    row, sigma, column = np.full((3, len(counted.events.member), int(count.index[-1]) + 1), np.nan)
    for trace, member in enumerate(counted.events.member[:, count.event]):
        at, gap = count.index[member >= 0], member[member >= 0]
        row[trace, at], sigma[trace, at], column[trace, at] = gaps.row[gap], gaps.row_sigma[gap], gaps.column[gap]
    offset, shear, unsure = alignment.offset, alignment.shear, 0.0
    jumps = count.index[np.searchsorted(counted.events.row[count.event], [each.row for each in counted.stands])]
    freed = row - offset[: len(row), None] - shear * column
    jumps = np.union1d(jumps, slips(freed)) if across is None else jumps
    found = drive(freed, sigma, marking.interval, jumps=jumps)
    for _ in range(ROUNDS if across is None else 0):
        offset, shear, unsure = refined(row, sigma, column, found)
        freed = row - offset[:, None] - shear * column
        found = drive(freed, sigma, marking.interval, found, jumps=jumps)
    if across is not None:
        unsure = across.shear_sigma * float(np.nanstd(tracks.course - np.nanmean(tracks.course, axis=1)[:, None]))
    found = honest_gaps(freed, sigma, found)
    cycle = round(60.0 / marking.interval)
    shift = 0 if counted.minutes.residue is None else (-counted.minutes.residue) % cycle
    shift = shift if counted.clock is None else counted.clock
    hidden, hidden_speed = aliased(freed, found)
    lasts = float(np.linalg.norm([lasting(freed, found), unsure, hidden]))
    seconds, seconds_sigma = times_of(found, rows, lasts)
    seen = np.flatnonzero((np.isfinite(row) & found.used).any(axis=0))
    return TimeAxis(
        index=(seen + shift).astype(np.int64),
        row=found.row[seen],
        row_sigma=found.row_sigma[seen],
        shear=shear,
        offset=offset,
        row_of_trace=row[:, seen] if across is None else np.full((len(tracks.course), seen.size), np.nan),
        interval=marking.interval,
        seconds=seconds + shift * marking.interval,
        seconds_sigma=seconds_sigma,
        flags=_flags(counted, seen.size, marking.directed, across is not None),
        rate_sigma=float(
            np.sqrt(np.mean((found.speed_sigma**2 + hidden_speed**2) / np.maximum(found.speed, 1e-9) ** 2))
        ),
        doubts=tuple(
            ((first + shift) * marking.interval, (last + shift) * marking.interval, by)
            for first, last, by in counted.doubts
        ),
        kind="gaps" if across is None else across.kind,
        mark_sigma=mark_sigma(freed, sigma, found),
    )


def mark_sigma(freed: Floats, sigma: Floats, found: Drive) -> float:
    """1 sigma of a mark's time, s, of all traces together: what they leave of the motion, and what that took of it."""
    weight = np.where(found.used, 1.0 / (sigma**2 + found.floor**2), 0.0)
    seen = weight.any(axis=0)
    left = np.nansum(weight * (freed - found.row), axis=0)[seen] / weight.sum(axis=0)[seen]
    return float(np.sqrt(np.mean(left**2 + found.row_sigma[seen] ** 2)) / np.median(found.speed))


def count_gaps(
    gaps: Gaps,
    tracks: Tracks,
    marking: Marking,
    width: float,
    bars: Bars | None = None,
    across: Lines | None = None,
    marks: MarkEdits | None = None,
) -> Counted:
    """Gaps, or marks `across` the film, brought together over the traces and counted; raises as `time_axis`."""
    traces = len(tracks.course)
    busiest = int(np.argmax(np.bincount(gaps.trace, minlength=traces)))
    spacing = spacing_of(gaps.row[gaps.trace == busiest])
    if marking.speed is not None and abs(spacing / (marking.speed * marking.interval) - 1.0) > SPEED_TOLERANCE:
        raise RefusedError(
            f"film: marks lie {spacing:.1f} rows apart, but {marking.speed:.4g} rows per second and marks every "
            f"{marking.interval:g} s make {marking.speed * marking.interval:.1f}; state the right speed or interval"
        )
    alignment, clock = Alignment(np.zeros(traces), 0.0, True), None
    alignment = aligned(gaps, traces, spacing) if across is None else replace(alignment, shear=across.shear)
    if marks is not None:
        gaps = with_marks(gaps, marks, tracks, alignment, spacing, width, across is not None)
        clock = Clock.of(marks, tracks, alignment, marking.interval)
    if across is None:
        events = gathered(gaps, alignment, traces, width)
    else:
        events = Events(gaps.row, gaps.row_sigma, gaps.width, gaps.width_sigma, np.arange(gaps.size)[None])
    # an oblique image bends the swing, but its first harmonic keeps the phase of the swing's middle
    middle = np.array([median_present(each) for each in tracks.course])
    places = events.row + (alignment.offset + alignment.shear * middle)[:, None]
    swings = swings_at(tracks, events.row, places, spacing)
    swings = swings.unsure(2.0 * np.pi / tracks.rows_per_swing * events.row_sigma)
    stands = together(bars, alignment.offset, alignment.shear, middle) if bars else []
    stands = [each for each in stands if events.row[0] < each.row < events.row[-1]]
    if marks is not None:
        stands = sorted([*stands, *(Stand(row, np.nan, True) for row in marks.breaks.tolist())])
    count, stands, whole = _past_stands(events, stands, swings, spacing, marking, clock)
    minutes = find_minutes(events, count, marking)
    if across is not None and across.kind == "dark-lines":  # on either side of a broad one the number is not certain
        beside = [np.searchsorted(events.row[count.event], widened(gaps), side) - 1 for side in SIDES]
        count.lead[np.clip(beside, 0, count.lead.size - 1)] = 0.0
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


def _flags(counted: Counted, seen: int, directed: bool, beside: bool) -> tuple[str, ...]:
    minutes, count, events = counted.minutes, counted.count, counted.events
    false = count.event[-1] - count.event[0] + 1 - count.index.size - (minutes.seen if minutes.kind == "double" else 0)
    shown = (events.member >= 0).any(axis=1)
    flags = {
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
