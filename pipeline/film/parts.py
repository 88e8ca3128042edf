"""What the stages of reading a film hand to each other.

Pixels count from the image's edges: pixel i reaches from i to i + 1 and has its centre at i + 0.5. Rows run along the
film with time, columns across it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Emulsion(Protocol):
    """How light became pixels: background and inverse characteristic curve of one film."""

    def exposure(self, pixels: NDArray[Any], first: int) -> NDArray[np.float32]:
        """Relative exposure of rows from `first` on, 0 on blank film, 1 on the axis of a line at rest."""
        ...

    def noise(self, exposure: NDArray[np.float32]) -> NDArray[np.float32]:
        """1 sigma of the grain in units of exposure, at that exposure."""
        ...


@dataclass(frozen=True)
class Tracks:
    """Traces as read, row by row.

    Attributes
    ----------
    position : (traces, rows) array
        Column of each trace where it crosses the centre line of each row, px, one reading a row, not smoothed; NaN
        where not accepted.
    sigma : (traces, rows) array
        1 sigma of the reading along the row, px.
    course : (traces, rows) array
        The tracker's smooth curve, px, known also across marks and crossings; NaN where the trace is lost.
    slope, curvature : (traces, rows) array
        First and second derivative of the course by rows, px px-1 and px px-2.
    brightness : (traces, rows) array
        Exposure of the line over that expected of its slope: 1 in the open, 0 in a gap of the shutter.
    qc : (traces, rows) array of uint16
        The record's flags: gap, saturated, ambiguous, lost, overlap, single_direction.
    rows_per_swing : float
        Rows in one full period, of the whole film.
    spot : float
        1 sigma of the spot on the scan, px.
    """

    position: Floats
    sigma: Floats
    course: Floats
    slope: Floats
    curvature: Floats
    brightness: Floats
    qc: NDArray[np.uint16]
    rows_per_swing: float
    spot: float

    @staticmethod
    def empty(traces: int, rows: int, rows_per_swing: float, spot: float) -> Tracks:
        """Nothing read yet."""
        a, b, c, d, e, f = np.full((6, traces, rows), np.nan)
        return Tracks(a, b, c, d, e, f, np.zeros((traces, rows), np.uint16), rows_per_swing, spot)

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
    """When each row was exposed.

    Attributes
    ----------
    index : (marks,) array of int64
        Numbers of the marks found, in units of the interval; the first full minute found is a multiple of a minute.
    row : (marks,) array
        Their rows at `column` 0 of trace offset 0, px.
    row_sigma : (marks,) array
        1 sigma, px.
    shear : float
        Rows by which the image lags per column (tangent of the skew).
    offset : (traces,) array
        Rows by which each trace lies later along the film than the first.
    row_of_trace : (traces, marks) array
        Row of each mark's gap on each trace as measured, NaN where not found, px.
    interval : float
        Time between marks, s.
    seconds : (rows,) array
        Time of the centre of each row at column 0 of the first trace, s; NaN outside the marks' reach.
    seconds_sigma : (rows,) array
        1 sigma, s.
    flags : tuple of str
        What to distrust.
    rate_sigma : float
        1 sigma of how much faster or slower than true the times run from one mark to the next, s/s.
    doubts : tuple of (float, float, float)
        Times from which to which the marks may be miscounted, and what they would be wrong by, s.
    kind : str
        Of the marks, as that of a `Marking`.
    mark_sigma : float
        1 sigma of the time at a single mark, s: noise of the shutter and of its reading, another at each mark.
    """

    index: NDArray[np.int64]
    row: Floats
    row_sigma: Floats
    shear: float
    offset: Floats
    row_of_trace: Floats
    interval: float
    seconds: Floats
    seconds_sigma: Floats
    flags: tuple[str, ...]
    rate_sigma: float
    doubts: tuple[tuple[float, float, float], ...] = ()
    kind: str = "gaps"
    mark_sigma: float = 0.0

    @property
    def rows_per_second(self) -> float:
        """Mean speed of the film, from the marks; NaN without two."""
        if self.index.size < 2:
            return float("nan")
        return float((self.row[-1] - self.row[0]) / ((self.index[-1] - self.index[0]) * self.interval))

    @property
    def usual_rows_per_second(self) -> float:
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
    """Places of the traces at the marks, read in the gaps alone.

    Attributes
    ----------
    index : (marks,) array of int64
        Numbers of the marks.
    position : (traces, marks) array
        Column of each trace at the middle of the gap, px; NaN where not read.
    sigma : (traces, marks) array
        1 sigma, px.
    qc : (traces, marks) array of uint16
        The record's flags.
    """

    index: NDArray[np.int64]
    position: Floats
    sigma: Floats
    qc: NDArray[np.uint16]
