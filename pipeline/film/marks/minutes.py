"""The minute code: what repeats at every full minute, and whether the count of marks agrees with it.

At each full minute the chronometer closes the shutter otherwise than at other marks: again a little later, for a longer
or shorter time, or not at all. The code need not be known; whatever comes back every minute and nowhere else is one.
Read backwards, a second gap comes before the minute's mark instead of after it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RefusedError
from pipeline.film.marks.alignment import Events
from pipeline.film.marks.counting import Count, shifted
from pipeline.film.parts import Floats

TOLERANCE = 0.03  # of the marks' interval, of the second gap's place
SHARE = 0.4  # of the minutes at which a code must be seen to be believed
LEAST = 2
ABOUT = 6  # marks by which the paper's speed is told at the ends
LONELY = 3.0  # minutes under which a film may show one full minute only
NEARBY = 5  # marks by which a slipped count is mended
HOLE = 6  # marks missing in a row, over which a count is mended
LONGER = 0.3  # of the gap's width, by which a minute's gap differs
OWN = 6.0  # sigmas of a gap's width


class TimeReversedError(RefusedError):
    """The film lies upside down: its minute code reads backwards."""


@dataclass(frozen=True)
class Minutes:
    """Where full minutes were found.

    Attributes
    ----------
    residue : int or None
        Number, modulo the marks of a minute, of the full minutes' marks; None: no code was found.
    kind : str
        "second gap", "gap length", "missing mark" or "none".
    delay : float
        Of the second gap, s; NaN for other codes.
    seen, against : int
        Codes that agree with the count, and most codes that lie out of it by the same number of marks.
    """

    residue: int | None
    kind: str
    delay: float
    seen: int
    against: int


def places(events: Events, count: Count) -> Floats:
    """Place of every event in units of the marks' interval, by interpolation between the marks counted.

    Up to one interval beyond the first and last of them the paper is taken to run on as it does there.
    """
    row = events.row[count.event]
    out = np.interp(events.row, row, count.index.astype(np.float64))
    near = np.searchsorted(row, events.row)
    gap = np.diff(count.index, prepend=count.index[0], append=count.index[-1])
    for first, few in ((0, min(ABOUT, row.size - 1)), (row.size - 1, max(row.size - 1 - ABOUT, 0))):
        step = (row[few] - row[first]) / max(abs(count.index[few] - count.index[first]), 1)
        beyond = (events.row - row[first]) * np.sign(step) < 0.0
        away = np.where(beyond, (events.row - row[first]) / max(abs(step), 1e-9), 0.0)
        out[beyond] = np.where(np.abs(away) < 1.0, count.index[first] + away, np.nan)[beyond]
    out[(near < gap.size) & (gap[np.minimum(near, gap.size - 1)] > 3)] = np.nan  # too far from the next mark to tell
    return out


def find_minutes(events: Events, count: Count, interval: float, delay: float | None) -> Minutes:
    """The minute code of a film whose marks were counted; `delay` (s) of the second gap if known.

    Raises
    ------
    TimeReversedError
        The code reads backwards.
    """
    cycle = round(60.0 / interval)
    if abs(cycle * interval - 60.0) > 1e-6 or cycle < 4:
        return Minutes(None, "none", float("nan"), 0, 0)
    place = places(events, count)
    other = np.ones(events.size, dtype=bool)
    other[count.event] = False
    place = place[other & np.isfinite(place)]
    spread = max((count.index[-1] - count.index[0]) / cycle, 1.0)
    sides = _second_gaps(place, cycle, interval, delay)
    ahead, behind = sides
    enough = max(LEAST, SHARE * spread * 0.5)
    if delay is not None and place.size == 1 and spread < LONELY:
        enough = 1  # where the code is known and no gap on the film is a false one, one code is no chance
    if max(ahead.seen, behind.seen) >= enough:
        late, early = (ahead.seen, behind.seen) if delay is not None else (ahead.seen, 0)
        if delay is None and ahead.delay > 0.5 * interval:  # a code follows its minute's mark
            late, early = 0, ahead.seen
        if early > late + 2 * ahead.against:
            raise TimeReversedError(
                f"film: the minute code reads backwards ({early} of its second gaps come before the minute's mark, "
                f"{late} after it): the film lies upside down; turn the scan by 180 degrees, or state the code's delay"
            )
        return ahead
    longer = _odd_lengths(events, count, cycle, spread)
    if longer is not None:
        return longer
    missing = _missing(count, cycle, spread)
    return (
        missing if missing is not None else replace(ahead, residue=None, kind="none") if ahead.seen < LEAST else ahead
    )


def _second_gaps(place: Floats, cycle: int, interval: float, delay: float | None) -> tuple[Minutes, Minutes]:
    """The same residue's second gaps, read forwards and backwards."""
    part = place - np.floor(place)
    if delay is None:
        # the fraction and minute's mark at which most events come
        best, shift = 0, 0.0
        for centre in np.arange(0.06, 0.95, 0.02):
            near = np.abs(part - centre) < TOLERANCE
            number = np.floor(place[near]).astype(np.int64) % cycle
            top = int(np.bincount(number, minlength=1).max()) if number.size else 0
            if top > best:
                best, shift = top, float(np.median(part[near]))
        fractions = (shift, np.nan)
    else:
        fractions = ((delay / interval) % 1.0, (-delay / interval) % 1.0)
    found = []
    for sign, fraction in zip((1.0, -1.0), fractions, strict=True):
        near = np.abs(part - fraction) < TOLERANCE
        whole = np.floor(place[near]) if delay is None else np.round(place[near] - sign * delay / interval)
        number = whole.astype(np.int64) % cycle
        tally = np.bincount(number, minlength=cycle)
        residue = int(np.argmax(tally))
        seen = int(tally[residue])
        against = int(np.delete(tally, residue).max())  # a slip puts all codes after it out by the same number
        late = delay if delay is not None else fraction * interval
        found.append(Minutes(residue, "second gap", float(late), seen, against))
    return found[0], found[1]


