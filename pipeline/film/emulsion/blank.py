"""Darkness of the blank film, place by place: fog, vignette and an uneven lamp of the scanner.

Most pixels of a block are blank. The median of the lighter part would be drawn down and the plain median up by lines,
so a mean is taken of what lies about the middle, clipped again and again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.parts import Scan
from synth.kernels.compiled import kernel

STRIP_ROWS = 16
MOST_STRIPS = 48
BLOCK_COLUMNS = 64
CLIP = 2.0  # sigma; a normal distribution cut there has this much smaller a sigma:
CLIPPED_SIGMA = 0.8796
ROUNDS = 4


@dataclass(frozen=True)
class Blank:
    """Blank film at the centres of blocks.

    Attributes
    ----------
    rows, columns : (m,), (n,) arrays
        Centres of the blocks, px.
    darkness : (m, n) array
        Of the blank film, log10 units below full scale.
    sigma : float
        Of one pixel of blank film, same units.
    """

    rows: Floats
    columns: Floats
    darkness: Floats
    sigma: float


def darkness_table(full_scale: int) -> NDArray[np.float32]:
    """Log10 of full scale over pixel, for every value a pixel can have."""
    values = np.arange(full_scale + 1, dtype=np.float64)
    values[0] = 0.5
    return np.log10(full_scale / values).astype(np.float32)


def measure_blank(scan: Scan, table: NDArray[np.float32]) -> Blank:
    """Blank film from strips spread over the whole scan."""
    strips = int(np.clip(scan.rows // (4 * STRIP_ROWS), 1, MOST_STRIPS))
    height = min(STRIP_ROWS, scan.rows)
    firsts = np.linspace(0, scan.rows - height, strips).astype(int)
    edges = np.linspace(0, scan.columns, max(1, round(scan.columns / BLOCK_COLUMNS)) + 1).astype(int)
    level, spread = np.empty((strips, edges.size - 1)), np.empty((strips, edges.size - 1))
    for i, first in enumerate(firsts):
        strip = table[scan.read(int(first), int(first) + height)]
        for j in range(edges.size - 1):
            level[i, j], spread[i, j] = _clipped_mean(strip[:, edges[j] : edges[j + 1]].ravel().astype(np.float64))
    return Blank(firsts + 0.5 * height, 0.5 * (edges[1:] + edges[:-1]), _smoothed(level), float(np.median(spread)))


def _clipped_mean(values: Floats) -> tuple[float, float]:
    """Mean and sigma of the blank pixels among others that are darker."""
    low, quarter, middle = np.quantile(values, [0.05, 0.25, 0.5])
    sigma = max(1.1 * float(quarter - low), 1e-6)  # (1.645 - 0.674) sigma
    mean = min(float(middle), float(quarter) + 0.674 * sigma)
    for _ in range(ROUNDS):
        kept = values[np.abs(values - mean) <= CLIP * sigma]
        if kept.size < 8:
            break
        mean, sigma = float(kept.mean()), max(float(kept.std()) / CLIPPED_SIGMA, 1e-6)
    return mean, sigma


def _smoothed(level: Floats) -> Floats:
    """Blocks that stand out of their neighbours (handwriting, dirt) take their neighbours' median."""
    padded = np.pad(np.pad(level, ((1, 1), (0, 0)), **_edge(level.shape[0])), ((0, 0), (1, 1)), **_edge(level.shape[1]))
    around = np.stack([padded[i : i + level.shape[0], j : j + level.shape[1]] for i in range(3) for j in range(3)])
    median = np.median(around, axis=0)
    away = np.abs(level - median)
    return np.where(away > 4.0 * np.median(away) + 1e-4, median, level)


def _edge(size: int) -> dict[str, Any]:
    """How to go on beyond the edge: along the slope there, so that vignette does not stand out."""
    return {"mode": "reflect", "reflect_type": "odd"} if size > 1 else {"mode": "edge"}


@kernel
def darkness_above(
    pixels: NDArray[np.uint16],
    table: NDArray[np.float32],
    upper: NDArray[np.float32],
    lower: NDArray[np.float32],
    weight: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """Darkness above blank film, which lies between `upper` and `lower` (columns,) on a row, `weight` of the latter."""
    for i in range(pixels.shape[0]):
        share = weight[i]
        for j in range(pixels.shape[1]):
            out[i, j] = table[pixels[i, j]] - (upper[j] + share * (lower[j] - upper[j]))


@kernel
def exposure_above(
    pixels: NDArray[np.uint16],
    table: NDArray[np.float32],
    upper: NDArray[np.float32],
    lower: NDArray[np.float32],
    weight: NDArray[np.float32],
    exposures: NDArray[np.float32],
    steps: np.float32,
    out: NDArray[np.float32],
) -> None:
    """As `darkness_above`, and the `exposures` of darknesses that lie `steps` a unit."""
    last = np.float32(exposures.size - 1)
    for i in range(pixels.shape[0]):
        share = weight[i]
        for j in range(pixels.shape[1]):
            at = (table[pixels[i, j]] - (upper[j] + share * (lower[j] - upper[j]))) * steps
            out[i, j] = exposures[int(min(max(at, np.float32(0.0)), last))]
