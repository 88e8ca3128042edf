"""Where the first pendulum is known, and where the difference was read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from data_schemas.scratch import portions
from pipeline.arrays import Floats
from pipeline.inversion.prepare import make_grid
from pipeline.prepared import Prepared
from pipeline.projection.kernels import block_length
from pipeline.projection.taps import NODES
from pipeline.projection.uneven import from_grid
from pipeline.projection.uniform import UniformProblem


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
    """

    theta: Floats
    step: float
    parts: list[slice]
    thinness: float
    _factor: int
    _uneven: tuple[Floats, np.ndarray, Floats] | None  # times of the rows; first node and weights of each

    @staticmethod
    def of(prepared: Prepared) -> Places:
        """Of a prepared record."""
        seen, grid = prepared.observation, make_grid(prepared)
        thinness = float(np.sqrt(grid.theta.size / seen.time.size))
        if seen.step is None:
            around = from_grid(seen.time, grid.step, grid.theta.size, prepared.nominal)
            return Places(grid.theta, grid.step, [slice(0, seen.time.size)], thinness, 0, (seen.time, *around))
        parts = list(portions(grid.theta.size, unit=block_length(grid.theta.size)))
        return Places(grid.theta, grid.step, parts, thinness, round(seen.step / grid.step), None)

    @property
    def between_readings(self) -> bool:
        """Whether the first pendulum was read too seldom to be known between its readings but from minutes of them."""
        return self._factor > 1

    def time(self, part: slice) -> Floats:
        """Of some rows, s."""
        return np.arange(part.start, part.stop) * self.step if self._uneven is None else self._uneven[0][part]

    def at_rows(self, series: Floats) -> Floats:
        """A series of the grid at the rows; NaN where one of the eight points around is."""
        if self._uneven is None:
            return series
        _, where, weights = self._uneven
        return np.asarray(np.einsum("ij,ij->i", series[where[:, None] + np.arange(NODES)], weights))

    def response(self, problem: UniformProblem, number: int) -> Floats:
        """The response at one portion of the rows; those before it must have been asked for."""
        return problem.part(number) if self._uneven is None else self.at_rows(problem.response)

    def at_readings(self, series: Floats) -> Floats:
        """A series of the grid at the readings' times."""
        return self.at_rows(series) if self._uneven is not None else series[:: self._factor].copy()

    def spread(self, row: Floats) -> Floats:
        """A portion of a row on the grid: each of its values goes to the nearest point."""
        if self._uneven is None:
            return row
        nearest = np.rint(self._uneven[0] / self.step).astype(np.int64)
        return np.asarray(np.bincount(nearest, weights=row, minlength=self.theta.size)[: self.theta.size], dtype=float)
