"""A piece of a scan as a picture of a given width: thin lines stay visible however much it shrinks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from pipeline.film.parts import Scan

_HEIGHT = 900  # dots across the film, at most
_LEAST_CONTRAST = 0.1  # of full scale: the grain of blank film is not stretched to black and white


def picture(scan: Scan, first: int, stop: int, left: int, right: int, dots: int) -> NDArray[np.float32]:
    """Grey from 0 (black) to 1 of rows `first` to `stop`, columns `left` to `right`, at most (dots, 900).

    A dot that covers several pixels is halfway between their mean and their darkest. The contrast is stretched from
    the darkest lines to the blank film.
    """
    down = max(1, -(-(stop - first) // dots))
    across = max(1, -(-(right - left) // _HEIGHT))
    rows, columns = (stop - first) // down, (right - left) // across
    shown = np.empty((rows, columns), dtype=np.float32)
    step = max(1, 1024 // down)
    for a in range(0, rows, step):
        b = min(rows, a + step)
        pixels = scan.read(first + a * down, first + b * down)[:, left : left + columns * across]
        blocks = pixels.reshape(b - a, down, columns, across)
        shown[a:b] = blocks.mean(axis=(1, 3), dtype=np.float32)
        if down * across > 1:
            shown[a:b] = 0.5 * (shown[a:b] + blocks.min(axis=(1, 3)))
    dark, blank = np.percentile(shown, [0.05, 60.0])
    contrast = max(float(blank - dark), _LEAST_CONTRAST * scan.full_scale)
    return np.asarray(np.clip(0.95 - 0.87 * (blank - shown) / contrast, 0.0, 1.0), dtype=np.float32)
