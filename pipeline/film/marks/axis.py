"""The time axis of a film: gaps found, brought together, counted, checked, and the paper's motion made of them."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.film.marks import checks, counting
from pipeline.film.marks.alignment import Alignment, Events, aligned, gathered, lasting, middles, refined
from pipeline.film.marks.counting import Count
from pipeline.film.marks.drive import Drive, drive, holes_honest
from pipeline.film.marks.minutes import Minutes, code_marks, find_minutes, repaired
from pipeline.film.marks.search import Gaps, find_gaps, learned_width
from pipeline.film.marks.stands import Bars, Side, Stand, lengths, together
from pipeline.film.parts import Emulsion, Floats, Marking, TimeAxis, Tracks
from pipeline.film.scan.opening import OpenScan

ROUNDS = 2  # of drive and shear
SPEED_TOLERANCE = 0.25  # of the stated speed
FEW_FALSE = 0.005  # share of marks that may be false


@dataclass(frozen=True)
class Counted:
    """Events of a film and the count of marks among them, checked."""

    events: Events
    count: Count
    minutes: Minutes
    alignment: Alignment
    stands: list[Stand]
    whole: bool
    """Whether nothing was cut off where it is not certain how long the paper stood."""


def time_axis(scan: OpenScan, emulsion: Emulsion, tracks: Tracks, marking: Marking, jobs: int = 1) -> TimeAxis:
    """When each row of a film was exposed; `jobs` threads may work.

    Raises
    ------
    RefusedError
        Marks cannot be found, or their number is not certain.
    TimeReversedError
        The film lies upside down.
    """
    if marking.gap is not None and marking.speed is not None:
        width = marking.gap * marking.speed
    else:
        width = learned_width(scan, emulsion, tracks)
    gaps, found = find_gaps(scan, emulsion, tracks, width, jobs)
    return axis_of(gaps, tracks, marking, width, scan.rows, found)


def axis_of(
    gaps: Gaps, tracks: Tracks, marking: Marking, width: float, rows: int, shown: Bars | None = None
) -> TimeAxis:
    """The time axis that gaps make; `width` of a gap and `rows` of the film in px. Raises as `time_axis`."""
    counted = count_gaps(gaps, tracks, marking, width, shown)
    traces = len(tracks.course)
    size = int(counted.count.index[-1]) + 1
    row, sigma, column = (np.full((traces, size), np.nan) for _ in range(3))
    middle = middles(gaps, tracks)
    for trace in range(traces):
        member = counted.events.member[trace, counted.count.event]
        seen = member >= 0
        at = counted.count.index[seen]
        row[trace, at], sigma[trace, at] = gaps.row[member[seen]], gaps.row_sigma[member[seen]]
        column[trace, at] = middle[member[seen]]
    offset, shear = counted.alignment.offset, counted.alignment.shear
    at = np.searchsorted(counted.events.row[counted.count.event], [each.row for each in counted.stands])
    jumps = counted.count.index[at]
    found = drive(row - offset[:, None] - shear * column, sigma, marking.interval, jumps=jumps)
    for _ in range(ROUNDS):
        offset, shear, unsure = refined(row, sigma, column, found)
        found = drive(row - offset[:, None] - shear * column, sigma, marking.interval, found, jumps=jumps)
    freed = row - offset[:, None] - shear * column
    found = holes_honest(freed, sigma, found)
    alike = float(np.hypot(lasting(freed, found), unsure))
    return _axis(found, counted, row, offset, shear, alike, marking, rows)


def count_gaps(gaps: Gaps, tracks: Tracks, marking: Marking, width: float, shown: Bars | None = None) -> Counted:
    """Gaps brought together over the traces and counted; raises as `time_axis`."""
    traces = len(tracks.course)
    busiest = int(np.argmax(np.bincount(gaps.trace, minlength=traces)))
    spacing = counting.spacing_of(gaps.row[gaps.trace == busiest])
    if marking.speed is not None and abs(spacing / (marking.speed * marking.interval) - 1.0) > SPEED_TOLERANCE:
        raise RefusedError(
            f"film: gaps lie {spacing:.1f} rows apart, but {marking.speed:.4g} rows per second and marks every "
            f"{marking.interval:g} s make {marking.speed * marking.interval:.1f}; state the right speed or interval"
        )
    alignment = aligned(gaps, traces, spacing)
    events = gathered(gaps, alignment, traces, width)
    # an oblique image bends the swing, but its first harmonic keeps the phase of the swing's middle
    middle = [float(np.median(gaps.column[gaps.trace == k])) if (gaps.trace == k).any() else 0.0 for k in range(traces)]
    places = events.row + (alignment.offset + alignment.shear * np.array(middle))[:, None]
    stretch = checks.stretched(events.row, spacing)
    phase, doubt = checks.phases(tracks, places, stretch)
    centred = np.where(doubt < 1e-3, phase, np.nan)
    advance, spread = checks.advance(events.row, centred, spacing * stretch)
    stands = together(shown, alignment.offset, alignment.shear, np.array(middle)) if shown else []
    if stands:
        count, stands, whole = _past_stands(events, stands, (phase, doubt, advance, spread), spacing, marking)
    else:
        count, whole = counting.counted(events.row, events.row_sigma, phase, doubt, advance, spread, spacing), True
    minutes = find_minutes(events, count, marking.interval, marking.minute_code)
    mended = repaired(minutes, events, count, marking.interval)
    if mended is not count:
        count, minutes = mended, find_minutes(events, mended, marking.interval, marking.minute_code)
    checks.check_minutes(minutes)
    checks.check_leads(code_marks(minutes, events, count, marking.interval), events, count)
    checks.check_swings(count.index.astype(np.float64), events.row[count.event], centred[:, count.event], advance)
    return Counted(events, count, minutes, alignment, stands, whole)


def _past_stands(
    events: Events, stands: list[Stand], swings: tuple[Floats, Floats, Floats, Floats], spacing: float, marking: Marking
) -> tuple[Count, list[Stand], bool]:
    """Marks counted between the stands, and joined over those whose lengths codes or pendulums tell.

    Returns
    -------
    count : Count
        Of the longest part within which the count is certain.
    stands : list of Stand
        Within it.
    whole : bool
        Whether that is all of the film.
    """
    phase, doubt, advance, spread = swings
    edges = [0, *np.searchsorted(events.row, [each.row for each in stands]).tolist(), events.size]
    cycle, whole, last = round(60.0 / marking.interval), True, -1
    runs: list[tuple[Count, list[Stand], int | None]] = []
    for at, (begin, end) in enumerate(itertools.pairwise(edges)):
        if end - begin < 2 * counting.LEAST_MARKS:
            whole = False
            continue
        some = slice(begin, end)
        part = counting.counted(
            events.row[some], events.row_sigma[some], phase[:, some], doubt[:, some], advance, spread, spacing
        )
        part = Count(part.event + begin, part.index, part.lead)
        minutes = find_minutes(events, part, marking.interval, marking.minute_code)
        code = minutes.residue if minutes.seen > 2 * minutes.against else None
        number = np.zeros(0, dtype=np.int64)
        if runs and last == at - 1:
            before, within, minute = runs[-1]
            sides = [Side(events.row[each.event], each.index, phase[:, each.event]) for each in (before, part)]
            number, price = lengths(sides[0], sides[1], advance, spread, stands[at - 1], spacing)
            if code is not None and minute is not None:
                agrees = (number + before.index[-1] + code - minute) % cycle == 0
                agrees &= price < price[0] + counting.LEAST_LEAD  # a false gap may look like a code
                number, price = number[agrees], price[agrees]
            if price.size > 1 and price[1] - price[0] < counting.LEAST_LEAD:
                number = number[:0]
        last = at
        if not number.size:
            whole = whole and not runs
            runs.append((part, [], code))
            continue
        shift = int(before.index[-1] + number[0])
        joined = Count(
            np.concatenate([before.event, part.event]),
            np.concatenate([before.index, shift + part.index]),
            np.concatenate([before.lead, [np.inf], part.lead]),
        )
        found = minute if minute is not None else None if code is None else (code + shift) % cycle
        runs[-1] = joined, [*within, stands[at - 1]], found
    if not runs:
        raise RefusedError("film: the paper stood still again and again; cut the film and read the parts one by one")
    count, own, _ = max(runs, key=lambda each: each[0].index[-1])
    return count, own, whole


def _axis(
    found: Drive,
    counted: Counted,
    row: Floats,
    offset: Floats,
    shear: float,
    alike: float,
    marking: Marking,
    rows: int,
) -> TimeAxis:
    cycle = round(60.0 / marking.interval)
    shift = 0 if counted.minutes.residue is None else (-counted.minutes.residue) % cycle
    seconds, sigma = times_of(found, rows, alike)
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
        seconds_sigma=sigma,
        flags=_flags(counted, seen.size),
        rate_sigma=rate_sigma(found),
    )


def rate_sigma(found: Drive) -> float:
    """R.m.s. of the smoother's error of the paper's speed, relative."""
    return float(np.sqrt(np.mean((found.speed_sigma / np.maximum(found.speed, 1e-9)) ** 2)))


def _flags(counted: Counted, seen: int) -> tuple[str, ...]:
    minutes, count, events = counted.minutes, counted.count, counted.events
    false = events.size - count.index.size - (minutes.seen if minutes.kind == "second gap" else 0)
    shown = (events.member >= 0).any(axis=1)
    return tuple(
        name
        for name, holds in {
            "marks-without-minute-code": minutes.residue is None,
            "marks-direction-unknown": minutes.residue is None or minutes.kind != "second gap",
            "marks-codes-disagree": minutes.against > checks.DISAGREE * minutes.seen,
            "marks-offset-unsure": not counted.alignment.sure,
            "marks-false": false > max(2.0, FEW_FALSE * seen),
            "film-stood-still": bool(counted.stands),
            "film-cut": not counted.whole,
            "marks-one-trace": int(shown.sum()) == 1 and len(events.member) > 1,
        }.items()
        if holds
    )


def times_of(found: Drive, rows: int, lasting: float) -> tuple[Floats, Floats]:
    """Time since the first mark of the centre of each row, and 1 sigma, s; NaN beyond the marks.

    Between marks the motion is the polynomial of degree five that has row, speed and acceleration at both.

    The variance is the sum of three. At the marks, that of the drive's smoother, which knows the gaps' noise and how
    rough the paper ran, both as the film itself shows them; between two marks, what a motion as rough may do unseen
    while row and speed at both are held, `shake^2 (x (1 - x) h)^3 / 3 + roughness^2 (x (1 - x) h)^5 / 20` at the share
    x of the way h; and `lasting`, which no smoother tells from motion. It is that of a time read on any trace; the zero
    of time, common to all rows, is not in it.

    Parameters
    ----------
    found : Drive
    rows : int
        Of the film.
    lasting : float
        1 sigma, px, of errors that neighbouring marks share: of their gaps, the traces' offsets and the shear.
    """
    from scipy.interpolate import CubicSpline

    fine = 16
    x = np.arange(fine) / fine
    h = found.step
    r0, r1 = found.row[:-1, None], found.row[1:, None]
    v0, v1 = found.speed[:-1, None] * h, found.speed[1:, None] * h
    a0, a1 = found.acceleration[:-1, None] * h * h, found.acceleration[1:, None] * h * h
    c3 = 10 * (r1 - r0) - 6 * v0 - 4 * v1 - 1.5 * a0 + 0.5 * a1
    c4 = -15 * (r1 - r0) + 8 * v0 + 7 * v1 + 1.5 * a0 - a1
    c5 = 6 * (r1 - r0) - 3 * (v0 + v1) - 0.5 * (a0 - a1)
    curve = r0 + x * (v0 + x * (0.5 * a0 + x * (c3 + x * (c4 + x * c5))))
    seconds, sigma, centre = np.full(rows, np.nan), np.full(rows, np.nan), np.arange(rows) + 0.5
    seen = np.flatnonzero(found.used.any(axis=0))
    lasts = [*(int(seen[seen < jump][-1]) for jump in found.jumps), found.row.size - 1]
    for first, last in zip([0, *found.jumps.tolist()], lasts, strict=True):  # beside a stand the paper ran and stood
        at = np.append(curve[first:last].ravel(), found.row[last])
        inside = (centre >= at[0]) & (centre <= at[-1])
        forward = np.maximum.accumulate(at) + 1e-9 * np.arange(at.size)
        seconds[inside] = CubicSpline(forward, first * h + np.arange(at.size) * (h / fine))(centre[inside])
    inside = np.isfinite(seconds)
    marks = np.arange(found.row.size)
    place = seconds[inside] / h
    variance = np.interp(place, marks, found.row_sigma**2 + lasting**2)
    unseen = (place % 1.0) * (1.0 - place % 1.0) * h
    variance += np.exp(2.0 * found.shake) * unseen**3 / 3.0 + np.exp(2.0 * found.roughness) * unseen**5 / 20.0
    sigma[inside] = np.sqrt(variance) / np.interp(place, marks, np.maximum(found.speed, 1e-9))
    return seconds, sigma
