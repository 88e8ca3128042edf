"""Compiled: strokes of a pen, and all other dirt, which is strokes of other shapes."""

from __future__ import annotations

import math

from synth.film.pixels import Pixels
from synth.kernels.compiled import kernel
from synth.phase import Floats


@kernel
def draw_strokes(image: Pixels, first: int, strokes: Floats) -> None:
    """Draw straight strokes with round ends over some rows; edges are soft over a pixel.

    Parameters
    ----------
    image : (rows, columns) float32
        Densities; its first row is number `first` of the film.
    strokes : (strokes, 6)
        Row and column of both ends, half of the width, px, and the density that is left where a stroke passes.
    """
    rows, columns = image.shape
    for k in range(len(strokes)):
        y0, x0, y1, x1, radius, density = strokes[k]
        dy, dx = y1 - y0, x1 - x0
        square = max(dy * dy + dx * dx, 1e-12)
        top = max(0, math.floor(min(y0, y1) - radius - 1.0) - first)
        bottom = min(rows - 1, math.ceil(max(y0, y1) + radius + 1.0) - first)
        left = max(0, math.floor(min(x0, x1) - radius - 1.0))
        right = min(columns - 1, math.ceil(max(x0, x1) + radius + 1.0))
        for y in range(top, bottom + 1):
            for x in range(left, right + 1):
                oy, ox = first + y + 0.5 - y0, x + 0.5 - x0
                part = min(max((oy * dy + ox * dx) / square, 0.0), 1.0)
                distance = math.hypot(oy - part * dy, ox - part * dx)
                cover = min(max(radius + 0.5 - distance, 0.0), 1.0)
                image[y, x] += cover * (density - image[y, x])
