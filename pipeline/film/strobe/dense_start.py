"""Dense bands of a slow film row by row: where the light of each row lies, and the first curve that makes.

Light is time: whatever its speed, a trace leaves the same light in every row. So the mean place of a row's light is the
trace's own place, blurred by the spot, though a row may show two strokes and two halves of turning points.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.film.parts import Floats
from pipeline.film.strobe.dense_kernels import CUBIC, SIZE

SHADE = 3.0  # sigmas of the grain, from which a pixel is light
ROOM = np.array([1e3, 90.0, 45.0, 20.0, 1e3, 20.0, 5.0, 1e3, 20.0, 5.0])  # px, of a shape: swell as large as the swing
NOISE = 4.0  # px, 1 sigma of a row's mean place
ROUNDS = 4
FARTHEST = 2.0  # NOISE or usual residuals, of a row that counts in full
BRIGHTEST = 0.1  # exposure that counts: turning points are saturated, and the curve cannot tell their light
DARK = 0.3  # of the usual light of a row, below which it shows nothing


def light_of(exposure: NDArray[np.float32], left: int, right: int, least: float) -> tuple[Floats, Floats]:
    """Light of each row between two columns, (rows,), and its mean column, px; NaN without light.

    Parameters
    ----------
    exposure : (rows, columns) array
    left, right : int
        First column, and the one behind the last.
    least : float
        Exposure from which a pixel is light.
    """
    part = exposure[:, left:right]
    lit = np.where(part > least, np.minimum(part, np.float32(BRIGHTEST)), np.float32(0.0))
    light = lit.sum(axis=1, dtype=np.float64)
    columns = (np.arange(left, right) + 0.5).astype(np.float32)
    with np.errstate(divide="ignore", invalid="ignore"):
        return light, np.where(light > 0.0, (lit @ columns) / light, np.nan)


def basis(away: Floats, half: float, turn: float) -> Floats:
    """Values of a block's curve by its shape: (..., SIZE) for rows `away` from its middle."""
    x = away / half
    cos, sin = np.cos(turn * away), np.sin(turn * away)
    slow = [x**k for k in range(CUBIC)]
    return np.stack([*slow, *(cos * each for each in slow[:3]), *(sin * each for each in slow[:3])], axis=-1)


def first_shapes(
    light: Floats, column: Floats, first: int, middles: Floats, period: float, spot: float
) -> tuple[Floats, Floats]:
    """Curves of the blocks around some rows, by the mean places of the rows' light.

    Parameters
    ----------
    light, column : (rows,) arrays
        Of the rows from `first` on.
    middles : (blocks,) array
    period : float
        Rows in a swing, and half of a block.
    spot : float
        1 sigma, px.

    Returns
    -------
    shapes : (blocks, SIZE) array
    residual : (blocks,) array
        Usual distance of the rows' light from them, px; NaN where too few rows show light.
    """
    turn, count = 2.0 * np.pi / period, int(np.ceil(2.0 * period))
    at = np.round(middles - period).astype(np.int64)[:, None] - first + np.arange(count)
    inside = (at >= 0) & (at < light.size)
    at = np.clip(at, 0, light.size - 1)
    shown = np.where(inside & np.isfinite(column[at]), light[at], 0.0)
    usual = np.median(shown, axis=1, keepdims=True)
    trust = np.where((shown > DARK * usual) & (usual > 0.0), 1.0, 0.0)
    value = np.nan_to_num(column[at])
    level = np.sum(trust * value, axis=1) / np.maximum(trust.sum(axis=1), 1.0)
    design = basis(at + first + 0.5 - middles[:, None], period, turn)
    shapes, residual = np.zeros((middles.size, SIZE)), np.zeros(middles.size)
    weight = trust
    for _ in range(ROUNDS):
        weighed = design * weight[:, :, None]
        normal = np.swapaxes(weighed, 1, 2) @ design + np.diag((NOISE / ROOM) ** 2)
        right = np.swapaxes(weighed, 1, 2) @ (value - level[:, None])[:, :, None]
        shapes = np.linalg.solve(normal, right)[:, :, 0]
        away = np.abs((design @ shapes[:, :, None])[:, :, 0] - value + level[:, None])
        residual = 1.4826 * np.median(away, axis=1)
        limit = FARTHEST * np.maximum(residual, NOISE)[:, None]
        weight = trust * np.minimum(1.0, limit / np.maximum(away, 1e-9)) ** 2
    shapes[:, 0] += level
    shapes[:, CUBIC:] *= np.exp(0.5 * (turn * spot) ** 2)  # the spot blurs the swing
    few = trust.sum(axis=1) < 0.7 * count
    return shapes, np.where(few, np.nan, residual)
