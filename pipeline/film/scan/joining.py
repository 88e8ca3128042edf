"""Overlapping strips of one film as one image, each turned and shifted onto the first."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from data_schemas.errors import FileError
from pipeline.film.scan.image import Image, Pixels
from pipeline.film.scan.overlap import LEAST_MATCH, place
from synth.kernels.compiled import kernel

_EXACT = 0.02  # px: a placement this close to whole pixels is taken for them
_MARGIN = 3  # rows that cubic convolution reaches beyond
_SLAB = 1024  # rows resampled at a time


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


@dataclass(frozen=True)
class Part:
    """A strip in the frame of the first strip, which is the film's.

    Attributes
    ----------
    image : Image
    row, column, turn : float
        Where its first pixel lies, px, and how it is turned, rad (see `Placement`).
    first : int
        Row of the film from which on this strip is read.
    """

    image: Image
    row: float
    column: float
    turn: float
    first: int

    @property
    def is_exact(self) -> bool:
        """Whether the strip lies on whole pixels."""
        off = max(abs(self.row - round(self.row)), abs(self.column - round(self.column)))
        return off + abs(self.turn) * max(self.image.rows, self.image.columns) < _EXACT


@dataclass
class Joined(Image):
    """Strips as one image, as wide as the first."""

    parts: tuple[Part, ...]
    rows: int

    def __post_init__(self) -> None:
        self.columns, self.full_scale = self.parts[0].image.columns, self.parts[0].image.full_scale

    def read(self, first: int, stop: int) -> Pixels:
        """Rows `first` to `stop`."""
        pixels = np.empty((stop - first, self.columns), dtype=np.uint8 if self.full_scale == 255 else np.uint16)
        ends = [*(part.first for part in self.parts[1:]), self.rows]
        for part, end in zip(self.parts, ends, strict=True):
            for a in range(max(first, part.first), min(stop, end), _SLAB):
                b = min(a + _SLAB, stop, end)
                _fill(part, a, pixels[a - first : b - first])
        return pixels


def join(images: Sequence[Image], paths: Sequence[Path]) -> Joined:
    """Lay strips on each other.

    Raises
    ------
    FileError
        Two strips do not overlap, or not certainly at one place only.
    """
    if len({image.full_scale for image in images}) > 1:
        raise FileError(f"{paths[0]}: the strips have 8 and 16 bits; save them alike")
    parts = [Part(images[0], 0.0, 0.0, 0.0, 0)]
    for number in range(1, len(images)):
        found = place(images[number - 1], images[number])
        if found is None or not found.is_certain:
            why = (
                "no overlap found"
                if found is None or found.match < LEAST_MATCH
                else "the overlap fits at several places"
            )
            raise FileError(
                f"{paths[number]}: {why} with the end of {paths[number - 1].name}; give the strips in the order of "
                "time, each overlapping the one before by some 200 rows or more"
            )
        before = parts[-1]
        cosine, sine = math.cos(before.turn), math.sin(before.turn)
        row = before.row + found.row * cosine + found.column * sine
        column = before.column + found.column * cosine - found.row * sine
        seam = math.ceil(0.5 * (row + before.row + before.image.rows))
        parts.append(Part(images[number], row, column, before.turn + found.turn, max(before.first + 1, seam)))
    last = parts[-1]
    end = last.row + last.image.rows
    drop = min(0.0, last.turn * parts[0].image.columns)
    return Joined(tuple(parts), round(end) if last.is_exact else math.floor(end + drop))


def _fill(part: Part, first: int, wanted: Pixels) -> None:
    """Rows of the film from `first` on, from one strip."""
    cosine, sine = math.cos(part.turn), math.sin(part.turn)
    # the film's (first, 0) in the strip
    row = (first - part.row) * cosine + part.column * sine
    column = (first - part.row) * sine - part.column * cosine
    tilt = abs(part.turn) * wanted.shape[1]
    low = max(0, math.floor(row - tilt) - _MARGIN)
    high = min(part.image.rows, math.ceil(row + wanted.shape[0] + tilt) + _MARGIN)
    low = min(low, part.image.rows - 1)
    source = part.image.read(low, max(high, low + 1))
    if not part.is_exact:
        resample(source, wanted, row - low, column, cosine, sine, float(part.image.full_scale))
        return
    down = np.clip(np.arange(wanted.shape[0]) + round(row) - low, 0, source.shape[0] - 1)
    across = np.clip(np.arange(wanted.shape[1]) + round(column), 0, source.shape[1] - 1)
    wanted[:] = source[np.ix_(down, across)]
