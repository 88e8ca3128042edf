"""From places on the film, mm, to pixels of the image, and back."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from data_schemas.errors import UsageError
from data_schemas.scene_film import Film
from synth.phase import Floats

INCH = 25.4  # mm
_WIDEST = 4.0  # times the paper: a canvas wider than that is mostly empty
_MOST_ROWS = 2**31 - 1


@dataclass(frozen=True)
class Geometry:
    """The affine map from along and across the film, mm, to row and column, px; pixel i has its centre at i + 0.5.

    Attributes
    ----------
    rows, columns : int
        Of the image.
    row, column : (constant, per mm along, per mm across)
    turn : float
        Rotation of the paper, rad.
    corner : (row, column)
        Of the paper's corner where along and left edge begin, px.
    length, width : float
        Of the paper, px.
    pixels : float
        Pixels to the millimetre of the scan.
    """

    rows: int
    columns: int
    row: tuple[float, float, float]
    column: tuple[float, float, float]
    turn: float
    corner: tuple[float, float]
    length: float
    width: float
    pixels: float

    def rows_of(self, along: Floats, across: Floats) -> Floats:
        """Row of places, px."""
        return self.row[0] + self.row[1] * along + self.row[2] * across

    def columns_of(self, along: Floats, across: Floats) -> Floats:
        """Column of places, px."""
        return self.column[0] + self.column[1] * along + self.column[2] * across

    def row_at_left(self, along: Floats) -> Floats:
        """Row at the image's column 0 of the line that is lit at once, px."""
        across = -(self.column[0] + self.column[1] * along) / self.column[2]
        return self.rows_of(along, across)

    def along_at_left(self, row: Floats) -> Floats:
        """Inverse of `row_at_left`, mm."""
        slant = self.row[2] / self.column[2]
        return (row - self.row[0] + slant * self.column[0]) / (self.row[1] - slant * self.column[1])

    def paper_edges(self, first: int, stop: int) -> tuple[Floats, Floats]:
        """First and last column of the paper in each row, at its centre line, (rows,) px; equal where there is none."""
        down = np.arange(first, stop, dtype=np.float64) + 0.5 - self.corner[0]
        cosine, sine = math.cos(self.turn), math.sin(self.turn)
        left, right = down * sine / cosine, (down * sine + self.width) / cosine  # the long edges
        if self.turn:
            ends = (0.0, self.length) if self.turn > 0.0 else (self.length, 0.0)
            left = np.maximum(left, (ends[0] - down * cosine) / sine)
            right = np.minimum(right, (ends[1] - down * cosine) / sine)
        else:
            right = np.where((down >= 0.0) & (down < self.length), right, left)
        right = np.maximum(right, left)
        shift = self.corner[1]
        edges: tuple[Floats, Floats] = (left + shift, right + shift)
        return edges


def geometry_of(film: Film, travel: float, offsets: Floats) -> Geometry:
    """Lay a film of some travel, mm, out on the scanner.

    Raises
    ------
    UsageError
        The paper lies so crooked that the image would be mostly empty, or the image would have too many rows.
    """
    pixels = film.dpi / INCH
    along, across = pixels * (1.0 + film.stretch_along), pixels * (1.0 + film.stretch_across)
    width = film.paper_width * across
    lean, turn = math.tan(math.radians(film.skew)), math.radians(film.rotation)
    before = (film.margin - min(0.0, float(np.min(offsets)))) * along - min(0.0, lean * width)
    after = (film.margin + max(0.0, float(np.max(offsets)))) * along + max(0.0, lean * width)
    length = before + travel * along + after
    cosine, sine = math.cos(turn), math.sin(turn)
    columns = round(width * cosine + length * abs(sine))
    rows = round(length * cosine + width * abs(sine))
    if columns > _WIDEST * width and film.rotation:
        raise UsageError(
            f"film.rotation = {film.rotation:g} degrees would spread a film of {length / pixels / 1000:.3g} m over"
            f" {columns} columns; give less than {math.degrees((_WIDEST - 1) * width / length):.2g} degrees"
        )
    if rows > _MOST_ROWS:
        raise UsageError(f"film: the image would have {rows} rows; make the record shorter, or speed or dpi smaller")
    corner = (max(0.0, sine) * width, max(0.0, -sine) * length)
    # on the paper: down = before + along * s + lean * (across * u), right = across * u; then turned
    down, right = (before, along, lean * across), (0.0, 0.0, across)
    row = tuple(a * cosine - b * sine for a, b in zip(down, right, strict=True))
    column = tuple(b * cosine + a * sine for a, b in zip(down, right, strict=True))
    return Geometry(
        max(rows, 1), max(columns, 1), (row[0] + corner[0], row[1], row[2]),
        (column[0] + corner[1], column[1], column[2]), turn, corner, length, width, pixels,
    )  # fmt: skip
