"""A person's edits in the reader's terms: pixels that are hidden, lines that traces follow, marks, breaks.

Edits apply to the reading of the untouched film: the same edits give the same numbers whenever they were made.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RecordError
from data_schemas.film_edits import Break, Edit, FilmEdits, Follow, Ignore, Mark, Mask, NoMark
from pipeline.film.marks.alignment import Alignment, Events, Gaps
from pipeline.film.marks.counting import Count
from pipeline.film.parts import Floats, Strobe, TimeAxis, Tracks
from pipeline.film.scan.opening import OpenScan

BESIDE = 4.0  # swings followed again on either side of what was edited, in which the filter forgets
TOUCHES = 0.25  # of the marks' spacing, within which a mark is meant
BY_HAND = 1.0  # px, 1 sigma of a mark that was set by hand
WHOLE = 0.05  # of the marks' interval, by which a clock time may be off


class MarkEdits(NamedTuple):
    """Marks that a person set, cleared or named."""

    there: Floats  # (n, 3) row on a trace, px, its number, and the mark's time, s since the record's start, or NaN
    cleared: Floats  # (m, 2) row on a trace, px, and its number, where no mark is
    breaks: Floats  # px, rows where marks are not counted on


NO_MARKS = MarkEdits(np.empty((0, 3)), np.empty((0, 2)), np.empty(0))


@dataclass(frozen=True)
class Placed:
    """Edits of a film, its traces as the tracker numbers them."""

    edits: FilmEdits | None = None
    masks: Sequence[Floats] = ()  # corners (n, 2), row and column
    lines: Sequence[tuple[int, Floats]] = ()  # trace, points (n, 2)
    ignored: Sequence[tuple[int, float, float]] = ()  # trace, first and last row
    left_out: frozenset[int] = frozenset()  # traces that are ignored on the whole film
    marks: MarkEdits = NO_MARKS

    def hide(self, darkness: NDArray[np.float32], first: int) -> NDArray[np.float32]:
        """The same rows from `first` on, NaN where nothing is to be read."""
        for corners in self.masks:
            low = np.clip(np.floor(corners.min(axis=0) - [first, 0]).astype(int), 0, darkness.shape)
            high = np.clip(np.ceil(corners.max(axis=0) - [first, 0]).astype(int) + 1, 0, darkness.shape)
            rows, columns = np.mgrid[low[0] : high[0], low[1] : high[1]] + 0.5  # pixels' centres
            inside = contains(corners, rows + first, columns)
            darkness[low[0] : high[0], low[1] : high[1]][inside] = np.nan
        return darkness

    def hides(self, rows: Floats, columns: Floats) -> NDArray[np.bool_]:
        """Which of some places lie in a mask."""
        found = np.zeros(np.shape(rows), dtype=bool)
        for corners in self.masks:
            found |= contains(corners, rows, columns)
        return found

    def courses(self, traces: int, rows: int) -> Floats | None:
        """Columns (traces, rows) of the lines that traces follow, NaN elsewhere; None without lines."""
        from scipy.interpolate import PchipInterpolator

        if not self.lines:
            return None
        out = np.full((traces, rows), np.nan)
        for trace, points in self.lines:
            centres = np.arange(max(int(points[0, 0] + 0.5), 0), min(int(points[-1, 0] + 0.5), rows))
            out[trace, centres] = PchipInterpolator(*points.T)(centres + 0.5)
        return out

    def stretches(self, rows: int, period: float) -> list[tuple[int, int]]:
        """Rows, first and last, that are to be followed once more, apart from each other and in order."""
        again, margin = np.zeros(rows + 2, dtype=bool), BESIDE * period
        for each in [*self.masks, *(points for _, points in self.lines)]:
            again[max(int(each[:, 0].min() - margin), 0) + 1 : int(each[:, 0].max() + margin) + 2] = True
        again[-1] = False
        edges = np.flatnonzero(np.diff(again))
        return [(first, stop - 1) for first, stop in edges.reshape(-1, 2).tolist()]

    def shows(self, trace: NDArray[np.int64], row: Floats, column: Floats) -> NDArray[np.bool_]:
        """Which places on traces are neither hidden nor ignored."""
        out = ~self.hides(row, column)
        for ignored, first, last in self.ignored:
            out &= (trace != ignored) | (row < first) | (row > last)
        return out

    def without_ignored(self, tracks: Tracks) -> None:
        """Make a trace unknown on the rows on which it is ignored, in place; not one that is ignored as a whole."""
        for trace, first, last in (each for each in self.ignored if each[0] not in self.left_out):
            some = slice(max(int(first), 0), max(int(last) + 1, 0))
            for values in (tracks.position, tracks.sigma, tracks.course, tracks.slope, tracks.curvature):
                values[trace, some] = np.nan

    def readable(self, strobe: Strobe, axis: TimeAxis) -> Strobe:
        """Places at the marks but for those that are hidden."""
        rows = np.interp(strobe.index, axis.index, axis.row) + axis.offset[:, None]
        hidden = self.hides(rows + axis.shear * np.nan_to_num(strobe.position), strobe.position)
        position, sigma = (np.where(hidden, np.nan, values) for values in (strobe.position, strobe.sigma))
        return replace(strobe, position=position, sigma=sigma)


NO_EDITS = Placed()


def check_scan(edits: FilmEdits, scan: OpenScan) -> None:
    """Refuse edits that were made for another scan, `RecordError`."""
    if edits.sha256 != scan.sha256:
        raise RecordError(
            f"edits: made for another scan (sha256 {edits.sha256[0][:12]}..., this one is {scan.sha256[0][:12]}...); "
            "give the edits of this scan"
        )


def place(edits: FilmEdits, scan: OpenScan, tracks: Tracks, start: str) -> Placed:
    """Edits in the reader's terms, s from the date `start`; `RecordError`: outside the image, or no such trace."""
    rest = [float(np.nanmedian(course)) if np.isfinite(course).any() else np.inf for course in tracks.course]
    order = np.argsort(rest, kind="stable")
    placed: list[tuple[int, Edit]] = []  # with the trace that is meant
    for at, each in enumerate(edits.edits):
        points = each.points if isinstance(each, Mask | Follow) else []
        for row, column in [(each.row, 0.0)] if isinstance(each, Mark | NoMark | Break) else points:
            if not (0.0 <= row <= scan.rows and 0.0 <= column <= scan.columns):
                size = f"{scan.rows} rows and {scan.columns} columns"
                raise RecordError(f"edits[{at}]: row {row:g}, column {column:g} lies outside the image of {size}")
        number = getattr(each, "trace", 1)
        if number > order.size:
            raise RecordError(f"edits[{at}]: there is no trace {number}; the film shows {order.size}")
        placed.append((int(order[number - 1]), each))
    masks = [np.array(each.points, float) for _, each in placed if isinstance(each, Mask)]
    lines = [(trace, np.array(each.points, float)) for trace, each in placed if isinstance(each, Follow)]
    ignored = [
        (trace, each.first_row or 0.0, scan.rows if each.last_row is None else each.last_row)
        for trace, each in placed
        if isinstance(each, Ignore)
    ]
    left_out = frozenset(trace for trace, first, last in ignored if first <= 0.0 and last >= scan.rows)
    there = [(each.row, trace, each.seconds(start)) for trace, each in placed if isinstance(each, Mark)]  # None: NaN
    cleared = [(each.row, trace) for trace, each in placed if isinstance(each, NoMark)]
    breaks = np.array([each.row for _, each in placed if isinstance(each, Break)])
    marks = MarkEdits(np.array(there, float).reshape(-1, 3), np.array(cleared, float).reshape(-1, 2), breaks)
    return Placed(edits, masks, lines, ignored, left_out, marks)


def contains(corners: Floats, rows: Floats, columns: Floats) -> NDArray[np.bool_]:
    """Which places lie in a polygon (even-odd rule), or in the rectangle of two opposite corners."""
    if len(corners) == 2:
        (top, left), (bottom, right) = corners.min(axis=0), corners.max(axis=0)
        return np.asarray((rows >= top) & (rows <= bottom) & (columns >= left) & (columns <= right))
    found = np.zeros(np.shape(rows), dtype=bool)
    for (row, column), (next_row, next_column) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if row == next_row:
            continue
        crosses = (row > rows) != (next_row > rows)
        found ^= crosses & (columns < column + (rows - row) * (next_column - column) / (next_row - row))
    return found


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
    """Gaps without cleared marks, with those that were set but not found; `across`: they lie beside the traces."""
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
    def of(marks: MarkEdits, tracks: Tracks, alignment: Alignment, interval: float) -> "Clock":
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
        """What is added to the marks' numbers to count from the begin, or None; `RecordError`: times contradict."""
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
