"""Turning points of swinging traces: where the spot rests it leaves the darkest marks of the film."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats

DARKEST_SHARE = 0.35
MOST_POINTS = 200


def spot_size(darkness: NDArray[np.float32]) -> float:
    """1 sigma of the spot, px, from how alike rows are that lie close together.

    Most of a trace runs steeply across the rows, and its cut along the film is the spot's own profile. The likeness at
    a distance d falls as exp(-d^2/4 spot^2); the distance 0 holds the grain and is left out.
    """
    clipped = np.maximum(darkness, 0.0).astype(np.float64)
    clipped -= clipped.mean()
    top = max(4, min(24, darkness.shape[0] // 4))
    likeness = np.array([np.mean(clipped[d:] * clipped[: clipped.shape[0] - d]) for d in range(1, top)])
    floor = float(np.median(likeness[-max(1, top // 3) :]))
    likeness -= min(floor, 0.5 * float(likeness[0]))
    if likeness[0] <= 0.0:
        return 1.2
    low = int(np.argmax(likeness < 0.35 * likeness[0])) or likeness.size - 1
    ratio = max(float(likeness[low] / likeness[0]), 0.02)
    distance = low + 1.0
    return float(np.clip(np.sqrt((distance**2 - 1.0) / (-4.0 * np.log(ratio))), 0.6, 40.0))


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
    points = np.stack([row + 0.5, column + 0.5, np.where(left > right, 1.0, -1.0)], axis=1)
    return smooth, points[np.argsort(points[:, 0], kind="stable")]
