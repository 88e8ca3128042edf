"""The image turned so that time runs downwards; a film that lies across its strips is laid aside piece by piece."""

from __future__ import annotations

import os
import tempfile
import weakref
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np

from data_schemas.errors import FileError
from pipeline.film.scan.image import Image, Pixels, View

_SLAB = 2**22  # bytes copied at a time


@dataclass(frozen=True)
class Turn:
    """Rows and columns exchanged, then either turned round.

    >>> Turn(True, False, True).then(Turn(True, False, True)) == Turn(False, True, True)
    True
    """

    transposed: bool = False
    rows_reversed: bool = False
    columns_reversed: bool = False

    def then(self, other: Turn) -> Turn:
        """This turn and after it another."""
        rows, columns = self.rows_reversed, self.columns_reversed
        if other.transposed:
            rows, columns = columns, rows
        return Turn(self.transposed != other.transposed, rows != other.rows_reversed, columns != other.columns_reversed)


CLOCKWISE = {
    0: Turn(),
    90: Turn(True, False, True),
    180: Turn(False, True, True),
    270: Turn(True, True, False),
}
"""Turns by degrees."""

UPRIGHT = {
    1: Turn(),
    2: Turn(False, False, True),
    3: Turn(False, True, True),
    4: Turn(False, True, False),
    5: Turn(True, False, False),
    6: Turn(True, False, True),
    7: Turn(True, True, True),
    8: Turn(True, True, False),
}
"""What sets the rows of a file upright, by the orientation of TIFF and EXIF."""


@dataclass
class Turned(View):
    """An image seen with its rows, or columns, the other way round."""

    rows_reversed: bool
    columns_reversed: bool

    def read(self, first: int, stop: int) -> Pixels:
        """Rows `first` to `stop`."""
        if self.rows_reversed:
            pixels = self.image.read(self.rows - stop, self.rows - first)[::-1]
        else:
            pixels = self.image.read(first, stop)
        return np.ascontiguousarray(pixels[:, ::-1] if self.columns_reversed else pixels)


class Transposed(Image):
    """An image whose columns have become rows, kept in a temporary file that goes with the process.

    The file holds slabs of rows one after the other, each transposed: it is written in order, and a row of the result
    lies in as many pieces as there are slabs.
    """

    def __init__(self, image: Image) -> None:
        self.rows, self.columns, self.full_scale = image.columns, image.rows, image.full_scale
        self._type = np.dtype(np.uint8 if image.full_scale == 255 else np.uint16)
        self._slab = max(16, _SLAB // (image.columns * self._type.itemsize))
        try:
            self._file: BinaryIO = tempfile.TemporaryFile(prefix="isochrony-")  # noqa: SIM115
            weakref.finalize(self, self._file.close)
            for first in range(0, image.rows, self._slab):
                self._file.write(image.read(first, min(image.rows, first + self._slab)).T.tobytes())
            self._file.flush()
        except OSError as fault:
            raise FileError(
                f"{tempfile.gettempdir()}: no room to turn the image ({fault.strerror}); set TMPDIR to another folder, "
                "or turn it beforehand so that the film runs down"
            ) from fault

    def read(self, first: int, stop: int) -> Pixels:
        """Rows `first` to `stop`."""
        pixels = np.empty((stop - first, self.columns), dtype=self._type)
        for left in range(0, self.columns, self._slab):
            width = min(self._slab, self.columns - left)
            place = (left * self.rows + first * width) * self._type.itemsize
            data = os.pread(self._file.fileno(), (stop - first) * width * self._type.itemsize, place)
            pixels[:, left : left + width] = np.frombuffer(data, self._type).reshape(stop - first, width)
        return pixels


def turned(image: Image, turn: Turn) -> Image:
    """The image after a turn."""
    if turn.transposed:
        image = Transposed(image)
    if turn.rows_reversed or turn.columns_reversed:
        image = Turned(image, turn.rows_reversed, turn.columns_reversed)
    return image
