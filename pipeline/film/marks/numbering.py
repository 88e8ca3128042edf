"""Numbers of a film's marks: counted over the places where the paper stood, checked, and set by the minute code.

At each full minute the shutter closes otherwise: again a little later, for a longer or shorter time, or not at all. The
code need not be known: whatever comes back every minute and nowhere else is one; backwards, a second gap comes first.
"""

import itertools
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RefusedError
from pipeline.arrays import median_present
from pipeline.film.edits import Clock, MarkEdits, with_marks
from pipeline.film.marks.alignment import Alignment, Events, Gaps, Stand, aligned, gathered, together
from pipeline.film.marks.counting import LEAST_MARKS, Count, Swings, counted, jumps, lengths, swings_at, usual_spacing
from pipeline.film.marks.lines import widened
from pipeline.film.marks.search import GapSearch
from pipeline.film.parts import Floats, Marking, Tracks

SPEED_TOLERANCE = 0.25  # of the stated speed
LEAST_PART = 0.2  # of the film, of a part that is read where others are uncertain
LEAST_LEAD = 12.0  # of the best count before any other
UNCERTAIN = -1.0  # lead of a number that codes elsewhere do not confirm
DISAGREE = 0.12  # of the codes, that may be false gaps in the place of one
TOLERANCE = 0.03  # of the marks' interval, of the second gap's place
SHARE = 0.4  # of the minutes at which a code must be seen to be believed
LEAST = 2
ABOUT = 6  # marks that show the paper's speed at the ends
LONELY = 3.0  # minutes under which a film may show one full minute only
LONGER = 0.3  # of the gap's width, by which a minute's gap differs
OWN = 6.0  # sigmas of a gap's width
STAND, HIDDEN_STAND = 1.5, 12.0  # s, at most without a bar: where traces can show one, and where none can
JUMP = 1.0  # rad, that shows in the phases of pendulums: a third of what one mark too many makes
FAR = 3  # marks missing around an event whose place is not known


class TimeReversedError(RefusedError):
    """The film lies upside down: its minute code reads backwards."""


class Minutes(NamedTuple):
    """Codes of full minutes."""

    kind: str = "none"  # or "double", "long", "omitted"
    number: Floats = np.empty(0)  # of the marks that look coded, also of those that contradict the others
    cycle: int = 120  # marks a minute
    residue: int | None = None  # of the full minutes' marks, modulo `cycle`; None: no code is believed

    @property
    def agree(self) -> Floats:
        """Numbers of the full minutes' marks, of those that are coded."""
        return np.asarray(self.number[np.mod(self.number, self.cycle) == self.residue])

    @property
    def seen(self) -> int:
        """How many codes agree with the count."""
        return 0 if self.residue is None else self.agree.size

    @property
    def against(self) -> int:
        """Most codes that are out of step by the same number of marks, as all behind a slip are."""
        tally = np.bincount(np.mod(self.number, self.cycle).astype(np.int64), minlength=self.cycle)
        if self.kind in ("none", "double"):
            return int(np.delete(tally, self.residue or 0).max())
        usual = float(np.median(tally))  # marks are long or missing for other reasons, too
        near = max(tally[((self.residue or 0) + k) % self.cycle] for k in (-2, -1, 1, 2))
        return max(int(near - usual - 3.0 * np.sqrt(usual + 1.0)), 0)


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
    doubts: list[tuple[float, float, float]]  # as of `doubts`
    clock: int | None  # what clock times add to the marks' numbers
    contradicted: bool  # the minutes that codes show are not those of the clock times


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
    late = alignment.offset + alignment.shear * np.array([median_present(each) for each in tracks.course])
    swings = swings_at(tracks, events, events.row + late[:, None], spacing)
    bars = together(search.bars, late)
    if bars and across is not None:
        bars = unlike_minutes(bars, events, swings, spacing, marking)
    stands = sorted([*bars, *(Stand(row, np.nan, True) for row in marks.breaks.tolist())])
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


def unlike_minutes(bars: list[Stand], events: Events, swings: Swings, spacing: float, marking: Marking) -> list[Stand]:
    """Bars but for long marks across the film that come back every minute, had the paper never stood."""
    count = counted(events.row, events.row_sigma, swings, spacing, np.array([each.row for each in bars]))
    minutes = find_minutes(events, count, marking)
    if minutes.kind != "long":
        return bars
    coded = events.row[count.event[np.isin(count.index, minutes.agree)]]
    return [each for each in bars if np.abs(coded - each.row).min() > 0.5 * spacing]


