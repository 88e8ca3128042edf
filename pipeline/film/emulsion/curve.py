"""Characteristic curve of a film: exposure to darkness and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pipeline.arrays import Floats

HIGHEST_EXPOSURE = 4.0
TABLE_SIZE = 4097


@dataclass(frozen=True)
class ToneCurve:
    """Darkness above blank film, `darkest/(1 + (middle/E)^contrast)`: toe, straight part and shoulder.

    Darkness is log10 of the blank pixel over the pixel, whatever the scanner's own gamma: a factor of the density.

    Attributes
    ----------
    darkest : float
        Darkness of endless exposure.
    middle : float
        Relative exposure that gives half of it.
    contrast : float
        Exponent; slope of the straight part is `darkest*contrast/4` per e-fold of exposure.
    """

    darkest: float
    middle: float
    contrast: float

    def darkness(self, exposure: ArrayLike) -> Floats:
        """Darkness at a relative exposure, 0 for none."""
        ratio = (np.maximum(np.asarray(exposure, dtype=np.float64), 0.0) / self.middle) ** self.contrast
        return np.asarray(self.darkest * ratio / (1.0 + ratio), dtype=np.float64)

    def exposure(self, darkness: ArrayLike) -> Floats:
        """Exposure that gives a darkness; the highest of the table where the film is saturated."""
        share = np.clip(np.asarray(darkness, dtype=np.float64) / self.darkest, 0.0, 1.0 - 1e-9)
        value = self.middle * (share / (1.0 - share)) ** (1.0 / self.contrast)
        return np.asarray(np.minimum(value, HIGHEST_EXPOSURE), dtype=np.float64)

    def rate(self, exposure: ArrayLike) -> Floats:
        """Derivative of the darkness by the exposure."""
        value = np.maximum(np.asarray(exposure, dtype=np.float64), 1e-9)
        ratio = (value / self.middle) ** self.contrast
        return np.asarray(self.darkest * self.contrast * ratio / (value * (1.0 + ratio) ** 2), dtype=np.float64)

    def table(self) -> Floats:
        """Darkness and its derivative at even steps from 0 to the highest exposure, (2, size)."""
        grid = np.linspace(0.0, HIGHEST_EXPOSURE, TABLE_SIZE)
        return np.stack([self.darkness(grid), self.rate(np.maximum(grid, 0.25 * grid[1]))])
