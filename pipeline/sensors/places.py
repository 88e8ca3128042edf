"""Where the first pendulum is known, and where the difference was read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Floats
from pipeline.inversion.prepare import make_grid
from pipeline.prepared import Prepared
from pipeline.projection.taps import NODES
from pipeline.projection.uneven import from_grid


@dataclass(frozen=True)
class Places:
    """The uniform grid of the first pendulum, and the rows of a least squares: its points, or readings at uneven times.

    Attributes
    ----------
    theta, step : (m,) array, float
        The first pendulum, rad, and the grid's step, s.
    time : (n,) array
        Of the rows, s.
    thinness : float
        Noise on the grid over that of a reading, at the same power a second.
    """

    theta: Floats
    step: float
    time: Floats
    thinness: float
    _factor: int
    _around: tuple[np.ndarray, Floats] | None

    @staticmethod
    def of(prepared: Prepared) -> Places:
        """Of a prepared record."""
        seen, grid = prepared.observation, make_grid(prepared)
        thinness = float(np.sqrt(grid.theta.size / seen.time.size))
        if seen.step is None:
            around = from_grid(seen.time, grid.step, grid.theta.size, prepared.nominal)
            return Places(grid.theta, grid.step, seen.time, thinness, 0, around)
        time = np.arange(grid.theta.size) * grid.step
        return Places(grid.theta, grid.step, time, thinness, round(seen.step / grid.step), None)

    @property
    def between_readings(self) -> bool:
        """Whether the first pendulum was read too seldom to be known between its readings but from minutes of them."""
        return self._factor > 1

    def at_rows(self, series: Floats) -> Floats:
        """A series of the grid at the rows; NaN where one of the eight points around is."""
        if self._around is None:
            return series
        where, weights = self._around
        return np.asarray(np.einsum("ij,ij->i", series[where[:, None] + np.arange(NODES)], weights))

    def at_readings(self, series: Floats) -> Floats:
        """A series of the grid at the readings' times."""
        return self.at_rows(series) if self._around is not None else series[:: self._factor].copy()

    def spread(self, row: Floats) -> Floats:
        """A row on the grid: each of its values goes to the nearest point."""
        if self._around is None:
            return row
        nearest = np.rint(self.time / self.step).astype(np.int64)
        return np.asarray(np.bincount(nearest, weights=row, minlength=self.theta.size)[: self.theta.size], dtype=float)
