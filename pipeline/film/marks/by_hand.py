"""Marks that a person set, cleared or named, among those that were found."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from data_schemas.errors import RecordError
from pipeline.film.edits import BY_HAND, TOUCHES, MarkEdits
from pipeline.film.marks.alignment import Alignment, Events
from pipeline.film.marks.counting import Count
from pipeline.film.marks.search import Gaps
from pipeline.film.parts import Floats, Tracks

WHOLE = 0.05  # of the marks' interval, by which a clock time may be off


def freed(row: Floats, trace: np.ndarray, tracks: Tracks, alignment: Alignment) -> Floats:
    """Rows on traces as they are at column 0 of the first."""
    at = np.clip(row.astype(np.int64), 0, tracks.course.shape[1] - 1)
    column = np.nan_to_num(tracks.course[trace, at])
    return np.asarray(row - alignment.offset[trace] - alignment.shear * column)


def with_marks(
    gaps: Gaps,
    marks: MarkEdits,
    tracks: Tracks,
    alignment: Alignment,
    spacing: float,
    width: float,
    across: bool,
) -> Gaps:
    """Gaps without those at marks that were cleared, and with marks that were set where none was found.

    `across`: gaps are marks beside the traces, their rows those at column 0.
    """
    rows, reach = gaps.row if across else freed(gaps.row, gaps.trace, tracks, alignment), TOUCHES * spacing
    gone = freed(marks.cleared, marks.cleared_trace, tracks, alignment)
    kept = np.all(np.abs(rows[:, None] - gone) > reach, axis=1)
    gaps, rows = gaps.pick(kept), rows[kept]
    there = freed(marks.row, marks.trace, tracks, alignment)
    new = np.flatnonzero(np.all(np.abs(there[:, None] - rows) > reach, axis=1))
    if not new.size:
        return gaps
    row, trace, one = marks.row[new], marks.trace[new], np.ones(new.size)
    at = np.clip(row.astype(np.int64), 0, tracks.course.shape[1] - 1)
    column, slope = np.nan_to_num(tracks.course[trace, at]), np.nan_to_num(tracks.slope[trace, at])
    if across:
        row, trace, column, slope = there[new], 0 * trace, 0.0 * column, 0.0 * slope
    sigma = max(BY_HAND, 0.1 * width) * one
    # the width is the usual one: a minute's code is not told by a mark that was set
    wide = one * (float(np.median(gaps.width)) if gaps.size else width)
    side = sigma * np.abs(slope) + one
    return gaps.joined_by(Gaps(trace, row, sigma, column, side, slope, wide, 0.35 * wide, one, one, one, one))


@dataclass(frozen=True)
class Clock:
    """Clock times of marks, in units of the interval, and their rows at column 0 of the first trace, in order."""

    row: Floats
    time: Floats

    @staticmethod
    def of(marks: MarkEdits, tracks: Tracks, alignment: Alignment, interval: float) -> Clock:
        """Those that were said.

        Raises
        ------
        RecordError
            One is no whole number of intervals from the begin.
        """
        said = np.flatnonzero(np.isfinite(marks.seconds))
        row = freed(marks.row[said], marks.trace[said], tracks, alignment)
        time = marks.seconds[said] / interval
        for off in np.flatnonzero(np.abs(time - np.round(time)) > WHOLE)[:1]:
            raise RecordError(
                f"edits: the mark at row {marks.row[said[off]]:g} has a time that is no whole number of mark intervals "
                f"({interval:g} s) from a full minute; correct it, or give --mark-interval"
            )
        order = np.argsort(row, kind="stable")
        return Clock(row[order], np.round(time[order]))

    def offset(self, events: Events, count: Count, spacing: float) -> int | None:
        """What is added to the marks' numbers so that they count from the begin; None without a time among them.

        Raises
        ------
        RecordError
            Times contradict each other.
        """
        row = events.row[count.event]
        near = np.clip(np.searchsorted(row, self.row), 1, row.size - 1)
        near -= self.row - row[near - 1] < row[near] - self.row
        inside = np.flatnonzero(np.abs(row[near] - self.row) < TOUCHES * spacing)
        found = (self.time[inside] - count.index[near[inside]]).astype(np.int64)
        for one, other in itertools.pairwise(inside):
            counted, said = count.index[near[other]] - count.index[near[one]], self.time[other] - self.time[one]
            if counted != said:
                raise RecordError(
                    f"edits: {counted} marks lie between the marks at rows {self.row[one]:.0f} and "
                    f"{self.row[other]:.0f}, but {said:.0f} by their times; correct a time, or set a break between them"
                )
        return int(found[0]) if found.size else None
