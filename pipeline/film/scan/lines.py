"""Whether lines are dark or light, and where the film ends: told from a few slabs of rows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.film.scan.image import Image, Pixels, View

_SLABS = 24
_SLAB_ROWS = 48
_BLOCK = 48  # columns of one level of the blank film
_FAINTEST = 6.0  # times the grain: what counts as a line


def sample_rows(image: Image) -> list[tuple[int, int]]:
    """First and last row of slabs spread evenly over the image."""
    height = min(_SLAB_ROWS, image.rows)
    starts = np.unique(np.linspace(0, image.rows - height, _SLABS).astype(np.int64))
    return [(int(start), int(start) + height) for start in starts]


def lines_are_light(image: Image) -> bool:
    """Whether what departs from the blank film is lighter than it; film is mostly blank.

    Dust and scratches depart both ways; lines are the most of what departs.
    """
    darker, lighter = 0.0, 0.0
    for first, stop in sample_rows(image):
        departure = _departures(image.read(first, stop))
        darker += float(-departure[departure < 0.0].sum())
        lighter += float(departure[departure > 0.0].sum())
    return lighter > darker


def _departures(pixels: Pixels) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """By how many times the grain pixels depart from the median of their block, 0 where it is not clearly so."""
    columns = pixels.shape[1] // _BLOCK * _BLOCK or pixels.shape[1]
    blocks = pixels[:, :columns].reshape(pixels.shape[0], max(1, columns // _BLOCK), -1).astype(np.float32)
    blocks -= np.median(blocks, axis=(0, 2), keepdims=True)
    grain = 1.4826 * np.median(np.abs(blocks), axis=(0, 2), keepdims=True)
    # a block of even noise is film; one across the film's edge is wide, and its departures no lines
    blocks /= np.maximum(grain, np.median(grain)) + 0.5
    blocks[np.abs(blocks) < _FAINTEST] = 0.0
    return blocks


@dataclass(frozen=True)
class Inverted(View):
    """An image whose light lines have become dark."""

    def read(self, first: int, stop: int) -> Pixels:
        """Rows `first` to `stop`."""
        pixels = self.image.read(first, stop)
        return np.asarray(pixels.dtype.type(self.full_scale) - pixels)
