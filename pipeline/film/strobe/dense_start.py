"""Where dense bands lie on a slow film, how fast they swing, and their first curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.film.parts import Floats
from pipeline.film.strobe.dense_kernels import SIZE, fit_block, light_along

LEAST_LIGHT = 0.25  # of a band's mean light over all columns, at its edges
BLANK = 5.0  # percent of the columns, at least, that no trace reaches
NARROWEST = 12  # columns
SHORTEST, LONGEST = 6.0, 120.0  # rows in a swing
ROOM = np.array([30.0, 30.0, 10.0, 4.0, 30.0, 15.0, 3.0, 30.0, 15.0, 3.0])  # px, of a shape about a guess
ROUNDS = 12
TRIES = 7  # phases
LIT = 0.6  # share of a line's points that are lit


@dataclass(frozen=True)
class Band:
    """A band of swings: columns from `left` to `right`."""

    left: int
    right: int


def bands(exposure: NDArray[np.float32], count: int | None) -> list[Band]:
    """Bands of columns in which a piece of film shows light, the brightest `count` of them, from left to right."""
    profile = np.convolve(exposure.mean(axis=0), np.ones(7) / 7.0, "same")
    profile = profile - np.percentile(profile, BLANK)
    lit = profile > LEAST_LIGHT * np.percentile(profile[profile > 0.1 * profile.max()], 50)
    edge = np.flatnonzero(np.diff(np.concatenate([[False], lit, [False]]).astype(np.int8)))
    found: list[Band] = []
    for left, right in zip(edge[::2], edge[1::2], strict=True):
        if found and left - found[-1].right < NARROWEST // 2:
            found[-1] = Band(found[-1].left, int(right))
        else:
            found.append(Band(int(left), int(right)))
    found = [band for band in found if band.right - band.left >= NARROWEST]
    brightest = sorted(found, key=lambda band: -float(profile[band.left : band.right].sum()))
    kept = brightest if count is None else brightest[:count]
    return sorted(kept, key=lambda band: band.left)


def moment(exposure: NDArray[np.float32], band: Band) -> Floats:
    """How far to the right the light of each row lies in a band, (rows,): turning points are brightest."""
    columns = np.arange(band.left, band.right) + 0.5 - 0.5 * (band.left + band.right)
    return np.asarray(exposure[:, band.left : band.right].astype(np.float64) @ columns)


def rows_per_swing(exposure: NDArray[np.float32], found: list[Band]) -> float:
    """Rows in one swing, by the strongest line of all bands' moments; swell, which is slower, weighs less."""
    size = 8 * exposure.shape[0]
    frequency = np.fft.rfftfreq(size)
    power = np.zeros(frequency.size)
    for band in found:
        series = moment(exposure, band)
        power += np.abs(np.fft.rfft((series - series.mean()) * np.hanning(series.size), size)) ** 2
    inside = (frequency > 1.0 / LONGEST) & (frequency < 1.0 / SHORTEST)
    weighed = np.where(inside, power * frequency**2, 0.0)
    top = int(np.argmax(weighed))
    a, b, c = np.log(np.maximum(power[top - 1 : top + 2], 1e-300))
    return float(size / (top + 0.5 * (a - c) / (a - 2.0 * b + c)))


def first_shape(
    exposure: NDArray[np.float32], first: int, band: Band, middle: float, period: float, spot: float, canvas: Floats
) -> tuple[Floats, float]:
    """Curve of the block around row `middle`, and its light (0: none was found)."""
    turn, half = 2.0 * np.pi / period, period
    near = exposure[
        max(int(middle - 0.6 * period) - first, 0) : int(middle + 0.6 * period) - first, band.left : band.right
    ]
    if near.size == 0:
        return np.zeros(SIZE), 0.0
    # within a swing the turning points are the outermost light
    profile = np.convolve(near.max(axis=0), np.ones(3) / 3.0, "same")
    lit = np.flatnonzero(profile > 0.35 * profile.max())
    left, right = band.left + lit[0] + 0.5, band.left + lit[-1] + 0.5
    series = moment(exposure, band)
    at = np.arange(series.size) + first + 0.5
    window = np.exp(-0.5 * ((at - middle) / (0.7 * period)) ** 2)
    level = np.average(series, weights=window)
    phase = np.angle(np.sum(window * (series - level) * np.exp(-1j * turn * (at - middle))))
    best, best_light = np.zeros(SIZE), 0.0
    quality = np.empty(3)
    for away in np.linspace(-0.5, 0.5, TRIES):
        shape = np.zeros(SIZE)
        shape[0] = 0.5 * (left + right)
        size = 0.5 * (right - left)
        shape[4], shape[7] = size * np.cos(phase + away), -size * np.sin(phase + away)
        fit_block(exposure, first, shape, middle, half, turn, spot, ROOM, ROUNDS, canvas, quality)
        if quality[2] < LIT:
            continue
        light = light_along(exposure, first, shape, middle, half, turn, spot)
        if light > best_light:
            best, best_light = shape, light
    return best, best_light
