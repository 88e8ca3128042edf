"""Where the first pendulum is known, and where the difference was read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from data_schemas.scratch import portions, release, room
from pipeline.arrays import Floats
from pipeline.inversion.prepare import make_grid
from pipeline.prepared import Prepared
from pipeline.projection.kernels import block_length
from pipeline.projection.sampling import at_marks
from pipeline.projection.taps import NODES
from pipeline.projection.uneven import from_grid, taken
from pipeline.projection.uniform import UniformProblem

Response = Callable[[int], Floats]
"""The response at a portion of the rows, by its number."""


@dataclass(frozen=True)
class Places:
    """The uniform grid of the first pendulum, and the rows of a least squares: its points, or readings at uneven times.

    Attributes
    ----------
    theta, step : (m,) array, float
        The first pendulum, rad, and the grid's step, s.
    parts : list of slice
        Portions of the rows, for which they are made at a time.
    thinness : float
        Noise on the grid over that of a reading, at the same power a second.
    between_readings : bool
        Whether the first pendulum was read too seldom to be known between its readings but from minutes of them.
    """

    theta: Floats
    step: float
    parts: list[slice]
    thinness: float
    between_readings: bool
    _factor: int
    _uneven: tuple[Floats, np.ndarray, Floats] | None  # times of the rows; first node and weights of each

    @staticmethod
    def of(prepared: Prepared) -> Places:
        """Of a prepared record."""
        seen, grid = prepared.observation, make_grid(prepared)
        thinness = float(np.sqrt(grid.theta.size / seen.time.size))
        if seen.step is None:
            around = from_grid(seen.time, grid.step, grid.theta.size, prepared.nominal)
            parts = _apart(seen.time, grid.step)
            return Places(grid.theta, grid.step, parts, thinness, False, 0, (seen.time, *around))
        parts = list(portions(grid.theta.size, unit=block_length(grid.theta.size)))
        return Places(grid.theta, grid.step, parts, thinness, at_marks(prepared), round(seen.step / grid.step), None)

    def time(self, part: slice) -> Floats:
        """Of some rows, s."""
        return np.arange(part.start, part.stop) * self.step if self._uneven is None else self._uneven[0][part]

    def at_rows(self, series: Callable[[slice], Floats], part: slice) -> Floats:
        """A series, given by slices of the grid, at some rows; NaN where one of the eight points around is."""
        if self._uneven is None:
            return series(part)
        _, where, weights = self._uneven
        first, last = int(where[part.start]), int(where[part.stop - 1])
        rows = taken(series(slice(first, last + NODES)), where[part] - first, weights[part])
        release(*self._uneven)
        return rows

    def response(self, problem: UniformProblem) -> Response:
        """The response at portions of the rows, first asked for in order."""
        if self._uneven is None:
            return problem.part
        series = problem.response

        def at_rows(number: int) -> Floats:
            row = self.at_rows(series.__getitem__, self.parts[number])
            release(series)
            return row

        return at_rows

    def at_readings(self, series: Floats) -> Floats:
        """A series of the grid at the readings' times."""
        if self._uneven is None:
            return series if self._factor == 1 else series[:: self._factor].copy()
        out = room(self._uneven[0].size)
        for part in portions(out.size, out, series):
            out[part] = self.at_rows(series.__getitem__, part)
        return out

    def spread(self, row: Floats, number: int = 0) -> Floats:
        """A portion of a row on the grid: each of its values goes to the nearest point."""
        if self._uneven is None:
            return row
        part, time = self.parts[number], self._uneven[0]
        begin = _nearest(time[part.start], self.step) if number else 0
        end = _nearest(time[part.stop], self.step) if number + 1 < len(self.parts) else self.theta.size
        nearest = _nearest(time[part], self.step) - begin
        return np.asarray(np.bincount(nearest, weights=row, minlength=end - begin)[: end - begin], dtype=float)


def _nearest(time: Any, step: float) -> Any:
    """Number of the point of the grid that is nearest."""
    return np.rint(time / step).astype(np.int64)


def _apart(time: Floats, step: float) -> list[slice]:
    """Portions of readings, no two of which have readings nearest to the same point of the grid."""
    parts: list[slice] = []
    begin = 0
    for part in portions(time.size, time):
        stop = max(part.stop, begin)
        while stop < time.size and _nearest(time[stop], step) == _nearest(time[stop - 1], step):
            stop += 1
        if stop > begin:
            parts.append(slice(begin, stop))
        begin = stop
    return parts
