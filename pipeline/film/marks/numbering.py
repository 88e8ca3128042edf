"""Events of a film brought together over its traces, counted over the places where the paper stood, and checked."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RefusedError
from pipeline.arrays import median_present
from pipeline.film.edits import Clock, MarkEdits, with_marks
from pipeline.film.marks.alignment import Alignment, Events, aligned, gathered
from pipeline.film.marks.counting import LEAST_MARKS, Count, Swings, counted, jumps, spacing_of, swings_at
from pipeline.film.marks.lines import widened
from pipeline.film.marks.minutes import JUMP, Minutes, doubts, find_minutes
from pipeline.film.marks.search import Gaps, GapSearch
from pipeline.film.marks.stands import Stand, lengths, together
from pipeline.film.parts import Marking, Tracks

SPEED_TOLERANCE = 0.25  # of the stated speed
LEAST_PART = 0.2  # of the film, of a part that is read where others are uncertain
LEAST_LEAD = 12.0  # of the best count before any other
UNCERTAIN = -1.0  # lead of a number that codes elsewhere do not confirm
DISAGREE = 0.12  # of the codes, that may be false gaps in the place of one


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


def usual_spacing(gaps: Gaps, traces: int) -> float:
    """Rows between marks, by the trace that shows most."""
    return spacing_of(gaps.row[gaps.trace == np.argmax(np.bincount(gaps.trace, minlength=traces))])


def shear_of_marks(gaps: Gaps, traces: int) -> float:
    """Rows by which the image lags per column, as the marks of several traces show it; 0 where none can."""
    return aligned(gaps, traces, usual_spacing(gaps, traces)).shear if gaps.size >= LEAST_MARKS else 0.0


def number_marks(search: GapSearch, tracks: Tracks, marking: Marking, marks: MarkEdits) -> Counted:
    """Gaps, or marks across the film, brought together over the traces and counted; as `axis.axis_of`."""
    gaps, across, traces = search.gaps, search.across, len(tracks.course)
    spacing = usual_spacing(gaps, traces)
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
    stands = sorted([*stands, *(Stand(row, np.nan, True) for row in marks.breaks.tolist())])
    every = count_over_stands(events, stands, swings, spacing, marking, clock)
    known = longest(every, every.lead < 0.0)
    minutes = find_minutes(events, known, marking)
    if across is not None and across.kind == "dark-lines":  # on either side of a broad one the number is not certain
        row, wide = events.row[known.event], widened(gaps)[:, None]
        known.lead[np.any((row[:-1] <= wide) & (wide <= row[1:]), axis=0)] = 0.0
    codes = minutes.agree
    confirmed = (codes.min(initial=np.inf) <= known.index[:-1]) & (codes.max(initial=-np.inf) >= known.index[1:])
    count = longest(known, (known.lead < LEAST_LEAD) & ~confirmed)
    if count.index.size < known.index.size:
        if count.index[-1] < LEAST_PART * known.index[-1]:
            raise RefusedError(
                "film: over several stretches without marks the number of marks is uncertain; cut the film there and "
                "read the parts one by one"
            )
        minutes = find_minutes(events, count, marking)
    check(minutes, events, count, swings)
    first, last = events.row[count.event[[0, -1]]]
    inside = [each for each in stands if first < each.row < last]
    doubted: list[tuple[float, float, float]] = []
    if minutes.against > DISAGREE * minutes.seen:
        shown = any(each is not None for each in search.bars)
        doubted = doubts(minutes, count, marking.interval, swings.advance, shown=shown)
    shift, whole, full = clock.offset(events, count, spacing), count.index.size == every.index.size, minutes.residue
    contradicted = shift is not None and full is not None and (shift + full) % minutes.cycle != 0
    return Counted(gaps, events, count, minutes, alignment, inside, whole, doubted, shift, contradicted)


def count_over_stands(
    events: Events, stands: list[Stand], swings: Swings, spacing: float, marking: Marking, clock: Clock
) -> Count:
    """All marks counted, those that passed while the paper stood as codes or pendulums show.

    The lead over a stand is infinite, or `UNCERTAIN`.
    """
    rows = np.array([each.row for each in stands])
    count = counted(events.row, events.row_sigma, swings, spacing, rows)
    edges = [0, *np.searchsorted(events.row[count.event], rows).tolist(), count.index.size]
    begin, residue = 0, None  # first mark of what is counted on, and its full minutes' marks
    for stand, low, middle, high in zip(stands, edges, edges[1:], edges[2:], strict=False):
        if not 0 < middle < count.index.size:
            continue
        residue = _residue(events, count.part(low, middle), marking) if residue is None else residue
        number = None
        if min(middle - low, high - middle) >= LEAST_MARKS:
            before, after = count.part(begin, middle), count.part(middle, high)
            own = _residue(events, after, marking)
            ahead = None if own is None or residue is None else residue - own + 1
            number = _marks_between(before, after, stand, ahead, events, swings, spacing, marking, clock)
        if number is None:
            count.lead[middle - 1], begin, residue = UNCERTAIN, middle, None
        else:
            count.index[middle:] += number - 1
            count.lead[middle - 1] = np.inf
    return count


def _residue(events: Events, part: Count, marking: Marking) -> int | None:
    """Of the full minutes' marks, where most codes of a part agree."""
    if part.index.size < LEAST_MARKS:
        return None
    minutes = find_minutes(events, part, marking)
    return minutes.residue if minutes.seen > 2 * minutes.against else None


def _marks_between(
    before: Count, after: Count, stand: Stand, ahead: int | None, events: Events, swings: Swings, spacing: float,
    marking: Marking, clock: Clock,
) -> int | None:  # fmt: skip
    """Number of marks from the last before a stand to the first after it; None where it is not certain.

    `ahead` is that by the minute codes on both sides, modulo a minute.
    """
    times = [clock.offset(events, each, spacing) for each in (before, after)]
    if times[0] is not None and times[1] is not None:
        number, cost = np.array([times[1] - times[0] + 1]), np.zeros(1)
    elif np.isnan(stand.length):  # a person does not know either
        return None
    else:
        number, cost = lengths(before, after, events.row, swings, stand, spacing)
    if ahead is not None:  # a false gap may look like a code
        agrees = ((number - ahead) % round(60.0 / marking.interval) == 0) & (cost < cost[0] + LEAST_LEAD)
        number, cost = number[agrees], cost[agrees]
    certain = number.size and cost[1:].min(initial=np.inf) - cost[0] >= LEAST_LEAD
    return int(number[0]) if certain else None


def longest(count: Count, cut: NDArray[np.bool_]) -> Count:
    """The longest part between steps that are `cut` (marks - 1,), its numbers from 0 on."""
    edges = [0, *(1 + np.flatnonzero(cut)), count.index.size]
    part = max((count.part(*each) for each in itertools.pairwise(edges)), key=lambda each: np.ptp(each.index))
    return replace(part, index=part.index - part.index[0])


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
    jump = jumps(count, swings)
    worst = int(np.argmax(jump))
    if jump[worst] > JUMP:
        raise RefusedError(
            f"film: near row {events.row[count.event[worst]]:.0f} all pendulums jump by {jump[worst]:.1f} rad against "
            "the count of marks; cut the film there and read the parts one by one"
        )
