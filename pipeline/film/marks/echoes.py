"""Errors of gaps that last: what neighbouring marks err alike is taken for the paper's motion.

The drive's model tells motion from errors by their being independent from mark to mark. Dirt, bends of the tracker's
curve and the obliqueness of strokes are not: marks half a swing apart meet the strokes at nearly the same phase. Traces
tell, since the paper moves all of them at once: what lasts in their differences is error.
"""

from __future__ import annotations

import itertools

import numpy as np

from pipeline.film.marks.drive import Drive
from pipeline.film.parts import Floats

LAGS = 4  # marks: two swings
ENOUGH = 40  # pairs of marks a lag
SHARED = 0.3  # of the marks' floor, where one trace shows the marks


def lasting(rows: Floats, found: Drive) -> float:
    """1 sigma of the lasting error of a mark's row, px.

    Parameters
    ----------
    rows : (traces, marks) array
        Measured, freed of offsets and shear; NaN = missing.
    found : Drive
    """
    left = np.where(found.used, rows - found.row, np.nan)
    products = []
    for one, other in itertools.combinations(left, 2):
        apart = one - other
        for lag in range(1, LAGS + 1):
            both = apart[lag:] * apart[:-lag]
            products.append(both[np.isfinite(both)])
    several = [each for each in products if each.size >= ENOUGH]
    if not several:
        return SHARED * found.floor
    together = np.concatenate(several)
    chance = float(np.std(together)) / np.sqrt(together.size)
    of_one = 0.5 * max(float(np.mean(together)) - chance, 0.0)  # variance of a trace; a difference has two
    return float(np.sqrt(of_one / len(rows)))
