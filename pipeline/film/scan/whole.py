"""PNG, JPEG, and TIFF of rare compression: decoded whole by Pillow, if they are not too large for that."""

from __future__ import annotations

import contextlib
import importlib
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from data_schemas.errors import FileError
from pipeline.film.scan.image import MOST_BYTES_AT_ONCE, ImageFile, Pixels, refuse_absurd_size, to_grey

_ORIENTATION = 274  # tag of TIFF and EXIF
_BYTES = {"1": 1, "L": 1, "LA": 4, "P": 4, "PA": 4, "RGB": 4, "RGBA": 4, "YCbCr": 4, "CMYK": 4, "I;16": 2, "I": 4}
_SLAB = 1024  # rows turned to grey at a time


@dataclass
class WholeImage(ImageFile):
    """An image in memory."""

    path: Path
    pixels: Pixels
    resolution: tuple[float, float] | None
    upright: int

    def __post_init__(self) -> None:
        self.rows, self.columns = self.pixels.shape
        self.full_scale = 255 if self.pixels.dtype == np.uint8 else 65535

    def read(self, first: int, stop: int) -> Pixels:
        """Rows `first` to `stop`."""
        return self.pixels[first:stop]


def open_whole(path: Path, kind: str) -> WholeImage:
    """Decode an image file.

    Parameters
    ----------
    path : Path
    kind : {"PNG", "JPEG", "TIFF"}
        Told by the caller: Pillow's guess would try every format it knows.

    Raises
    ------
    FileError
        The file is damaged, of an unknown mode, or too large to be decoded whole.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what matters of a damaged file is raised
            with contextlib.closing(_opener(kind)(str(path))) as image:
                columns, rows = image.size
                refuse_absurd_size(path, rows, columns)
                _refuse_too_large(path, kind, rows, columns, image.mode)
                upright = int(image.getexif().get(_ORIENTATION, 1))
                resolution = _resolution(image.info.get("dpi"))
                return WholeImage(path, _grey(image), resolution, upright if 1 <= upright <= 8 else 1)
    except FileError:
        raise
    except MemoryError as fault:
        raise FileError(f"{path}: does not fit into memory; save it as TIFF in strips") from fault
    except Exception as fault:  # Pillow's decoders raise whatever their bytes lead to
        said = " ".join(str(fault).split())[:120] or type(fault).__name__
        raise FileError(f"{path}: damaged or unusual {kind} ({said}); scan or save it again") from fault


def _opener(kind: str) -> Any:
    """The reader of one format: Pillow's general one refuses large images, which films are, by a global limit."""
    name = {"PNG": "Png", "JPEG": "Jpeg", "TIFF": "Tiff"}[kind]
    return getattr(importlib.import_module(f"PIL.{name}ImagePlugin"), f"{name}ImageFile")


def _refuse_too_large(path: Path, kind: str, rows: int, columns: int, mode: str) -> None:
    if mode not in _BYTES:
        raise FileError(f"{path}: pixels of the kind {mode} are not known; save it as 8 or 16 bit grey")
    if rows * columns * _BYTES[mode] > MOST_BYTES_AT_ONCE:
        raise FileError(
            f"{path}: {columns} x {rows} pixels are too many for {kind}, which can only be decoded whole; "
            "save it as TIFF in strips, or cut it and add --strips"
        )


def _grey(image: Any) -> Pixels:
    """Grey pixels, the larger kinds a slab of rows at a time."""
    image.load()
    if image.mode in ("P", "PA", "1", "CMYK", "YCbCr"):
        image = image.convert("L" if image.mode == "1" else "RGB")
    if image.mode in ("L", "I;16"):
        return np.array(image)
    columns, rows = image.size
    kind = np.uint16 if image.mode == "I" else np.uint8
    grey = np.empty((rows, columns), dtype=kind)
    for first in range(0, rows, _SLAB):
        stop = min(rows, first + _SLAB)
        slab = np.asarray(image.crop((0, first, columns, stop)))
        grey[first:stop] = to_grey(np.clip(slab, 0, 65535).astype(np.uint16) if image.mode == "I" else slab)
    return grey


def _resolution(stated: Any) -> tuple[float, float] | None:
    """Pixels per inch down and across from Pillow's pair across and down."""
    if not isinstance(stated, tuple) or len(stated) != 2:
        return None
    try:
        across, down = (float(value) for value in stated)
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    return down, across
