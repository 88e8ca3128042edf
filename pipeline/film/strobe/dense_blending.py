"""Blocks of a dense band blended into one curve, from block to block smoothly."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.film.parts import Floats
from pipeline.film.strobe.dense_kernels import CUBIC

APART = 1.0  # spots across the line, by which two blocks may differ in the middle between them
BETWEEN = 9  # places at which they are compared


def values(shape: Floats, away: NDArray[np.floating[Any]], half: float) -> Floats:
    """Column, slope and curvature of blocks' curves at places `away` rows from their middles, (3, ...).

    Parameters
    ----------
    shape : (..., SIZE) array
    away : array
        Of a shape that fits the shapes' leading ones.
    half : float
        Half of a block, and a swing, rows.
    """
    x, turn = away / half, 2.0 * np.pi / half
    rotation = np.exp(1j * turn * away)
    p0, p1, p2, p3 = (shape[..., k] for k in range(CUBIC))
    z0, z1, z2 = (shape[..., CUBIC + k] - 1j * shape[..., CUBIC + 3 + k] for k in range(3))
    z, dz, ddz = z0 + x * (z1 + x * z2), (z1 + 2.0 * x * z2) / half, 2.0 * z2 / half**2
    return np.stack(
        [
            p0 + x * (p1 + x * (p2 + x * p3)) + (z * rotation).real,
            (p1 + x * (2.0 * p2 + 3.0 * x * p3)) / half + ((dz + 1j * turn * z) * rotation).real,
            (2.0 * p2 + 6.0 * x * p3) / half**2 + ((ddz + 2j * turn * dz - turn**2 * z) * rotation).real,
        ]
    )


def joined(shape: Floats, light: Floats, period: float, spot: float) -> Floats:
    """Light of the blocks, 0 also for those that lie beside both their neighbours, or beside one and have no other."""
    away = np.linspace(0.25, 0.75, BETWEEN) * period
    good = light > 0.0
    before, after = values(shape[:-1, None], away, period), values(shape[1:, None], away - period, period)
    across = np.median(np.abs(before[0] - after[0]) / np.sqrt(1.0 + before[1] ** 2), axis=1)
    agree = np.concatenate([[False], good[:-1] & good[1:] & (across < APART * spot), [False]])
    return np.where(good & (agree[:-1] | agree[1:]), light, 0.0)


def blended(
    middle: Floats, shape: Floats, light: Floats, period: float, rows: int
) -> tuple[Floats, Floats, Floats, Floats]:
    """Course, slope, curvature and light by rows; NaN where no block is good."""
    at = np.arange(rows) + 0.5
    before = np.floor((at - middle[0]) / period).astype(np.int64)  # the block whose middle is the last one passed
    first, second = np.clip(before, 0, middle.size - 1), np.clip(before + 1, 0, middle.size - 1)
    x = (at - middle[0]) / period - before
    known, next_known = (light[first] > 0.0) & (before >= 0), (light[second] > 0.0) & (before + 1 < middle.size)
    # alone, a block counts in full
    both = known & next_known
    weight = np.where(both, x * x * (3.0 - 2.0 * x), np.where(known, 0.0, 1.0))
    lean = np.where(both, 6.0 * x * (1.0 - x) / period, 0.0)
    bend = np.where(both, (6.0 - 12.0 * x) / period**2, 0.0)
    here, there = values(shape[first], at - middle[first], period), values(shape[second], at - middle[second], period)
    apart = there - here
    out = np.stack(
        [
            here[0] + weight * apart[0],
            here[1] + weight * apart[1] + lean * apart[0],
            here[2] + weight * apart[2] + 2.0 * lean * apart[1] + bend * apart[0],
            light[first] + weight * (light[second] - light[first]),
        ]
    )
    near = (known & (x <= 1.0)) | (next_known & (np.abs(at - middle[second]) <= period))
    out[:, ~near] = np.nan
    return out[0], out[1], out[2], out[3]
