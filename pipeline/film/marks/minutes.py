"""The minute code: what repeats at every full minute, and whether the count of marks agrees with it.

At each full minute the chronometer closes the shutter otherwise than at other marks: again a little later, for a longer
or shorter time, or not at all. The code need not be known; whatever comes back every minute and nowhere else is one.
Read backwards, a second gap comes before the minute's mark instead of after it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RefusedError
from pipeline.film.marks.alignment import Events
from pipeline.film.marks.counting import Count
from pipeline.film.parts import Floats, Marking

TOLERANCE = 0.03  # of the marks' interval, of the second gap's place
SHARE = 0.4  # of the minutes at which a code must be seen to be believed
LEAST = 2
ABOUT = 6  # marks that show the paper's speed at the ends
LONELY = 3.0  # minutes under which a film may show one full minute only
LONGER = 0.3  # of the gap's width, by which a minute's gap differs
OWN = 6.0  # sigmas of a gap's width
FAR = 3  # marks missing around an event whose place is not told


class TimeReversedError(RefusedError):
    """The film lies upside down: its minute code reads backwards."""


@dataclass(frozen=True)
class Minutes:
    """Where full minutes were found."""

    residue: int | None = None  # of the full minutes' marks, modulo the marks of a minute; None: no code was found
    kind: str = "none"  # or "double", "long", "omitted"
    delay: float = np.nan  # of the second gap, s
    seen: int = 0  # codes that agree with the count
    against: int = 0  # most codes that lie out of it by the same number of marks


def places(events: Events, count: Count) -> Floats:
    """Place of every event in units of the marks' interval, by interpolation between the marks counted.

    Up to one interval beyond the first and last of them the paper is taken to run on as it does there.
    """
    row = events.row[count.event]
    out = np.interp(events.row, row, count.index.astype(np.float64))
    for first, few in ((0, min(ABOUT, row.size - 1)), (row.size - 1, max(row.size - 1 - ABOUT, 0))):
        step = (row[few] - row[first]) / max(abs(count.index[few] - count.index[first]), 1)
        away = (events.row - row[first]) / max(abs(step), 1e-9)
        beyond = away * np.sign(step) < 0.0
        out[beyond] = np.where(np.abs(away) < 1.0, count.index[first] + away, np.nan)[beyond]
    gap = np.concatenate([[0], np.diff(count.index), [0, 0]])
    out[gap[np.searchsorted(row, events.row)] > FAR] = np.nan  # too far from the next mark to tell
    return out


def find_minutes(events: Events, count: Count, marking: Marking) -> Minutes:
    """The minute code of a film whose marks were counted.

    `TimeReversedError`: the code reads backwards.
    """
    interval, delay, cycle = marking.interval, marking.minute_code or None, round(60.0 / marking.interval)
    if abs(cycle * interval - 60.0) > 1e-6 or cycle < 4 or marking.code == "none":
        return Minutes()
    spread = max((count.index[-1] - count.index[0]) / cycle, 1.0)
    place = places(events, count)
    place = place[np.isfinite(place) & ~np.isin(np.arange(events.size), count.event)]
    double = marking.code == "double" or (marking.code is None and marking.minute_code != 0.0)
    ahead = _second_gaps(place, cycle, interval, delay) if double else Minutes()
    behind = _second_gaps(place, cycle, interval, -delay) if double and delay is not None else Minutes()
    enough = max(LEAST, SHARE * spread * 0.5)
    if delay is not None and place.size == 1 and spread < LONELY:
        enough = 1  # where the code is known and no gap on the film is a false one, one code is no chance
    if max(ahead.seen, behind.seen) >= enough:
        late, early = ahead.seen, behind.seen
        if delay is None and ahead.delay > 0.5 * interval:  # a code follows its minute's mark
            late, early = 0, ahead.seen
        if early > late + 2 * ahead.against:
            backwards = f"({early} of its second marks come before the minute's mark, {late} after it)"
            if marking.directed:
                raise RefusedError(
                    f"film: with the --orientation given, the minute code reads backwards {backwards}; "
                    "leave it out, state the code's delay, or say --marks none"
                )
            raise TimeReversedError(
                f"film: the minute code reads backwards {backwards}: the film lies upside down; "
                "turn the scan by 180 degrees, or state the code's delay"
            )
        return ahead
    width, sigma = events.width[count.event], events.width_sigma[count.event]
    away = np.abs(width - np.median(width))
    odd = count.index[(away > LONGER * np.median(width)) & (away > OWN * sigma)]
    absent = np.setdiff1d(np.arange(count.index[0], count.index[-1]), count.index)
    for kind, index in (("long", odd), ("omitted", absent)):
        found = _repeated(index, cycle, spread, kind, marking.code == kind)
        if found is not None and marking.code in (None, kind):
            return found
    return Minutes() if ahead.seen < LEAST else ahead


def _second_gaps(place: Floats, cycle: int, interval: float, delay: float | None) -> Minutes:
    """Events that come by the same time after the marks of one number; a negative `delay` reads them backwards."""
    part = place - np.floor(place)
    fraction = np.nan if delay is None else (delay / interval) % 1.0
    if delay is None:  # the fraction and minute's mark at which most events come
        best = 0
        for centre in np.arange(0.06, 0.95, 0.02):
            near = np.abs(part - centre) < TOLERANCE
            number = np.floor(place[near]).astype(np.int64) % cycle
            top = int(np.bincount(number, minlength=1).max())
            if top > best:
                best, fraction = top, float(np.median(part[near]))
    near = np.abs(part - fraction) < TOLERANCE
    whole = np.floor(place[near]) if delay is None else np.round(place[near] - delay / interval)
    tally = np.bincount(whole.astype(np.int64) % cycle, minlength=cycle)
    residue = int(np.argmax(tally))
    against = int(np.delete(tally, residue).max())  # a slip puts all codes after it out by the same number
    late = float(fraction * interval) if delay is None else abs(delay)
    return Minutes(residue, "double", late, int(tally[residue]), against)


def _repeated(index: NDArray[np.int64], cycle: int, spread: float, kind: str, stated: bool) -> Minutes | None:
    """What comes at marks of one number much more often than at others; if it is `stated` to come, two are enough."""
    tally = np.bincount(index % cycle, minlength=cycle)
    residue, usual = int(np.argmax(tally)), float(np.median(tally))
    seen, chance = int(tally[residue]), np.sqrt(usual + 1.0)
    alone = stated and seen >= LEAST + np.delete(tally, residue).max()
    if seen < 2 * SHARE * spread or not (alone or seen >= max(LEAST + 1, usual + 6.0 * chance)):
        return None
    near = tally[[(residue + k) % cycle for k in (-2, -1, 1, 2)]].max()
    return Minutes(residue, kind, np.nan, seen, max(int(near - usual - 3.0 * chance), 0))


def code_marks(minutes: Minutes, events: Events, count: Count, interval: float) -> Floats:
    """Numbers of the full minutes' marks whose codes were seen and agree with the count."""
    if minutes.residue is None:
        return np.empty(0)
    number = _coded(minutes, events, count, interval) if minutes.kind == "double" else count.index.astype(np.float64)
    return np.asarray(number[np.mod(number, round(60.0 / interval)) == minutes.residue])


def _coded(minutes: Minutes, events: Events, count: Count, interval: float) -> Floats:
    """Numbers of the marks after which a second gap comes, as late as after those of full minutes."""
    place = (places(events, count) - minutes.delay / interval)[~np.isin(np.arange(events.size), count.event)]
    number = np.round(place)
    return np.asarray(number[np.abs(place - number) < TOLERANCE])


def doubts(minutes: Minutes, events: Events, count: Count, interval: float) -> list[tuple[float, float, float]]:
    """Where a code beyond all that agree is out of step: numbers of the first and last mark, and by how much, s.

    Between two codes that agree one that does not is a false gap.
    """
    if minutes.kind != "double" or minutes.residue is None:
        return []
    cycle, number = round(60.0 / interval), _coded(minutes, events, count, interval)
    away = np.mod(number - minutes.residue + cycle // 2, cycle) - cycle // 2
    agree = number[away == 0]
    if not agree.size:
        return []
    low, high = float(agree.min()), float(agree.max())
    sides = ((number < low, float(count.index[0]), low), (number > high, high, float(count.index[-1])))
    return [
        (first, last, interval * float(np.abs(away[beyond]).max())) for beyond, first, last in sides if beyond.any()
    ]
