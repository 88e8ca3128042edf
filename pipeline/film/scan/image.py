"""What every kind of image file gives: its size, what its tags say, and its rows in grey."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import FileError

Pixels = NDArray[Any]  # uint8 or uint16, (rows, columns)

MOST_PIXELS = 2**36
MOST_BYTES_AT_ONCE = 2**29  # of a file that can only be decoded whole


class Image(ABC):
    """Rows of an image in grey, before it is turned.

    Attributes
    ----------
    rows, columns : int
        Size, px.
    full_scale : int
        Value of the lightest pixel: 255 or 65535.
    """

    rows: int
    columns: int
    full_scale: int

    @abstractmethod
    def read(self, first: int, stop: int) -> Pixels:
        """Rows `first` to `stop`."""


class ImageFile(Image):
    """An image file.

    Attributes
    ----------
    path : Path
    resolution : (2,) tuple or None
        Pixels per inch down and across, as the file's tags say.
    upright : int
        The orientation of TIFF and EXIF, 1 to 8: how the stored rows lie in the picture.
    """

    path: Path
    resolution: tuple[float, float] | None
    upright: int


@dataclass
class View(Image):
    """An image seen through something that keeps its size and its white; `read` is the heir's."""

    image: Image

    def __post_init__(self) -> None:
        self.rows, self.columns, self.full_scale = self.image.rows, self.image.columns, self.image.full_scale


def refuse_absurd_size(path: Path, rows: int, columns: int) -> None:
    """Raise `FileError` for an image without pixels, too narrow for a film, or larger than any scan."""
    if rows < 1 or columns < 1:
        raise FileError(f"{path}: the image has {rows} rows of {columns} pixels; scan the film again")
    if min(rows, columns) < 16:
        raise FileError(f"{path}: {columns} x {rows} pixels hold no film; at least 16 across are needed")
    if rows * columns > MOST_PIXELS:
        raise FileError(f"{path}: says to have {columns} x {rows} pixels, more than any scan of a film; save it anew")


def to_grey(pixels: Pixels) -> Pixels:
    """Grey of (rows, columns) or (rows, columns, channels): luma of ITU-R BT.601 in whole numbers; alpha is left out.

    >>> to_grey(np.array([[[255, 255, 255], [0, 0, 0]]], dtype=np.uint8)).tolist()
    [[255, 0]]
    """
    if pixels.ndim == 2:
        return pixels
    if pixels.shape[2] < 3:
        return np.ascontiguousarray(pixels[:, :, 0])
    luma = np.full(pixels.shape[:2], 32768, dtype=np.uint32)  # 65535 * 65536 + 32768 fits
    for channel, weight in enumerate((19595, 38470, 7471)):  # of 65536
        luma += pixels[:, :, channel] * np.uint32(weight)
    return np.asarray(luma >> np.uint32(16), dtype=pixels.dtype)