def count_over_stands(
    events: Events, stands: list[Stand], swings: Swings, spacing: float, marking: Marking, clock: Clock
) -> Count:
    """All marks counted, over stands by clock times, codes or pendulums; leads there are infinite or `UNCERTAIN`."""
    rows = np.array([each.row for each in stands])
    count = counted(events.row, events.row_sigma, swings, spacing, rows)
    edges = [0, *np.searchsorted(events.row[count.event], rows).tolist(), count.index.size]
    begin, residue = 0, None  # first mark of what is counted on, and its full minutes' marks
    for stand, low, middle, high in zip(stands, edges, edges[1:], edges[2:], strict=False):
        if not 0 < middle < count.index.size:
            continue
        residue = _residue(events, count.part(low, middle), marking) if residue is None else residue
        # how many marks it may be from the last before the stand to the first after it, the best first
        number, cost = np.empty(0, dtype=np.int64), np.empty(0)
        if min(middle - low, high - middle) >= LEAST_MARKS:
            before, after = count.part(begin, middle), count.part(middle, high)
            first, second = (clock.offset(events, each, spacing) for each in (before, after))
            if first is not None and second is not None:
                number, cost = np.array([second - first + 1]), np.zeros(1)
            elif not np.isnan(stand.length):  # what a person set has none
                number, cost = lengths(before, after, events.row, swings, stand, spacing)
            own = _residue(events, after, marking)
            if number.size and own is not None and residue is not None:  # a false gap may look like a code
                agrees = (number - (residue - own + 1)) % round(60.0 / marking.interval) == 0
                agrees &= cost < cost[0] + LEAST_LEAD
                number, cost = number[agrees], cost[agrees]
        if number.size and cost[1:].min(initial=np.inf) - cost[0] >= LEAST_LEAD:
            count.index[middle:] += number[0] - 1
            count.lead[middle - 1] = np.inf
        else:
            count.lead[middle - 1], begin, residue = UNCERTAIN, middle, None
    return count


def _residue(events: Events, part: Count, marking: Marking) -> int | None:
    """Of the full minutes' marks, where most codes of a part agree."""
    if part.index.size < LEAST_MARKS:
        return None
    minutes = find_minutes(events, part, marking)
    return minutes.residue if minutes.seen > 2 * minutes.against else None


def longest(count: Count, cut: NDArray[np.bool_]) -> Count:
    """The longest part between steps that are `cut` (marks - 1,), its numbers from 0 on."""
    edges = [0, *(1 + np.flatnonzero(cut)), count.index.size]
    part = max((count.part(*each) for each in itertools.pairwise(edges)), key=lambda each: np.ptp(each.index))
    return replace(part, index=part.index - part.index[0])


def check(minutes: Minutes, events: Events, count: Count, swings: Swings) -> None:
    """Refuse a count, `RefusedError`, that more codes contradict than chance explains, or all pendulums at once."""
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


def places(events: Events, count: Count) -> Floats:
    """Place of every event in units of the marks' interval; up to one beyond the marks the paper runs on evenly."""
    row = events.row[count.event]
    out = np.interp(events.row, row, count.index.astype(np.float64))
    for first, few in ((0, min(ABOUT, row.size - 1)), (row.size - 1, max(row.size - 1 - ABOUT, 0))):
        step = (row[few] - row[first]) / max(abs(count.index[few] - count.index[first]), 1)
        away = (events.row - row[first]) / max(abs(step), 1e-9)
        beyond = away * np.sign(step) < 0.0
        out[beyond] = np.where(np.abs(away) < 1.0, count.index[first] + away, np.nan)[beyond]
    gap = np.concatenate([[0], np.diff(count.index), [0, 0]])
    out[gap[np.searchsorted(row, events.row)] > FAR] = np.nan
    return out


