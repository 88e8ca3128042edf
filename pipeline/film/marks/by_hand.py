"""Marks that a person set, cleared or named, among those that were found."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RecordError
from pipeline.film.edits import BY_HAND, TOUCHES, MarkEdits
from pipeline.film.marks.alignment import Alignment, Events
from pipeline.film.marks.counting import Count
from pipeline.film.marks.search import Gaps
from pipeline.film.parts import Floats, Tracks

WHOLE = 0.05  # of the marks' interval, by which a clock time may be off


def _on_trace(values: Floats, row: Floats, trace: NDArray[np.int64]) -> Floats:
    """What arrays (traces, rows) hold at places on traces; 0 where nothing is known."""
    return np.nan_to_num(values[trace, np.clip(row.astype(np.int64), 0, values.shape[1] - 1)])


def _freed(places: Floats, tracks: Tracks, alignment: Alignment) -> Floats:
    """Places, row and number of a trace, as rows at column 0 of the first."""
    row, trace = places[:, 0], places[:, 1].astype(np.int64)
    return row - alignment.offset[trace] - alignment.shear * _on_trace(tracks.course, row, trace)


def with_marks(
    gaps: Gaps, marks: MarkEdits, tracks: Tracks, alignment: Alignment, spacing: float, width: float, across: bool
) -> Gaps:
    """Gaps without those at marks that were cleared, and with marks that were set where none was found.

    `across`: gaps are marks beside the traces, their rows those at column 0.
    """
    rows = gaps.row if across else _freed(np.column_stack([gaps.row, gaps.trace]), tracks, alignment)
    reach = TOUCHES * spacing
    kept = np.all(np.abs(rows[:, None] - _freed(marks.cleared, tracks, alignment)) > reach, axis=1)
    gaps, rows = gaps.pick(kept), rows[kept]
    there = _freed(marks.there, tracks, alignment)
    new = np.all(np.abs(there[:, None] - rows) > reach, axis=1)
    if not new.any():
        return gaps
    row, trace = marks.there[new, 0], marks.there[new, 1].astype(np.int64)
    column, slope = (_on_trace(values, row, trace) for values in (tracks.course, tracks.slope))
    if across:
        row, trace, column, slope = there[new], 0 * trace, 0.0 * column, 0.0 * slope
    one = np.ones(row.size)
    sigma = max(BY_HAND, 0.1 * width) * one
    # the width is the usual one: a mark that was set does not show a minute's code
    wide = one * (float(np.median(gaps.width)) if gaps.size else width)
    side = sigma * np.abs(slope) + one
    return gaps.joined_by(Gaps(trace, row, sigma, column, side, slope, wide, 0.35 * wide, one, one, one, one))


class Clock(NamedTuple):
    """Clock times of marks, in units of the interval, and their rows at column 0 of the first trace, in order."""

    row: Floats
    time: Floats

    @staticmethod
    def of(marks: MarkEdits, tracks: Tracks, alignment: Alignment, interval: float) -> Clock:
        """Those that were said; `RecordError` where one is no whole number of intervals from the begin."""
        said = marks.there[np.isfinite(marks.there[:, 2])]
        time = said[:, 2] / interval
        for off in np.flatnonzero(np.abs(time - np.round(time)) > WHOLE)[:1]:
            raise RecordError(
                f"edits: the mark at row {said[off, 0]:g} has a time that is no whole number of mark intervals "
                f"({interval:g} s) from a full minute; correct it, or give --mark-interval"
            )
        row = _freed(said, tracks, alignment)
        order = np.argsort(row, kind="stable")
        return Clock(row[order], np.round(time[order]))

    def offset(self, events: Events, count: Count, spacing: float) -> int | None:
        """What is added to the marks' numbers so that they count from the begin; None without a time among them.

        `RecordError` where times contradict each other.
        """
        row = events.row[count.event]
        near = np.clip(np.searchsorted(row, self.row), 1, row.size - 1)
        near -= self.row - row[near - 1] < row[near] - self.row
        inside = np.flatnonzero(np.abs(row[near] - self.row) < TOUCHES * spacing)
        for one, other in itertools.pairwise(inside):
            counted, said = count.index[near[other]] - count.index[near[one]], self.time[other] - self.time[one]
            if counted != said:
                raise RecordError(
                    f"edits: {counted} marks lie between the marks at rows {self.row[one]:.0f} and "
                    f"{self.row[other]:.0f}, but {said:.0f} by their times; correct a time, or set a break between them"
                )
        return int(self.time[inside[0]] - count.index[near[inside[0]]]) if inside.size else None
