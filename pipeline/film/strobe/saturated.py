"""A film where its exposure can be told: the turning points of slow films are saturated, and tell nothing but that."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.film.parts import Emulsion

TOLD, GUESSED = 0.3, 1.0  # of an exposure, 1 sigma of a pixel's grain up to which it is told, and at all believed
HIDDEN = 1e3  # 1 sigma of what is not told


def saturation(emulsion: Emulsion, unsure: float = TOLD) -> float:
    """Exposure from which the grain of a pixel exceeds a share of it: how bright it was is no longer told."""
    light = np.linspace(0.02, 2.0, 100, dtype=np.float32)
    told = np.asarray(emulsion.noise(light), dtype=np.float64) < unsure * light
    return float(light[told].max()) if told.any() else float(light[-1])


@dataclass(frozen=True)
class Saturated:
    """An emulsion whose saturated pixels have no weight.

    Attributes
    ----------
    emulsion : Emulsion
    told : float
        Exposure beyond which nothing is told.
    brightest : float
        The highest exposure that is given.
    """

    emulsion: Emulsion
    told: float
    brightest: float

    @staticmethod
    def of(emulsion: Emulsion) -> Saturated:
        """The same emulsion with an end to what it tells."""
        return Saturated(emulsion, saturation(emulsion), saturation(emulsion, GUESSED))

    def exposure(self, pixels: NDArray[Any], first: int) -> NDArray[np.float32]:
        """Relative exposure of rows from `first` on, up to the highest that is believed."""
        return np.minimum(self.emulsion.exposure(pixels, first), np.float32(self.brightest))

    def noise(self, exposure: NDArray[np.float32]) -> NDArray[np.float32]:
        """1 sigma of the grain in units of exposure; without end where the film is saturated."""
        sigma = np.asarray(self.emulsion.noise(exposure), dtype=np.float32)
        return np.where(np.asarray(exposure) > self.told, np.float32(HIDDEN), sigma)
