"""The emulsion of one film: from pixels to darkness above blank, and from there to exposure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.arrays import Floats
from pipeline.film.emulsion.blank import Blank, darkness_above, darkness_table, exposure_above

HIGHEST_EXPOSURE = 4.0
TABLE_SIZE = 4097
Floats32 = NDArray[np.float32]


@dataclass(frozen=True)
class FilmEmulsion:
    """How light became pixels: blank film, grain, characteristic curve.

    Attributes
    ----------
    full_scale : int
        Value of the lightest pixel.
    blank : Blank
        Darkness of blank film, place by place.
    curve : ToneCurve
        Darkness above blank against exposure.
    grain : (2,) array
        Variance of a pixel's darkness on blank film, and its growth per unit of darkness above it.
    spot : float
        1 sigma of the spot as the scan shows it, px; 0 where it is not known.
    """

    full_scale: int
    blank: Blank
    curve: ToneCurve
    grain: Floats
    spot: float = 0.0
    _table: NDArray[np.float32] = field(init=False, repr=False)
    _exposures: NDArray[np.float32] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_table", darkness_table(self.full_scale))
        steps = np.linspace(0.0, self.curve.darkest, 4096)
        object.__setattr__(self, "_exposures", self.curve.exposure(steps).astype(np.float32))

    def darkness(self, pixels: NDArray[Any], first: int) -> NDArray[np.float32]:
        """Darkness above blank film of rows from `first` on, (rows, columns), log10 units."""
        out = np.empty(pixels.shape, dtype=np.float32)
        for rows, upper, lower, weight in self._between(first, *pixels.shape):
            darkness_above(pixels[rows], self._table, upper, lower, weight, out[rows])
        return out

    def exposure(self, pixels: NDArray[Any], first: int) -> NDArray[np.float32]:
        """Relative exposure of rows from `first` on, 0 on blank film, 1 on the axis of a line at rest."""
        out = np.empty(pixels.shape, dtype=np.float32)
        steps = np.float32((self._exposures.size - 1) / self.curve.darkest)
        for rows, upper, lower, weight in self._between(first, *pixels.shape):
            exposure_above(pixels[rows], self._table, upper, lower, weight, self._exposures, steps, out[rows])
        return out

    def noise(self, exposure: NDArray[np.float32]) -> NDArray[np.float32]:
        """1 sigma of the grain in units of exposure; on blank film that of the faintest exposure that stands out."""
        faint = float(self.curve.exposure(np.sqrt(self.grain[0])))
        value = np.clip(np.asarray(exposure, dtype=np.float64), faint, HIGHEST_EXPOSURE)
        sigma = np.sqrt(self.grain[0] + self.grain[1] * self.curve.darkness(value))
        return np.asarray(sigma / np.maximum(self.curve.rate(value), 1e-6), dtype=np.float32)

    def _between(self, first: int, rows: int, columns: int) -> Iterator[tuple[slice, Floats32, Floats32, Floats32]]:
        """Runs of rows between two strips of blank film, what those show, and the rows' weight of the latter."""
        knots = self.blank.rows
        at = first + np.arange(rows) + 0.5
        place = np.clip(np.searchsorted(knots, at) - 1, 0, max(0, knots.size - 2))
        centres = np.arange(columns) + 0.5
        for i in np.unique(place):
            inside = np.flatnonzero(place == i)
            a, b = i, min(i + 1, knots.size - 1)
            span = max(knots[b] - knots[a], 1.0)
            weight = np.clip((at[inside] - knots[a]) / span, 0.0, 1.0).astype(np.float32)
            yield slice(int(inside[0]), int(inside[-1]) + 1), self._across(a, centres), self._across(b, centres), weight

    def _across(self, strip: int, columns: Floats) -> NDArray[np.float32]:
        level: NDArray[np.float32] = np.interp(columns, self.blank.columns, self.blank.darkness[strip]).astype(
            np.float32
        )
        return level


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
