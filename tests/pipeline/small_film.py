"""A small film, drawn spot by spot: shares nothing with the product but the physics."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

PERIOD, SPOT = 31.3, 1.2
FOG, DENSEST, MIDDLE, CONTRAST, SCANNER = 0.1, 1.5, 0.2, 1.5, 2.2
STEPS = 24  # a row


@dataclass
class Sheet:
    """An image that is read like an opened scan."""

    image: NDArray[Any]
    scale: float | None = None
    reads: list[tuple[int, int]] = field(default_factory=list)

    @property
    def rows(self) -> int:
        return int(self.image.shape[0])

    @property
    def columns(self) -> int:
        return int(self.image.shape[1])

    @property
    def full_scale(self) -> int:
        return int(np.iinfo(self.image.dtype).max)

    def read(self, first: int, stop: int) -> NDArray[Any]:
        self.reads.append((first, stop))
        return self.image[max(first, 0) : stop]


@dataclass
class Swinging:
    """One trace: column over rows of film, and the rows (begin, stop) in which the shutter was closed."""

    middle: float = 100.0
    amplitude: float = 60.0
    phase: float = 0.3
    period: float = PERIOD
    slow: float = 0.0
    slow_period: float = 260.0

    def column(self, row: Any) -> Any:
        fast = self.amplitude * np.cos(2 * np.pi * np.asarray(row) / self.period + self.phase)
        return self.middle + fast + self.slow * np.sin(2 * np.pi * np.asarray(row) / self.slow_period)

    def slope(self, row: Any) -> Any:
        return (self.column(np.asarray(row) + 1e-4) - self.column(np.asarray(row) - 1e-4)) / 2e-4


def exposure_of(
    traces: list[Swinging],
    rows: int,
    columns: int,
    gaps: NDArray[np.float64] | None = None,
    lamp: Any = None,
    spot: float = SPOT,
    shear: float = 0.0,
) -> NDArray[np.float64]:
    """Light that a Gaussian spot left on each pixel's centre, 1 on the axis of a line at rest."""
    film = np.zeros((rows, columns))
    times = (np.arange(-16 * STEPS, (rows + 16) * STEPS) + 0.5) / STEPS
    shine = np.ones(times.size) if lamp is None else np.asarray(lamp(times), dtype=float)
    for begin, stop in np.zeros((0, 2)) if gaps is None else gaps:
        shine[(times >= begin) & (times < stop)] = 0.0
    reach = int(np.ceil(5 * spot))
    window = np.arange(-reach, reach + 1)
    for trace in traces:
        place = trace.column(times)
        at_row = times + shear * place
        i, j = np.floor(at_row).astype(int)[:, None] + window, np.floor(place).astype(int)[:, None] + window
        down = np.exp(-0.5 * ((i + 0.5 - at_row[:, None]) / spot) ** 2)
        across = np.exp(-0.5 * ((j + 0.5 - place[:, None]) / spot) ** 2)
        down *= (shine / (STEPS * np.sqrt(2 * np.pi) * spot))[:, None] * ((i >= 0) & (i < rows))
        across *= (j >= 0) & (j < columns)
        light = down[:, :, None] * across[:, None, :]
        at = np.clip(i, 0, rows - 1)[:, :, None], np.clip(j, 0, columns - 1)[:, None, :]
        np.add.at(film, at, light)
    return film


def developed(film: NDArray[np.float64], grain: float = 0.05, seed: int = 0, deep: bool = False) -> NDArray[Any]:
    """Scan of the film: characteristic curve, grain, scanner."""
    density = FOG + (DENSEST - FOG) / (1.0 + (MIDDLE / np.maximum(film, 1e-12)) ** CONTRAST)
    noise = np.random.default_rng(seed).normal(size=film.shape)
    density = np.maximum(density + grain * np.sqrt(density) * noise, 0.0)
    top = 65535 if deep else 255
    return np.round(top * 10.0 ** (-density / SCANNER)).astype(np.uint16 if deep else np.uint8)


def shutter(rows: int, every: float = 29.3, length: float = 1.8) -> NDArray[np.float64]:
    """Gaps at even steps."""
    middles = np.arange(5.0, rows + 10.0, every)
    return np.stack([middles - 0.5 * length, middles + 0.5 * length], axis=1)
