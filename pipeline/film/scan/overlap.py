"""Where one strip of a film lies on the strip before it: the same lines and the same grain, found by correlation.

Swings look alike: a strip laid one swing too far fits almost as well. Places that fit over the whole overlap that
they imply are tried pixel by pixel, and the best must be better than all others by far.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.film.scan.image import Image

Grey = NDArray[np.float32]

_DOWN, _ACROSS = 2, 6  # pixels to a bin of the search
_TEMPLATE = 96  # bins of rows that are searched for
_TEMPLATES = 4  # at so many places of the strip's beginning
_LONGEST = 8192  # rows of overlap that are looked for
_CANDIDATES = 24
_TRIED = 16  # of them, aligned roughly
_FINAL = 3  # of those, aligned finely
LEAST_MATCH = 0.9  # correlation of the aligned grey values
_LEAST_LEAD = 2.5  # by which the second best must be further from a perfect match than the best
_NEAR = 6  # bins of rows that count as the same place
Grey64 = NDArray[np.float64]

_ROWS = 720  # of the overlap that are compared
_STEPS = 12
_SETTLED = 1e-4  # px
ROUGHLY, FINELY = (4.0,), (2.0, 1.0)  # 1 sigma of the smoothing, px: wide first, to draw in from the search's bins


@dataclass(frozen=True)
class Placement:
    """Where a strip lies on the one before: its pixel (r, c) falls on (row + r cos + c sin, column + c cos - r sin).

    Attributes
    ----------
    row, column : float
        Of the strip's first pixel, px of the strip before.
    turn : float
        Angle of that cos and sin, rad.
    match : float
        Correlation of the grey values where they overlap, 1 at best.
    second : float
        Of the best other place.
    """

    row: float
    column: float
    turn: float
    match: float
    second: float

    @property
    def is_certain(self) -> bool:
        """Whether the strips match here and nowhere else."""
        return self.match >= LEAST_MATCH and 1.0 - self.second >= _LEAST_LEAD * (1.0 - self.match)


def place(before: Image, strip: Image) -> Placement | None:
    """Find where a strip's beginning lies on the end of the strip before; None if nothing fits at all."""
    length = min(_LONGEST, before.rows, strip.rows)
    first = before.rows - length
    old, new = _binned(before, first, before.rows), _binned(strip, 0, length)
    width = min(old.shape[1], new.shape[1])
    old, new = old[:, :width], new[:, :width]
    judged = sorted(((_match(old, new, *shift), shift) for shift in _candidates(old, new)), reverse=True)
    if not judged or judged[0][0] <= 0.0:
        return None

    rows: list[int] = []
    tried: list[Alignment] = []
    for _, (down, across) in judged:
        if len(tried) < _TRIED and all(abs(down - other) > _NEAR for other in rows):
            rows.append(down)
            tried.append(align(before, strip, float(first + down * _DOWN), float(across * _ACROSS), ROUGHLY))
    tried.sort(key=lambda found: -found.match)
    fine = [align(before, strip, found.row, found.column, FINELY, found.turn) for found in tried[:_FINAL]]
    best, *others = sorted(fine, key=lambda found: -found.match)
    second = max((found.match for found in others), default=0.0)
    return Placement(best.row, best.column, best.turn, best.match, second)


def _binned(image: Image, first: int, stop: int) -> Grey:
    """Departures from the local level in bins, in units of their own spread."""
    rows, columns = (stop - first) // _DOWN, image.columns // _ACROSS
    bins = np.empty((rows, columns), dtype=np.float32)
    step = 512
    for a in range(0, rows, step):
        b = min(rows, a + step)
        pixels = image.read(first + a * _DOWN, first + b * _DOWN)[:, : columns * _ACROSS]
        bins[a:b] = pixels.reshape(b - a, _DOWN, columns, _ACROSS).mean(axis=(1, 3), dtype=np.float32)
        bins[a:b] -= np.median(bins[a:b], axis=0)
    return bins / max(float(bins.std()), 1e-6)


def _candidates(old: Grey, new: Grey) -> set[tuple[int, int]]:
    """Shifts (down, across), in bins, at which some part of the strip's beginning fits well."""
    found: set[tuple[int, int]] = set()
    height = min(_TEMPLATE, new.shape[0])
    across = max(1, new.shape[1] // 8)
    for start in range(0, min(_TEMPLATES * height, new.shape[0] - height + 1), height):
        surface = _correlation(old, new[start : start + height])
        near = np.concatenate([surface[:, -across:], surface[:, : across + 1]], axis=1)
        best = near.max(axis=1)
        for _ in range(_CANDIDATES):
            row = int(np.argmax(best))
            if best[row] <= 0.0:
                break
            found.add((row - start, int(np.argmax(near[row])) - across))
            best[max(0, row - _NEAR) : row + _NEAR + 1] = 0.0
    return {(down, sideways) for down, sideways in found if 0 <= down < old.shape[0] - height // 2}


def _correlation(old: Grey, template: Grey) -> Grey:
    """Correlation of a template with all places of `old`, (rows, columns of shift; negative ones at the end)."""
    rows = old.shape[0] + template.shape[0]
    columns = 2 * old.shape[1]
    product = np.fft.rfft2(old, (rows, columns)) * np.conj(np.fft.rfft2(template, (rows, columns)))
    return np.asarray(np.fft.irfft2(product, (rows, columns))[: old.shape[0]], dtype=np.float32)


def _match(old: Grey, new: Grey, down: int, across: int) -> float:
    """Correlation over the whole overlap of a shift."""
    rows, columns = min(old.shape[0] - down, new.shape[0]), old.shape[1] - abs(across)
    one = old[down : down + rows, max(0, across) : max(0, across) + columns]
    other = new[:rows, max(0, -across) : max(0, -across) + columns]
    norm = float(np.sqrt(np.sum(one * one, dtype=np.float64) * np.sum(other * other, dtype=np.float64)))
    return float(np.sum(one * other, dtype=np.float64)) / norm if norm > 0.0 else 0.0


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


def _levelled(pixels: NDArray[np.generic]) -> Grey64:
    """Pixels less the level of their columns, in units of their spread."""
    grey = pixels.astype(np.float64)
    grey -= np.median(grey, axis=0)
    return np.asarray(grey / max(float(grey.std()), 1e-9))