def find_minutes(events: Events, count: Count, marking: Marking) -> Minutes:
    """The minute code of a film whose marks were counted; `TimeReversedError`: it reads backwards."""
    cycle = round(60.0 / marking.interval)
    if abs(cycle * marking.interval - 60.0) > 1e-6 or cycle < 4 or marking.code == "none":
        return Minutes()
    spread = max((count.index[-1] - count.index[0]) / cycle, 1.0)
    late = early = Minutes()
    if marking.code == "double" or (marking.code is None and marking.minute_code != 0.0):
        place = places(events, count)
        place = place[np.isfinite(place) & ~np.isin(np.arange(events.row.size), count.event)]
        if marking.minute_code:
            after = marking.minute_code / marking.interval
            late, early = _coded(place, after, cycle), _coded(place, -after, cycle)
        else:
            after = _commonest_fraction(place, cycle)
            found = _coded(place, after if after < 0.5 else after - 1.0, cycle)
            late, early = (found, early) if after < 0.5 else (late, found)
        enough = max(LEAST, SHARE * spread * 0.5)
        if marking.minute_code and place.size == 1 and spread < LONELY:
            enough = 1  # where the code is known and no gap on the film is a false one, one code is no chance
        against = (late if marking.minute_code else early).against
        if early.seen >= enough and early.seen > late.seen + 2 * against:
            told = f"({early.seen} of its second marks come before the minute's mark, {late.seen} after it)"
            if marking.directed:
                raise RefusedError(
                    f"film: with the --orientation given, the minute code reads backwards {told}; "
                    "leave it out, state the code's delay, or say --marks none"
                )
            raise TimeReversedError(
                f"film: the minute code reads backwards {told}: the film lies upside down; "
                "turn the scan by 180 degrees, or state the code's delay"
            )
        if late.seen >= enough:
            return late
    width, sigma = events.width[count.event], events.width_sigma[count.event]
    away = np.abs(width - np.median(width))
    odd = count.index[(away > LONGER * np.median(width)) & (away > OWN * sigma)]
    absent = np.setdiff1d(np.arange(count.index[0], count.index[-1]), count.index)
    for kind, index in (("long", odd), ("omitted", absent)):
        if marking.code in (None, kind) and _repeats(index, cycle, spread, marking.code == kind):
            return Minutes(kind, index.astype(np.float64), cycle, int(np.argmax(np.bincount(index % cycle))))
    return late if late.seen >= LEAST else Minutes()


def _coded(place: Floats, after: float, cycle: int) -> Minutes:
    """Events that come as long `after` the marks of one number, in units of the interval."""
    number = np.round(place - after)
    number = number[np.abs(place - after - number) < TOLERANCE]
    tally = np.bincount(np.mod(number, cycle).astype(np.int64), minlength=cycle)
    return Minutes("double", number, cycle, int(np.argmax(tally)))


def _repeats(index: NDArray[np.int64], cycle: int, spread: float, stated: bool) -> bool:
    """Whether marks of one number come much more often than others; if these are `stated` to come, two are enough."""
    tally = np.sort(np.bincount(index % cycle, minlength=cycle))
    seen, usual = int(tally[-1]), float(np.median(tally))
    alone = stated and seen >= LEAST + tally[-2]
    return seen >= 2 * SHARE * spread and bool(alone or seen >= max(LEAST + 1, usual + 6.0 * np.sqrt(usual + 1.0)))


def _commonest_fraction(place: Floats, cycle: int) -> float:
    """The fraction of the marks' interval at which most events come after marks of one number."""
    part, best, fraction = place - np.floor(place), 0, np.nan
    for centre in np.arange(0.06, 0.95, 0.02):
        near = np.abs(part - centre) < TOLERANCE
        top = int(np.bincount(np.floor(place[near]).astype(np.int64) % cycle, minlength=1).max())
        if top > best:
            best, fraction = top, float(np.median(part[near]))
    return fraction


def doubts(
    minutes: Minutes, count: Count, interval: float, advance: Floats, *, shown: bool
) -> list[tuple[float, float, float]]:
    """Where a code beyond all that agree is out of step: numbers of the first and last mark, and by how much, s.

    One between two that agree is a false gap; so is one that only a stand without a bar would explain (where bars are
    `shown`), or a jump of the pendulums, whose phases `advance` by (traces,) rad a mark, NaN where not known.
    """
    agree, number, half = minutes.agree, minutes.number, minutes.cycle // 2
    if minutes.kind != "double" or minutes.residue is None or not agree.size:
        return []
    away = np.abs(np.mod(number - minutes.residue + half, minutes.cycle) - half)
    jump = np.nan_to_num(np.angle(np.exp(1j * np.outer(advance, away))))
    hidden = (away * interval <= (STAND if shown else HIDDEN_STAND)) & np.all(np.abs(jump) < JUMP, axis=0)
    number, away = number[hidden], away[hidden]
    low, high = float(agree.min()), float(agree.max())
    sides = ((number < low, float(count.index[0]), low), (number > high, high, float(count.index[-1])))
    return [(first, last, interval * float(away[beyond].max())) for beyond, first, last in sides if beyond.any()]
