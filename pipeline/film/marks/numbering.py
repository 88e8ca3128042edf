"""Events of a film brought together over its traces, counted over the places where the paper stood, and checked."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import median_present
from pipeline.film.edits import Clock, MarkEdits, with_marks
from pipeline.film.marks.alignment import Alignment, Events, aligned, gathered
from pipeline.film.marks.counting import LEAST_MARKS, Count, counted, spacing_of
from pipeline.film.marks.lines import widened
from pipeline.film.marks.minutes import Minutes, code_marks, doubts, find_minutes
from pipeline.film.marks.search import Gaps, GapSearch
from pipeline.film.marks.stands import Stand, lengths, together
from pipeline.film.marks.swings import Swings, jumps, swings_at
from pipeline.film.parts import Floats, Marking, Tracks

SPEED_TOLERANCE = 0.25  # of the stated speed
LEAST_PART = 0.2  # of the film, of a part that is read where others are uncertain
LEAST_LEAD = 12.0  # of the best count before any other
JUMP = 1.0  # rad: a third of what one mark too many makes
DISAGREE = 0.12  # of the codes, that may be false gaps in the place of one
SIDES: tuple[Literal["left"], Literal["right"]] = ("left", "right")


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


class Part(NamedTuple):
    """A stretch of film over which marks are counted on."""

    marks: Count
    stands: list[Stand]
    residue: int | None  # of the full minutes' marks, where codes show it


def number_marks(search: GapSearch, tracks: Tracks, marking: Marking, marks: MarkEdits) -> Counted:
    """Gaps, or marks across the film, brought together over the traces and counted; as `axis.axis_of`."""
    gaps, across, traces = search.gaps, search.across, len(tracks.course)
    busiest = int(np.argmax(np.bincount(gaps.trace, minlength=traces)))
    spacing = spacing_of(gaps.row[gaps.trace == busiest])
    if marking.speed is not None and abs(spacing / (marking.speed * marking.interval) - 1.0) > SPEED_TOLERANCE:
        raise RefusedError(
            f"film: marks lie {spacing:.1f} rows apart, but {marking.speed:.4g} rows per second and marks every "
            f"{marking.interval:g} s make {marking.speed * marking.interval:.1f}; state the right speed or interval"
        )
    alignment = aligned(gaps, traces, spacing) if across is None else Alignment(np.zeros(traces), across.shear, True)
    gaps = with_marks(gaps, marks, tracks, alignment, spacing, search.width, across is not None)
    clock = Clock.of(marks, tracks, alignment, marking.interval)
    if across is None:
        events = gathered(gaps, alignment, traces, search.width)
    else:
        events = Events(gaps.row, gaps.row_sigma, gaps.width, gaps.width_sigma, np.arange(gaps.size)[None])
    # an oblique image bends the swing, but its first harmonic keeps the phase of the swing's middle
    middle = np.array([median_present(each) for each in tracks.course])
    places = events.row + (alignment.offset + alignment.shear * middle)[:, None]
    swings = swings_at(tracks, events, places, spacing)
    stands = together(search.bars, alignment.offset, alignment.shear, middle)
    stands = [each for each in stands if events.row[0] < each.row < events.row[-1]]
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
    shift = clock.offset(events, count, spacing)
    odd = minutes.against > DISAGREE * minutes.seen
    wrong = doubts(minutes, events, count, marking.interval) if odd else []
    cycle, residue = round(60.0 / marking.interval), minutes.residue
    against = shift is not None and residue is not None and (shift + residue) % cycle != 0
    return Counted(gaps, events, count, minutes, alignment, stands, whole, wrong, shift, against)


def _past_stands(
    events: Events, stands: list[Stand], swings: Swings, spacing: float, marking: Marking, clock: Clock
) -> tuple[Count, list[Stand], bool]:
    """Marks counted between the stands, and joined over those whose lengths codes or pendulums show.

    Given are the count of the longest part within which it is certain, the stands in it, and whether it is all.
    """
    if not stands:
        return counted(events.row, events.row_sigma, swings, spacing), [], True
    edges = [0, *np.searchsorted(events.row, [each.row for each in stands]).tolist(), events.size]
    cycle, whole, last = round(60.0 / marking.interval), True, -1
    parts: list[Part] = []
    for at, (begin, end) in enumerate(itertools.pairwise(edges)):
        if end - begin < 2 * LEAST_MARKS:
            whole = False
            continue
        some = slice(begin, end)
        count = counted(events.row[some], events.row_sigma[some], swings.at(some), spacing)
        count = Count(count.event + begin, count.index, count.lead)
        minutes = find_minutes(events, count, marking)
        part = Part(count, [], minutes.residue if minutes.seen > 2 * minutes.against else None)
        number = None
        if parts and last == at - 1:
            number = _marks_between(parts[-1], part, stands[at - 1], events, swings, spacing, cycle, clock)
        last = at
        if number is None:
            whole = whole and not parts
            parts.append(part)
            continue
        before = parts[-1]
        shift = int(before.marks.index[-1] + number)
        joined = Count(
            np.concatenate([before.marks.event, count.event]),
            np.concatenate([before.marks.index, shift + count.index]),
            np.concatenate([before.marks.lead, [np.inf], count.lead]),
        )
        residue = None if part.residue is None else (part.residue + shift) % cycle
        residue = residue if before.residue is None else before.residue
        parts[-1] = Part(joined, [*before.stands, stands[at - 1]], residue)
    if not parts:
        raise RefusedError("film: the paper stood still again and again; cut the film and read the parts one by one")
    longest = max(parts, key=lambda each: each.marks.index[-1])
    return longest.marks, longest.stands, whole


def _marks_between(
    before: Part,
    after: Part,
    stand: Stand,
    events: Events,
    swings: Swings,
    spacing: float,
    cycle: int,
    clock: Clock,
) -> int | None:
    """Number of marks from the last before a stand to the first after it; None where it is not certain."""
    times = [clock.offset(events, each.marks, spacing) for each in (before, after)]
    if times[0] is not None and times[1] is not None:
        number, cost = np.array([times[1] - times[0] - before.marks.index[-1]]), np.zeros(1)
    elif np.isnan(stand.length):  # a person does not know either
        return None
    else:
        number, cost = lengths(before.marks, after.marks, events.row, swings, stand, spacing)
    if after.residue is not None and before.residue is not None:
        agrees = (number + before.marks.index[-1] + after.residue - before.residue) % cycle == 0
        agrees &= cost < cost[0] + LEAST_LEAD  # a false gap may look like a code
        number, cost = number[agrees], cost[agrees]
    if not number.size or (cost.size > 1 and cost[1] - cost[0] < LEAST_LEAD):
        return None
    return int(number[0])


def certain_part(count: Count, codes: Floats) -> Count:
    """The longest part of a count within which each number is certain, or confirmed by `codes` on both sides.

    Codes are given by the numbers of their minutes' marks.
    """
    confirmed = (codes.min(initial=np.inf) <= count.index[:-1]) & (codes.max(initial=-np.inf) >= count.index[1:])
    edges = [0, *(1 + np.flatnonzero((count.lead < LEAST_LEAD) & ~confirmed)), count.index.size]
    begin, end = max(itertools.pairwise(edges), key=lambda part: count.index[part[1] - 1] - count.index[part[0]])
    return Count(count.event[begin:end], count.index[begin:end] - count.index[begin], count.lead[begin : end - 1])


def check(minutes: Minutes, events: Events, count: Count, swings: Swings) -> None:
    """Refuse a count that codes or pendulums contradict.

    `RefusedError`: more codes are out of step than chance puts there, or all pendulums would have lost or gained part
    of a swing at once.
    """
    if minutes.residue is not None and minutes.against > max(1.0, DISAGREE * minutes.seen):
        raise RefusedError(
            f"film: {minutes.against} of {minutes.seen + minutes.against} minute codes are out of step with the count "
            "of marks; cut the film where marks are missing and read the parts one by one"
        )
    jump = np.nan_to_num(jumps(count.index.astype(np.float64), swings.at(count.event)))
    worst = int(np.argmax(jump))
    if jump[worst] > JUMP:
        raise RefusedError(
            f"film: near row {events.row[count.event[worst]]:.0f} all pendulums jump by {jump[worst]:.1f} rad against "
            "the count of marks; cut the film there and read the parts one by one"
        )
