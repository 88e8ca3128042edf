"""Films of some ten thousand pixels, on which the whole way of tracking runs uncompiled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from spot_film import CONTRAST, DENSEST, FOG, MIDDLE, SCANNER, Sheet, Swinging, developed, exposure_of, shutter

from pipeline.film.emulsion import FilmEmulsion, Optics, ToneCurve, measure_blank
from pipeline.film.tracking.track import Film

SPOT, PERIOD, GRAIN, COLUMNS = 0.9, 13.3, 0.03, 60
EVERY, LENGTH = 22.1, 1.6  # rows between gaps, and of a gap
CURVE = ToneCurve((DENSEST - FOG) / SCANNER, MIDDLE, CONTRAST)
VARIANCE = np.array([FOG, SCANNER]) * (GRAIN / SCANNER) ** 2
TRACES = (Swinging(16.0, 9.0, 0.3, PERIOD, slow=1.0, slow_period=120.0), Swinging(43.0, 8.0, 2.0, PERIOD))


@dataclass(frozen=True)
class Tiny:
    """A film, its traces and where each of them was lit."""

    sheet: Sheet
    emulsion: FilmEmulsion
    traces: tuple[Swinging, ...]
    lit: NDArray[np.bool_]

    @property
    def optics(self) -> Optics:
        """True optics."""
        return Optics(SPOT, 0.0, CURVE, VARIANCE)

    @property
    def film(self) -> Film:
        """As the passes know it."""
        return Film(self.sheet, self.emulsion, self.optics, PERIOD)

    def column(self) -> NDArray[np.float64]:
        """True columns, (traces, rows)."""
        return np.stack([trace.column(self._rows) for trace in self.traces])

    def across(self, column: NDArray[np.float64]) -> NDArray[np.float64]:
        """Error of columns, normal to the line, px."""
        slope = np.stack([trace.slope(self._rows) for trace in self.traces])
        return np.asarray((column - self.column()) / np.hypot(1.0, slope))

    @property
    def _rows(self) -> NDArray[np.float64]:
        return np.arange(self.sheet.rows) + 0.5


def tiny(rows: int, lit: tuple[tuple[float, float], ...], traces: tuple[Swinging, ...] = TRACES, seed: int = 0) -> Tiny:
    """A film whose lamp burns in the stretches `lit`."""

    def lamp(row: Any) -> Any:
        return sum(((row >= begin) & (row < stop) for begin, stop in lit), np.zeros(np.shape(row), dtype=bool))

    gaps = shutter(rows, EVERY, LENGTH)
    image = developed(exposure_of(list(traces), rows, COLUMNS, gaps, lamp, SPOT), GRAIN, seed)
    sheet = Sheet(image)
    emulsion = FilmEmulsion(SPOT, 0.0, CURVE, VARIANCE, 255, measure_blank(sheet))
    return Tiny(sheet, emulsion, traces, np.asarray(lamp(np.arange(rows) + 0.5)))
