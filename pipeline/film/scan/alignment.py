"""A strip laid on the one before to a small part of a pixel: shift and turn by least squares on the grey values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.film.scan.image import Image

Grey = NDArray[np.float64]

_ROWS = 720  # of the overlap that are compared
_STEPS = 12
_SETTLED = 1e-4  # px
ROUGHLY, FINELY = (4.0,), (2.0, 1.0)  # 1 sigma of the smoothing, px: wide first, to draw in from the search's bins


class Alignment(NamedTuple):
    """Place and turn of a strip (see `Placement`), and the correlation of the grey values there."""

    row: float
    column: float
    turn: float
    match: float


def align(
    before: Image, strip: Image, row: float, column: float, widths: Sequence[float], turn: float = 0.0
) -> Alignment:
    """Refine where a strip lies.

    Gauss-Newton on the difference of the two images, smoothed less and less.

    Parameters
    ----------
    row, column : float
        Where the strip's first pixel lies on the strip before, to a few pixels.
    widths : sequence of float
        Of the smoothing in turn, 1 sigma, px: `ROUGHLY` to be drawn in, then `FINELY`.
    turn : float
        rad.

    Returns
    -------
    Alignment
    """
    import scipy.ndimage

    images: Any = scipy.ndimage
    overlap = min(before.rows - round(row), strip.rows)
    first = max(0, (overlap - _ROWS) // 2)
    rows, columns = min(_ROWS, overlap), strip.columns
    new = _levelled(strip.read(first, first + rows))
    start = max(0, round(row) + first - 16)
    old = _levelled(before.read(start, min(before.rows, round(row) + first + rows + 16)))
    down, across = np.mgrid[8 : rows - 8 : 2, 8 : columns - 8 : 2].astype(np.float64)
    match = 0.0
    middle_row, middle_column = 0.5 * rows, 0.5 * columns
    # of the compared part's own frame, turning about its middle
    shift_row = row + first - start + turn * middle_column
    shift_column = column - turn * (middle_row + first)
    for width in widths:
        smooth = images.gaussian_filter(old, width)
        slope_down, slope_across = np.gradient(smooth)
        wanted = images.gaussian_filter(new, width)[8 : rows - 8 : 2, 8 : columns - 8 : 2]
        for _ in range(_STEPS):
            about_row, about_column = down - middle_row, across - middle_column
            at = np.stack([down + shift_row + turn * about_column, across + shift_column - turn * about_row])
            inside = (at[0] >= 0) & (at[0] <= old.shape[0] - 1) & (at[1] >= 0) & (at[1] <= old.shape[1] - 1)
            found, by_row, by_column = (
                images.map_coordinates(each, at[:, inside], order=1, mode="nearest")
                for each in (smooth, slope_down, slope_across)
            )
            if found.size < 100:  # drawn away from the overlap: no match
                return Alignment(row, column, 0.0, 0.0)
            match = float(np.corrcoef(found, wanted[inside])[0, 1])
            by_turn = by_row * about_column[inside] - by_column * about_row[inside]
            design = np.stack([by_row, by_column, by_turn])
            gram = design @ design.T
            step = np.linalg.lstsq(gram, design @ (wanted[inside] - found), rcond=1e-10)[0]
            shift_row, shift_column, turn = shift_row + step[0], shift_column + step[1], turn + step[2]
            if np.abs(step * (1.0, 1.0, max(rows, columns))).max() < _SETTLED:
                break
    # from turning about the middle of the compared part to turning about the strip's first pixel
    return Alignment(
        float(shift_row + start - first - turn * middle_column),
        float(shift_column + turn * (middle_row + first)),
        float(turn),
        match,
    )


def _levelled(pixels: NDArray[np.generic]) -> Grey:
    """Pixels less the level of their columns, in units of their spread."""
    grey = pixels.astype(np.float64)
    grey -= np.median(grey, axis=0)
    return np.asarray(grey / max(float(grey.std()), 1e-9))
