"""A short film made pixel by pixel, without any code of the package: spot, dwell time, gaps, curve and grain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.film.parts import Floats, Tracks

FOG, DARKEST, HALF, GAMMA = 0.1, 1.5, 0.2, 1.5  # densities, exposure at half density, slope of the curve
SCAN_RANGE = 2.2


@dataclass(frozen=True)
class Pixels:
    """A scan in memory."""

    image: NDArray[Any]
    full_scale: int = 255
    scale: float | None = None

    @property
    def rows(self) -> int:
        return self.image.shape[0]

    @property
    def columns(self) -> int:
        return self.image.shape[1]

    def read(self, first: int, stop: int) -> NDArray[Any]:
        return self.image[max(first, 0) : stop]


@dataclass(frozen=True)
class Developed:
    """The film's own curve, known."""

    grain: float = 0.05
    shear: float = 0.0  # as the swings of dense bands show it

    def exposure(self, pixels: NDArray[Any], first: int) -> NDArray[np.float32]:
        density = -SCAN_RANGE * np.log10(np.maximum(np.arange(256), 0.5) / 255.0)
        share = (density - FOG) / (DARKEST - FOG)
        size = np.clip(np.abs(share), 0.0, 0.97)
        table = np.minimum(HALF * (size / (1.0 - size)) ** (1.0 / GAMMA), 3.0) * np.sign(share)
        return table.astype(np.float32)[pixels]

    def noise(self, exposure: NDArray[np.float32]) -> NDArray[np.float32]:
        light = np.maximum(np.asarray(exposure, dtype=np.float64), 0.008)
        ratio = (HALF / light) ** GAMMA
        density = FOG + (DARKEST - FOG) / (1.0 + ratio)
        rate = (DARKEST - FOG) * GAMMA * ratio / light / (1.0 + ratio) ** 2
        return np.minimum((self.grain * np.sqrt(density) + 0.003) / rate, 1.0).astype(np.float32)


@dataclass(frozen=True)
class Film:
    """A scan with what is true of it: gaps' rows and columns on every trace, (traces, gaps), and the traces."""

    scan: Pixels
    emulsion: Developed
    tracks: Tracks
    when: Floats
    row: Floats
    column: Floats
    speed: float
    periods: tuple[float, ...]
    phases: tuple[float, ...]
    clock: tuple[Floats, Floats]


def film(
    seconds: float,
    *,
    speed: float = 59.055,
    columns: int = 420,
    sizes: tuple[float, ...] = (94.0,),
    middles: tuple[float, ...] = (210.0,),
    periods: tuple[float, ...] = (1.00966,),
    phases: tuple[float, ...] = (0.4,),
    gap: float = 0.03,
    code: float | None = None,
    missing: tuple[int, ...] = (),
    shear: float = 0.0,
    offset: float = 0.0,
    grain: float = 0.05,
    course_error: float = 0.03,
    seed: int = 0,
    start: float = 58.0,
    spot: float = 1.1811,
) -> Film:
    """Expose a film from `start` on; a minute's mark at 60 s may bear a code."""
    rng = np.random.default_rng(seed)
    step = 5e-4
    time = start + (np.arange(round(seconds / step)) + 0.5) * step
    along = 20.0 + speed * (time - start)
    number = np.arange(np.ceil(start / 0.5), np.floor((start + seconds) / 0.5) + 1)
    number = number[~np.isin(number, missing)]
    when = number * 0.5
    if code is not None:
        when = np.sort(np.concatenate([when, [m + code for m in when if m % 60.0 == 0.0]]))
    light = np.ones(time.size)
    for mark in when:
        begin, end = (mark - 0.5 * gap - start) / step, (mark + 0.5 * gap - start) / step
        i = np.arange(max(0, int(begin) - 1), min(time.size, int(end) + 2))
        light[i] *= 1.0 - np.clip(np.minimum(i + 1, end) - np.maximum(i, begin), 0.0, 1.0)
    rows = int(along[-1]) + 20
    exposure = np.zeros((rows, columns))
    across = np.arange(-int(4.3 * spot), int(4.3 * spot) + 1)
    gap_rows, gap_columns, courses, slopes, bends = [], [], [], [], []
    centre = np.arange(rows) + 0.5
    for k, size in enumerate(sizes):
        column = middles[k] + size * np.cos(2.0 * np.pi * time / periods[k] + phases[k])
        row = along + k * offset + shear * column
        weight = light * speed * step / (np.sqrt(2.0 * np.pi) * spot)
        y, x = np.floor(row)[:, None].astype(int) + across, np.floor(column)[:, None].astype(int) + across
        down = np.exp(-0.5 * ((y + 0.5 - row[:, None]) / spot) ** 2) * weight[:, None]
        side = np.exp(-0.5 * ((x + 0.5 - column[:, None]) / spot) ** 2)
        inside = (y >= 0) & (y < rows)
        spots = np.where(inside, down, 0.0)[:, :, None] * side[:, None, :]
        np.add.at(exposure, (np.clip(y, 0, rows - 1)[:, :, None], x[:, None, :]), spots)
        gap_rows.append(np.interp(when, time, row))
        gap_columns.append(middles[k] + size * np.cos(2.0 * np.pi * when / periods[k] + phases[k]))
        known = (centre > row[0]) & (centre < row[-1])
        lean = np.interp(centre, row, np.gradient(column) / np.gradient(row))
        error = np.convolve(rng.normal(size=rows + 30), np.hanning(31) / np.sqrt((np.hanning(31) ** 2).sum()), "valid")
        curve = np.interp(centre, row, column) + course_error * error * np.hypot(1.0, lean)
        courses.append(np.where(known, curve, np.nan))
        slopes.append(np.where(known, lean, np.nan))
        bends.append(np.gradient(slopes[-1]))
    density = FOG + (DARKEST - FOG) / (1.0 + (HALF / np.maximum(exposure, 1e-12)) ** GAMMA)
    density += grain * np.sqrt(density) * rng.normal(size=density.shape)
    image = np.clip(np.round(255.0 * 10.0 ** (-np.maximum(density, 0.0) / SCAN_RANGE)), 0, 255).astype(np.uint8)
    course, slope = np.array(courses), np.array(slopes)
    tracks = Tracks(
        position=course, sigma=np.full_like(course, 0.2), course=course, slope=slope, curvature=np.array(bends),
        brightness=np.ones_like(course), qc=np.zeros(course.shape, dtype=np.uint16),
        rows_per_swing=periods[0] * speed, spot=spot,
    )  # fmt: skip
    return Film(
        Pixels(image), Developed(grain), tracks, when, np.array(gap_rows), np.array(gap_columns),
        speed, periods, phases, (along, time),
    )  # fmt: skip
