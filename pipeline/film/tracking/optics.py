"""What the tracker knows of spot, slit and emulsion, as numbers for the kernels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Floats
from pipeline.film.emulsion.curve import HIGHEST_EXPOSURE, TABLE_SIZE, ToneCurve


@dataclass(frozen=True)
class Optics:
    """Spot, slit and emulsion.

    Attributes
    ----------
    spot : float
        1 sigma of the spot as the scan shows it, px.
    shear : float
        Rows by which the image lags per column.
    curve : ToneCurve
        Darkness above blank against exposure.
    grain : (2,) array
        Variance of a pixel's darkness on blank film, and its growth per unit of darkness.
    """

    spot: float
    shear: float
    curve: ToneCurve
    grain: Floats

    def numbers(self) -> Floats:
        """For the kernels: spot, shear, step of the table, grain."""
        return np.array([self.spot, self.shear, HIGHEST_EXPOSURE / (TABLE_SIZE - 1), *self.grain])

    def with_(self, **changes: object) -> Optics:
        """A copy with some numbers changed."""
        return replace(self, **changes)  # type: ignore[arg-type]