def _odd_lengths(events: Events, count: Count, cycle: int, spread: float) -> Minutes | None:
    width, sigma = events.width[count.event], events.width_sigma[count.event]
    away = width - np.median(width)
    odd = (np.abs(away) > LONGER * np.median(width)) & (np.abs(away) > OWN * sigma)
    return _repeated(count.index[odd], cycle, spread, "gap length")


def _missing(count: Count, cycle: int, spread: float) -> Minutes | None:
    absent = np.setdiff1d(np.arange(count.index[0], count.index[-1]), count.index)
    return _repeated(absent, cycle, spread, "missing mark")


def _repeated(index: NDArray[np.int64], cycle: int, spread: float, kind: str) -> Minutes | None:
    tally = np.bincount(index % cycle, minlength=cycle)
    residue = int(np.argmax(tally))
    seen = int(tally[residue])
    usual = float(np.median(tally))
    if seen < max(LEAST + 1, 2 * SHARE * spread) or seen < usual + 6.0 * np.sqrt(usual + 1.0):
        return None
    near = [(residue + k) % cycle for k in (-2, -1, 1, 2)]
    return Minutes(
        residue, kind, float("nan"), seen, int(max(tally[near].max() - usual - 3.0 * np.sqrt(usual + 1.0), 0))
    )


def code_marks(minutes: Minutes, events: Events, count: Count, interval: float) -> Floats:
    """Numbers of the full minutes' marks whose codes were seen and agree with the count."""
    if minutes.residue is None:
        return np.empty(0)
    cycle = round(60.0 / interval)
    if minutes.kind != "second gap":
        return np.asarray(count.index[count.index % cycle == minutes.residue], dtype=np.float64)
    place = places(events, count) - minutes.delay / interval
    whole = np.round(place)
    good = (np.abs(place - whole) < TOLERANCE) & (np.mod(whole, cycle) == minutes.residue)
    return np.asarray(whole[good])


def repaired(minutes: Minutes, events: Events, count: Count, interval: float) -> Count:
    """A count mended by its codes, where all of them after a single hole are out of step by the same number.

    Other counts come back as they are.
    """
    if minutes.residue is None or minutes.kind != "second gap" or minutes.against < LEAST:
        return count
    cycle = round(60.0 / interval)
    place = places(events, count) - minutes.delay / interval
    whole = np.round(place)
    near = np.abs(place - whole) < TOLERANCE
    number = whole[near]
    away = np.mod(number - minutes.residue + cycle // 2, cycle) - cycle // 2
    number, away = number[np.abs(away) <= NEARBY], away[np.abs(away) <= NEARBY]
    change = np.flatnonzero(np.diff(away))
    if change.size != 1 or min(change[0] + 1, away.size - change[0] - 1) < LEAST:
        return count
    by = int(away[change[0]] - away[change[0] + 1])
    low, high = number[change[0]], number[change[0] + 1]
    between = np.flatnonzero((count.index[:-1] >= low) & (count.index[1:] <= high))
    if between.size == 0:
        return count
    steps = np.diff(count.index)[between]
    order = np.argsort(steps)[::-1]
    if steps[order[0]] < HOLE or (steps.size > 1 and steps[order[0]] < 2 * steps[order[1]]):
        return count
    return shifted(count, int(between[order[0]]), by)
