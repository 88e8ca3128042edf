"""The time axis of a film: gaps found, brought together, counted, checked, and the paper's motion made of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.film.marks import checks, counting, swings
from pipeline.film.marks.alignment import Alignment, aligned
from pipeline.film.marks.closing import learned_width
from pipeline.film.marks.counting import Count
from pipeline.film.marks.drive import Drive, drive
from pipeline.film.marks.echoes import lasting
from pipeline.film.marks.events import Events, gathered
from pipeline.film.marks.gaps import Gaps
from pipeline.film.marks.holes import holes_honest
from pipeline.film.marks.minutes import Minutes, code_marks, find_minutes, repaired
from pipeline.film.marks.oblique import middles, refined
from pipeline.film.marks.search import find_gaps
from pipeline.film.marks.seconds import times_of
from pipeline.film.parts import Emulsion, Floats, Marking, Scan, TimeAxis, Tracks

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
    spacing: float


def time_axis(scan: Scan, emulsion: Emulsion, tracks: Tracks, marking: Marking, jobs: int = 1) -> TimeAxis:
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
    gaps = find_gaps(scan, emulsion, tracks, width, jobs)
    return axis_of(gaps, tracks, marking, width, scan.rows)


def axis_of(gaps: Gaps, tracks: Tracks, marking: Marking, width: float, rows: int) -> TimeAxis:
    """The time axis that gaps make; `width` of a gap and `rows` of the film in px. Raises as `time_axis`."""
    counted = count_gaps(gaps, tracks, marking, width)
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
    found = drive(row - offset[:, None] - shear * column, sigma, marking.interval)
    for _ in range(ROUNDS):
        offset, shear, unsure = refined(row, sigma, column, found)
        found = drive(row - offset[:, None] - shear * column, sigma, marking.interval, found)
    freed = row - offset[:, None] - shear * column
    found = holes_honest(freed, sigma, found)
    alike = float(np.hypot(lasting(freed, found), unsure))
    return _axis(found, counted, row, offset, shear, alike, marking, rows)


def count_gaps(gaps: Gaps, tracks: Tracks, marking: Marking, width: float) -> Counted:
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
    stretch = swings.stretched(events.row, spacing)
    phase, doubt = swings.phases(tracks, places, stretch)
    centred = np.where(doubt < 1e-3, phase, np.nan)
    advance, spread = swings.advance(events.row, centred, spacing * stretch)
    count = counting.counted(events.row, events.row_sigma, phase, doubt, advance, spread, spacing)
    minutes = find_minutes(events, count, marking.interval, marking.minute_code)
    mended = repaired(minutes, events, count, marking.interval)
    if mended is not count:
        count, minutes = mended, find_minutes(events, mended, marking.interval, marking.minute_code)
    checks.check_minutes(minutes)
    checks.check_leads(code_marks(minutes, events, count, marking.interval), events, count)
    checks.check_swings(count.index.astype(np.float64), events.row[count.event], centred[:, count.event], advance)
    return Counted(events, count, minutes, alignment, spacing)


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
            "marks-one-trace": int(shown.sum()) == 1 and len(events.member) > 1,
        }.items()
        if holds
    )
