"""Pixels between pixels: cubic convolution, for strips that lay a little differently in the scanner."""

from __future__ import annotations

import math

from pipeline.film.scan.image import Pixels
from synth.kernels.compiled import kernel


@kernel
def resample(source: Pixels, wanted: Pixels, row: float, column: float, cosine: float, sine: float, top: float) -> None:
    """Fill `wanted` from `source`: pixel (i, j) is taken from (row + i cos - j sin, column + j cos + i sin).

    Cubic convolution of Keys (1981), a = -1/2; beyond the edges the edge is repeated. Positions count from the first
    pixel's centre; `top` is the lightest value.
    """
    rows, columns = source.shape
    for i in range(wanted.shape[0]):
        for j in range(wanted.shape[1]):
            y, x = row + i * cosine - j * sine, column + j * cosine + i * sine
            below, left = math.floor(y), math.floor(x)
            u, v = y - below, x - left
            # Keys's four weights
            y0, y1 = u * (-0.5 + u * (1.0 - 0.5 * u)), 1.0 + u * u * (-2.5 + 1.5 * u)
            y2, y3 = u * (0.5 + u * (2.0 - 1.5 * u)), u * u * (-0.5 + 0.5 * u)
            x0, x1 = v * (-0.5 + v * (1.0 - 0.5 * v)), 1.0 + v * v * (-2.5 + 1.5 * v)
            x2, x3 = v * (0.5 + v * (2.0 - 1.5 * v)), v * v * (-0.5 + 0.5 * v)
            value = 0.0
            for k in range(4):
                line = source[min(max(int(below) + k - 1, 0), rows - 1)]
                a = min(max(int(left) - 1, 0), columns - 1)
                b = min(max(int(left), 0), columns - 1)
                c = min(max(int(left) + 1, 0), columns - 1)
                d = min(max(int(left) + 2, 0), columns - 1)
                weight = y0 if k == 0 else y1 if k == 1 else y2 if k == 2 else y3
                value += weight * (x0 * line[a] + x1 * line[b] + x2 * line[c] + x3 * line[d])
            wanted[i, j] = min(max(math.floor(value + 0.5), 0.0), top)
