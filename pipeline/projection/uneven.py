"""Projection from uneven sample times: the first pendulum goes to a uniform grid, the response back to the samples.

Both ways go through local fits of the same eight functions as the quadrature; the difference is never interpolated.
"""

from __future__ import annotations

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats
from pipeline.gaps import fill_gaps
from pipeline.projection.kernels import COLUMNS
from pipeline.projection.solve import UniformProblem, oscillation
from pipeline.projection.taps import CENTRE, NODES, fitted_basis

FIT_SAMPLES = 14  # of the first pendulum around each grid point; more than the eight functions, so that noise averages
MOST_STRETCH = 2.5  # a grid point whose samples span more than this many times the usual is a gap
MOST_ANGLE = 0.35  # rad of swing between grid points


class UnevenProblem:
    """Uneven samples of both series, NaN = missing. See `solve.Problem`."""

    def __init__(
        self,
        time: Floats,
        theta: Floats,
        difference: Floats,
        fitted_at: float,
        ratio: float,
        damping_difference: float,
    ) -> None:
        spacing = float(time[-1]) / (time.size - 1)
        intervals = int(np.ceil(time[-1] * fitted_at / min(MOST_ANGLE, 1.25 * spacing * fitted_at)))
        step = float(time[-1]) / intervals
        if step * fitted_at * 4.0 < spacing * fitted_at or spacing * fitted_at > 0.5 * np.pi:
            raise RefusedError("time: uneven samples fewer than four a swing; give at least four samples a swing")
        grid = np.arange(intervals + 1) * step
        present = np.isfinite(theta)
        whole = fill_gaps(_to_grid(time[present], theta[present], grid, fitted_at), step, fitted_at)
        if not np.isfinite(whole).all():
            raise RefusedError("record/elongation: the first pendulum has a gap too long to bridge")
        self._uniform = UniformProblem(whole, np.full(grid.size, np.nan), step, fitted_at, ratio, damping_difference)
        self.half = 0.5 * float(time[-1])
        used = np.isfinite(difference)
        self._size, self._used = time.size, used
        self._time, self._difference = time[used], difference[used]
        self._where, self._weights = _from_grid(self._time, step, grid.size, fitted_at)
        self._columns = np.empty((self._time.size, COLUMNS))

    def respond(self, frequency: float, gamma: float) -> None:
        """See `Problem`."""
        self._uniform.respond(frequency, gamma)
        forms = np.stack([self._uniform.response, self._uniform.slope, self._uniform.slope_damping])
        values = np.einsum("kij,ij->ki", forms[:, self._where[:, None] + np.arange(NODES)], self._weights)
        self._response, self._columns[:, 5], self._columns[:, 6] = values

    def moments(self, frequency: float, gamma: float, coefficient: Floats, limit: float) -> tuple[Floats, int]:
        """See `Problem`."""
        residual = self._fill_columns(frequency, gamma, coefficient)
        within = np.abs(residual) <= limit
        self._columns[:, 7] = residual
        chosen = self._columns if within.all() else self._columns[within]
        return chosen.T @ chosen, int((~within).sum())

    def residual(self, frequency: float, gamma: float, coefficient: Floats, limit: float) -> Floats:
        """See `Problem`."""
        residual = self._fill_columns(frequency, gamma, coefficient)
        out = np.full(self._size, np.nan)
        out[self._used] = np.where(np.abs(residual) <= limit, residual, np.nan)
        return out

    def _fill_columns(self, frequency: float, gamma: float, coefficient: Floats) -> Floats:
        carrier = np.exp((-gamma + 1j * oscillation(frequency, gamma)) * self._time)
        scaled = self._time / self.half - 1.0
        self._columns[:, 0], self._columns[:, 1], self._columns[:, 2] = carrier.real, carrier.imag, 1.0
        self._columns[:, 3], self._columns[:, 4] = scaled * carrier.real, scaled * carrier.imag
        return np.asarray(self._difference - self._response - self._columns[:, :3] @ coefficient)


def _to_grid(time: Floats, series: Floats, grid: Floats, frequency: float) -> Floats:
    """Uniform values by a local fit of the eight functions through the nearest samples; NaN where there are too few."""
    start = np.clip(np.searchsorted(time, grid) - FIT_SAMPLES // 2, 0, max(time.size - FIT_SAMPLES, 0))
    rows = start[:, None] + np.arange(FIT_SAMPLES)
    if time.size < FIT_SAMPLES:
        return np.full(grid.size, np.nan)
    usual = float(np.median(time[FIT_SAMPLES - 1 :] - time[: 1 - FIT_SAMPLES]))
    scale = usual / (FIT_SAMPLES - 1)
    tau = time[rows] - grid[:, None]
    basis = fitted_basis((tau / scale).ravel(), frequency * scale).reshape(NODES, *tau.shape)
    size = np.abs(basis).max(axis=(1, 2))
    basis = np.moveaxis(basis / size[:, None, None], 0, -1)
    # value at the grid point is the constant's coefficient plus that of cos, where cos is kept as such
    origin = fitted_basis(np.zeros(1), frequency * scale)[:, 0] / size
    normal = np.einsum("gik,gil->gkl", basis, basis) + 1e-13 * np.eye(NODES)
    right = np.einsum("gik,gi->gk", basis, series[rows])
    values = np.linalg.solve(normal, right[:, :, None])[:, :, 0] @ origin
    reach = np.abs(tau)
    poor = (reach.max(axis=1) > MOST_STRETCH * usual) | (reach.min(axis=1) > 0.3 * usual)
    values[poor] = np.nan
    return np.asarray(values)


def _from_grid(time: Floats, step: float, count: int, frequency: float) -> tuple[np.ndarray, Floats]:
    """First node and eight weights that interpolate a uniform series at each time."""
    where = np.clip(np.floor(time / step).astype(np.int64) - 3, 0, count - NODES)
    position = time / step - where - CENTRE
    matrix = fitted_basis(np.arange(NODES) - CENTRE, frequency * step)
    return where, np.linalg.solve(matrix, fitted_basis(position, frequency * step)).T.copy()
