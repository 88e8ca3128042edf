"""A uniform grid for a first pendulum that was read at uneven times.

It is an input of the correction, to be integrated; the difference, whose frequency is wanted, stays as it was read.
"""

from __future__ import annotations

import numpy as np

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats
from pipeline.projection.taps import NODES, fitted_basis

FIT_SAMPLES = 14  # of the first pendulum around each grid point; more than the eight functions, so that noise averages
MOST_STRETCH = 2.5  # a grid point whose samples span more than this many times the usual is a gap
MOST_ANGLE = 0.35  # rad of swing between grid points


def grid_step(time: Floats, frequency: float) -> float:
    """Step of the grid, s.

    Raises
    ------
    RefusedError
        Fewer than four samples a swing.
    """
    spacing = float(time[-1]) / (time.size - 1)
    if spacing * frequency > 0.5 * np.pi:
        raise RefusedError("time: uneven samples fewer than four a swing; give at least four samples a swing")
    intervals = int(np.ceil(time[-1] * frequency / min(MOST_ANGLE, 1.25 * spacing * frequency)))
    return float(time[-1]) / intervals


def to_grid(time: Floats, series: Floats, step: float, frequency: float) -> Floats:
    """Uniform values by a local fit of the eight functions through the nearest samples; NaN where there are too few.

    Parameters
    ----------
    time, series : (n,) arrays
        s, rad; NaN = missing.
    step, frequency : float
        s, rad s-1.
    """
    grid = np.arange(round(time[-1] / step) + 1) * step
    present = np.isfinite(series)
    time, series = time[present], series[present]
    start = np.clip(np.searchsorted(time, grid) - FIT_SAMPLES // 2, 0, max(time.size - FIT_SAMPLES, 0))
    rows = start[:, None] + np.arange(FIT_SAMPLES)
    if time.size < FIT_SAMPLES:
        return np.full(grid.size, np.nan)
    usual = float(np.median(time[FIT_SAMPLES - 1 :] - time[: 1 - FIT_SAMPLES]))
    scale = usual / (FIT_SAMPLES - 1)
    tau = time[rows] - grid[:, None]
    reach = np.abs(tau)
    # out first: a window that spans a gap reaches so far that its powers would drown those of all others
    good = (reach.max(axis=1) <= MOST_STRETCH * usual) & (reach.min(axis=1) <= 0.3 * usual)
    rows, tau = rows[good], tau[good]
    values = np.full(grid.size, np.nan)
    if not good.any():
        return values
    basis = fitted_basis((tau / scale).ravel(), frequency * scale).reshape(NODES, *tau.shape)
    size = np.abs(basis).max(axis=(1, 2))
    basis = np.moveaxis(basis / size[:, None, None], 0, -1)
    # value at the grid point is the constant's coefficient plus that of cos, where cos is kept as such
    origin = fitted_basis(np.zeros(1), frequency * scale)[:, 0] / size
    normal = np.einsum("gik,gil->gkl", basis, basis) + 1e-13 * np.eye(NODES)
    right = np.einsum("gik,gi->gk", basis, series[rows])
    values[good] = np.linalg.solve(normal, right[:, :, None])[:, :, 0] @ origin
    return values
