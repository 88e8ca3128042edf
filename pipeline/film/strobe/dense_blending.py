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
    """Column, slope and curvature of a block's curve `away` rows from its middle, (3, n)."""
    x, turn = away / half, 2.0 * np.pi / half
    rotation = np.exp(1j * turn * away)
    slow = np.polynomial.polynomial.Polynomial(shape[:CUBIC])
    pair = np.polynomial.polynomial.Polynomial(shape[CUBIC : CUBIC + 3] - 1j * shape[CUBIC + 3 :])
    z, dz, ddz = pair(x), pair.deriv()(x) / half, pair.deriv(2)(x) / half**2
    return np.stack(
        [
            slow(x) + (z * rotation).real,
            slow.deriv()(x) / half + ((dz + 1j * turn * z) * rotation).real,
            slow.deriv(2)(x) / half**2 + ((ddz + 2j * turn * dz - turn**2 * z) * rotation).real,
        ]
    )


def joined(middle: Floats, shape: Floats, light: Floats, period: float, spot: float) -> Floats:
    """Light of the blocks, 0 also for those that lie beside both their neighbours, or beside one and have no other."""
    away = np.linspace(0.25, 0.75, BETWEEN) * period
    good = light > 0.0
    agree = np.zeros(middle.size + 1, dtype=bool)  # of each block with the one before
    for block in range(1, middle.size):
        if good[block - 1] and good[block]:
            before, after = values(shape[block - 1], away, period), values(shape[block], away - period, period)
            across = np.abs(before[0] - after[0]) / np.sqrt(1.0 + before[1] ** 2)
            agree[block] = bool(np.median(across) < APART * spot)
    return np.where(good & (agree[:-1] | agree[1:]), light, 0.0)


def blended(
    middle: Floats, shape: Floats, light: Floats, period: float, rows: int
) -> tuple[Floats, Floats, Floats, Floats]:
    """Course, slope, curvature and light by rows; NaN where no block is good."""
    out = np.full((4, rows), np.nan)
    good = light > 0.0
    for block in np.flatnonzero(good):
        before, after = block > 0 and good[block - 1], block + 1 < good.size and good[block + 1]
        low = middle[block] if before else middle[block] - period
        at = np.arange(max(int(np.ceil(low - 0.5)), 0), min(int(np.ceil(middle[block] + period - 0.5)), rows))
        if at.size == 0:
            continue
        here = values(shape[block], at + 0.5 - middle[block], period)
        out[:3, at], out[3, at] = here, light[block]
        if after:
            apart = values(shape[block + 1], at + 0.5 - middle[block + 1], period) - here
            x = np.clip((at + 0.5 - middle[block]) / period, 0.0, 1.0)
            weight, lean = x * x * (3.0 - 2.0 * x), 6.0 * x * (1.0 - x) / period
            out[0, at] += weight * apart[0]
            out[1, at] += weight * apart[1] + lean * apart[0]
            out[2, at] += weight * apart[2] + 2.0 * lean * apart[1]
            out[3, at] += weight * (light[block + 1] - light[block])
    return out[0], out[1], out[2], out[3]
