"""Where a TIFF keeps its pixels: its tags, read by tifffile and believed only after a check against the file."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from data_schemas.errors import FileError
from pipeline.film.scan.image import MOST_BYTES_AT_ONCE

NO_COMPRESSION, DEFLATE, DEFLATE_OLD = 1, 8, 32946
_WHITE_IS_ZERO, _BLACK_IS_ZERO, _RGB = 0, 1, 2
_PER_INCH = {2: 1.0, 3: 2.54}  # ResolutionUnit: inch, cm
_MOST_INFLATION = 1032  # of deflate, by its format


@dataclass(frozen=True)
class TiffLayout:
    """Layout of one image of a TIFF; strips are tiles as wide as the image.

    Attributes
    ----------
    rows, columns, samples : int
        Size; samples are channels.
    dtype : dtype
        Of a sample, in the file's byte order.
    segment_rows, segment_columns : int
        Size of a strip or tile.
    offsets, sizes : tuple of int
        Where each lies in the file, bytes.
    is_tiled, is_planar, is_white_zero : bool
        Tiles are stored whole also at the edges; planar keeps each channel in segments of its own.
    compression, predictor : int
        Codes of TIFF.
    photometric : int
        Code of TIFF.
    resolution : (2,) tuple or None
        Pixels per inch down and across.
    upright : int
        Orientation of TIFF, 1 to 8.
    """

    rows: int
    columns: int
    samples: int
    dtype: np.dtype[Any]
    segment_rows: int
    segment_columns: int
    offsets: tuple[int, ...]
    sizes: tuple[int, ...]
    is_tiled: bool
    is_planar: bool
    photometric: int
    compression: int
    predictor: int
    resolution: tuple[float, float] | None
    upright: int

    @property
    def is_white_zero(self) -> bool:
        """Whether 0 is white."""
        return self.photometric == _WHITE_IS_ZERO

    @property
    def segments_down(self) -> int:
        """Strips, or rows of tiles."""
        return -(-self.rows // self.segment_rows)

    @property
    def segments_across(self) -> int:
        """Tiles side by side."""
        return -(-self.columns // self.segment_columns)

    @property
    def segment_bytes(self) -> int:
        """Bytes of a whole segment when decoded."""
        return self.segment_rows * self.segment_columns * (1 if self.is_planar else self.samples) * self.dtype.itemsize

    @property
    def is_plain(self) -> bool:
        """Whether the rows simply follow each other in the file."""
        if self.compression != NO_COMPRESSION or self.is_tiled or (self.is_planar and self.samples > 1):
            return False
        return all(a + n == b for a, n, b in zip(self.offsets, self.sizes, self.offsets[1:], strict=False))

    def check(self, path: Path) -> None:
        """Raise `FileError` where the tags contradict each other or the file's length."""
        planes = self.samples if self.is_planar else 1
        count = planes * self.segments_down * self.segments_across
        if not len(self.offsets) == len(self.sizes) == count:
            raise FileError(f"{path}: lists {len(self.offsets)} of {count} strips or tiles; save it again")
        length = path.stat().st_size
        last = max(offset + size for offset, size in zip(self.offsets, self.sizes, strict=True))
        if last > length or min(self.offsets) < 8:
            raise FileError(f"{path}: has {length} of {last} bytes; it was cut off, copy it again")
        if sum(self.sizes) > length:
            raise FileError(f"{path}: its strips or tiles overlap in the file; save it again")
        needed = self.rows * self.columns * self.samples * self.dtype.itemsize
        if needed > sum(self.sizes) * (1 if self.compression == NO_COMPRESSION else _MOST_INFLATION):
            raise FileError(f"{path}: holds too few bytes for {self.columns} x {self.rows} pixels; save it again")
        if self.segment_bytes * self.segments_across > MOST_BYTES_AT_ONCE and not self.is_plain:
            raise FileError(f"{path}: its strips or tiles are too large to be decoded; save it with 1024 rows a strip")


def is_streamable(layout: TiffLayout) -> bool:
    """Whether `tiff` can decode the file piece by piece; Pillow takes the others whole, if they are small."""
    return layout.photometric in (_WHITE_IS_ZERO, _BLACK_IS_ZERO, _RGB) and layout.compression in (
        NO_COMPRESSION,
        DEFLATE,
        DEFLATE_OLD,
    )


def read_layout(path: Path) -> TiffLayout:
    """Tags of the first image of a TIFF.

    Raises
    ------
    FileError
        They cannot be read, or the pixels are no whole numbers of 8 or 16 bits, or there are several images.
    """
    import tifffile

    logging.getLogger("tifffile").setLevel(logging.CRITICAL)  # what matters is raised here, in one line
    try:
        with tifffile.TiffFile(path) as tiff:
            page: Any = tiff.pages[0]
            layout = _layout(page, tiff.byteorder)
            several = _second_image(tiff, page)
            bits, kind = page.bitspersample, page.sampleformat
    except FileError:
        raise
    except Exception as fault:  # tifffile raises whatever the bytes lead to
        said = " ".join(str(fault).split())[:120] or type(fault).__name__
        raise FileError(f"{path}: damaged TIFF ({said}); copy or scan it again") from fault
    if bits not in (8, 16) or kind != 1:
        kinds = {1: "whole numbers", 2: "signed numbers", 3: "floating point"}
        raise FileError(f"{path}: pixels are {kinds.get(kind, 'data')} of {bits} bits; save it as 8 or 16 bit grey")
    if several:
        raise FileError(f"{path}: holds several images; save each strip of film to a file, and add --strips")
    return layout


def _layout(page: Any, byteorder: str) -> TiffLayout:
    rows, columns = int(page.imagelength), int(page.imagewidth)
    tiled = bool(page.is_tiled)
    height = int(page.tilelength) if tiled else min(int(page.rowsperstrip or rows), rows)
    return TiffLayout(
        rows=rows,
        columns=columns,
        samples=int(page.samplesperpixel),
        dtype=np.dtype(f"{byteorder}u{max(1, int(page.bitspersample) // 8)}"),
        segment_rows=max(1, height),
        segment_columns=max(1, int(page.tilewidth) if tiled else columns),
        offsets=tuple(int(value) for value in page.dataoffsets),
        sizes=tuple(int(value) for value in page.databytecounts),
        is_tiled=tiled,
        is_planar=int(page.planarconfig) == 2 and int(page.samplesperpixel) > 1,
        photometric=int(page.photometric),
        compression=int(page.compression),
        predictor=int(page.predictor),
        resolution=_resolution(page),
        upright=_whole(page, "Orientation", 1, range(1, 9)),
    )


def _second_image(tiff: Any, page: Any) -> bool:
    """Whether there is a second image of the film's width: thumbnails do not count."""
    try:
        second = tiff.pages[1]
    except IndexError:
        return False
    return bool(second.imagewidth == page.imagewidth and second.imagelength >= 16)


def _resolution(page: Any) -> tuple[float, float] | None:
    factor = _PER_INCH.get(_whole(page, "ResolutionUnit", 2, range(1, 4)))
    values = [page.tags.valueof(name) for name in ("YResolution", "XResolution")]
    if factor is None or any(not isinstance(value, tuple) or len(value) != 2 or not value[1] for value in values):
        return None
    down, across = (factor * float(value[0]) / float(value[1]) for value in values)
    return down, across


def _whole(page: Any, name: str, default: int, allowed: range) -> int:
    value = page.tags.valueof(name, default=default)
    return int(value) if isinstance(value, int) and int(value) in allowed else default
