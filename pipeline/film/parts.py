"""What the stages of reading a film hand to each other.

Pixel i reaches from i to i + 1, its centre is i + 0.5. Rows run along the film with time, columns across it.
"""

from dataclasses import dataclass
from itertools import permutations
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
BESIDE, LEAST, MOST_TRACES = 24.0, 0.3, 6  # swings beside a stand of the paper; share of them; traces
SIZE, ALIKE, OTHERS = 0.2, 2.0, 8.0  # 1 sigma of a logarithm; squares of deviations: of the same traces, and of others


class Emulsion(Protocol):
    """How light became pixels: background and inverse characteristic curve of one film."""

    def exposure(self, pixels: NDArray[Any], first: int) -> NDArray[np.float32]:
        """Relative exposure of rows from `first` on, 0 on blank film, 1 on the axis of a line at rest."""

    def noise(self, exposure: NDArray[np.float32]) -> NDArray[np.float32]:
        """1 sigma of the grain in units of exposure, at that exposure."""


@dataclass(frozen=True)
class Tracks:
    """Traces as read, row by row; arrays of (traces, rows)."""

    position: Floats  # px, column at each row's centre line, one reading a row, not smoothed; NaN where not accepted
    sigma: Floats  # px, 1 sigma of the reading along the row
    course: Floats  # px, the tracker's smooth curve, also across marks and crossings; NaN where the trace is lost
    slope: Floats  # px px-1, derivative of the course by rows
    curvature: Floats  # px px-2, its second derivative
    brightness: Floats  # exposure of the line over that expected of its slope: 1 in the open, 0 in a gap of the shutter
    qc: NDArray[np.uint16]  # the record's flags: gap, saturated, ambiguous, lost, overlap, single_direction
    rows_per_swing: float  # in one full period, of the whole film
    spot: float  # px, 1 sigma of the spot on the scan
    shear: float = 0.0  # rows by which the image lags per column, as the swings show it

    @staticmethod
    def empty(traces: int, rows: int, rows_per_swing: float, spot: float, shear: float = 0.0) -> "Tracks":
        """Nothing read yet."""
        a, b, c, d, e, f = np.full((6, traces, rows), np.nan)
        return Tracks(a, b, c, d, e, f, np.zeros((traces, rows), np.uint16), rows_per_swing, spot, shear)

    def named_over(self, row: float) -> None:
        """Give the traces behind a row, where the paper stood, the names under which they swung before as far aside and
        about the same places, where others of them do so: the tracker may have gone on along another."""
        beside = round(BESIDE * self.rows_per_swing)
        sides = (self.course[:, max(int(row) - beside, 0) : int(row)], self.course[:, int(row) : int(row) + beside])
        if min(each.shape[1] for each in sides) < beside or len(self.course) > MOST_TRACES:
            return
        if not all(np.isfinite(each).mean(axis=1).min() > LEAST for each in sides):
            return
        (place, size), (after, later) = ((np.nanmean(each, axis=1), np.nanstd(each, axis=1)) for each in sides)
        costs = {}
        for order in map(list, permutations(range(len(place)))):
            away = ((after[order] - place) / size) ** 2 + (np.log(later[order] / size) / SIZE) ** 2
            costs[tuple(order)] = float(away.sum())
        best = min(costs, key=costs.__getitem__)
        if costs[best] < ALIKE < OTHERS < costs[tuple(range(len(place)))]:
            for values in vars(self).values():
                if isinstance(values, np.ndarray):
                    values[:, int(row) :] = values[list(best), int(row) :]

    def forget(self, rows: slice) -> None:
        """Take back what was read of some rows."""
        for values in (self.position, self.sigma, self.course, self.slope, self.curvature, self.brightness):
            values[:, rows] = np.nan
        self.qc[:, rows] = 0


@dataclass(frozen=True)
class Marking:
    """How the chronometer marked the film; None: measured, or looked for."""

    interval: float = 0.5  # time between marks, s
    gap: float | None = None  # how long the shutter was closed, s
    minute_code: float | None = None  # delay of the second gap at each full minute, s
    speed: float | None = None  # nominal rows per second
    code: str | None = None  # of a full minute: "double", "long", "omitted" or "none"
    kind: str | None = None  # "gaps" of the traces, or beside them "dark-lines", "bright-lines" or ticks at the "edge"
    directed: bool = False  # whether it is stated how time runs


@dataclass(frozen=True)
class TimeAxis:
    """When each row was exposed."""

    index: NDArray[np.int64]  # (marks,), in units of the interval; a full minute's a multiple of a minute
    row: Floats  # (marks,) px, at column 0 of the first trace
    row_sigma: Floats  # (marks,) px, 1 sigma
    shear: float  # rows by which the image lags per column (tangent of the skew)
    offset: Floats  # (traces,) rows by which each lies later along the film than the first
    row_of_trace: Floats  # (traces, marks) px, of each mark's gap on each trace as measured; NaN where not found
    interval: float  # s, between marks
    seconds: Floats  # (rows,) s, of each row's centre at column 0 of the first trace; NaN outside the marks' reach
    seconds_sigma: Floats  # (rows,) s, 1 sigma
    flags: tuple[str, ...]  # what to distrust
    rate_sigma: float  # s/s, 1 sigma of how much too fast or slow the times run from one mark to the next
    doubts: tuple[tuple[float, float, float], ...] = ()  # s, from when to when marks may be miscounted, and by how much
    kind: str = "gaps"  # of the marks, as that of a `Marking`
    mark_sigma: float = 0.0  # s, 1 sigma of the time at a single mark: noise of shutter and reading

    @property
    def rows_per_second(self) -> float:
        """Median speed from mark to mark: where the paper stood does not count; NaN without two marks."""
        steps = np.diff(self.row) / np.diff(self.index)
        return float(np.median(steps)) / self.interval if steps.size else float("nan")

    @property
    def time_sigma(self) -> float:
        """R.m.s. of the stated uncertainty of the rows' times, s; NaN where no row has a time."""
        timed = np.isfinite(self.seconds)
        return float(np.sqrt(np.mean(self.seconds_sigma[timed] ** 2))) if timed.any() else float("nan")


@dataclass(frozen=True)
class Strobe:
    """Places of the traces at the marks, read in the gaps alone."""

    index: NDArray[np.int64]  # (marks,), their numbers
    position: Floats  # (traces, marks) px, column at the middle of the gap; NaN where not read
    sigma: Floats  # (traces, marks) px, 1 sigma
    qc: NDArray[np.uint16]  # (traces, marks), the record's flags


@dataclass(frozen=True)
class Samples:
    """Places of all traces at common instants."""

    time: Floats  # (samples,) s, by the chronometer
    column: Floats  # (traces, samples) px; NaN where no row was accepted
    sigma: Floats  # (traces, samples) px, 1 sigma of the reading; NaN where there is none
    qc: NDArray[np.uint16]  # (traces, samples), the record's flags
