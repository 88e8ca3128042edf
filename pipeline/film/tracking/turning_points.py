"""Turning points of swinging traces: where the spot rests it leaves the darkest marks of the film."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats

DARKEST_SHARE = 0.35
DARK_SHARE = 0.01
ALIKE = 0.7
MOST_POINTS = 200


def spot_size(darkness: NDArray[np.float32]) -> float:
    """1 sigma of the spot, px, from how alike rows are that lie close together.

    Most of a trace runs steeply across the rows, and its cut along the film is the spot's own profile. The likeness at
    a distance d falls as exp(-d^2/4 spot^2); the distance 0 holds the grain and is left out, and so are the darkest
    pixels: dirt and turning points, wider than a line.
    """
    clipped = np.clip(darkness, 0.0, np.quantile(darkness, 1.0 - DARK_SHARE)).astype(np.float64)
    clipped -= clipped.mean()
    top = max(3, min(100, darkness.shape[0] // 4))
    nearest = float(np.mean(clipped[1:] * clipped[:-1]))
    for distance in range(2, top):
        ratio = float(np.mean(clipped[distance:] * clipped[:-distance])) / max(nearest, 1e-12)
        if ratio < ALIKE:
            return float(np.clip(np.sqrt((distance**2 - 1.0) / (-4.0 * np.log(max(ratio, 0.02)))), 0.6, 40.0))
    return 1.2


def turning_points(darkness: NDArray[np.float32], spot: float) -> tuple[NDArray[np.float32], Floats]:
    """Smoothed darkness, and the points (n, 3): row, column, +1 where the trace turns at its greatest column, else -1.

    Points count px from the piece's edges.
    """
    from scipy import ndimage

    smooth: NDArray[np.float32] = ndimage.gaussian_filter(darkness, 0.8 * spot, mode="nearest")
    reach = 2 * max(1, round(1.5 * spot)) + 1
    peaks: NDArray[Any] = ndimage.maximum_filter(smooth, size=reach, mode="nearest") == smooth
    top = float(np.quantile(smooth[peaks], 0.995)) if peaks.any() else 0.0
    row, column = np.nonzero(peaks & (smooth > DARKEST_SHARE * top))
    strongest = np.argsort(smooth[row, column])[::-1][:MOST_POINTS]
    row, column = row[strongest], column[strongest]
    away = max(2, round(3.0 * spot))
    wide = ndimage.uniform_filter1d(smooth, 2 * max(1, round(1.5 * spot)) + 1, axis=0, mode="nearest")
    right = wide[row, np.minimum(column + away, darkness.shape[1] - 1)]
    left = wide[row, np.maximum(column - away, 0)]
    finer_row = row + 0.5 + _vertex(smooth, row, column, 1, 0)
    finer_column = column + 0.5 + _vertex(smooth, row, column, 0, 1)
    points = np.stack([finer_row, finer_column, np.where(left > right, 1.0, -1.0)], axis=1)
    return smooth, points[np.argsort(points[:, 0], kind="stable")]


def _vertex(
    values: NDArray[np.float32], row: NDArray[np.int64], column: NDArray[np.int64], down: int, across: int
) -> Floats:
    """By how much a parabola through a peak and its two neighbours culminates beside it, px."""
    last_row, last_column = values.shape[0] - 1, values.shape[1] - 1
    before = values[np.maximum(row - down, 0), np.maximum(column - across, 0)].astype(np.float64)
    after = values[np.minimum(row + down, last_row), np.minimum(column + across, last_column)].astype(np.float64)
    bend = np.minimum(before + after - 2.0 * values[row, column], -1e-9)
    return np.asarray(np.clip(0.5 * (before - after) / bend, -0.5, 0.5))
