"""TIFF and BigTIFF, decoded a strip or a row of tiles at a time.

Where the pixels are kept is read by tifffile, and believed only after a check against the file.
"""

from __future__ import annotations

import logging
import os
import zlib
from collections import OrderedDict
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from data_schemas.errors import FileError
from pipeline.film.scan.image import MOST_BYTES_AT_ONCE, ImageFile, Pixels, refuse_absurd_size, to_grey

_HORIZONTAL = 2  # differences along the rows
_NO_COMPRESSION, _DEFLATE, _DEFLATE_OLD = 1, 8, 32946
_WHITE_IS_ZERO, _BLACK_IS_ZERO, _RGB = 0, 1, 2
_PER_INCH = {2: 1.0, 3: 2.54}  # ResolutionUnit: inch, cm
_MOST_INFLATION = 1032  # of deflate, by its format
_KEPT = 16 * 2**20  # bytes of decoded bands
_SLAB = 2**22  # bytes read at once of a file without compression


def open_tiff(path: Path) -> ImageFile:
    """Open a TIFF; what `TiffImage` cannot decode piece by piece Pillow takes whole, if it is small.

    Raises
    ------
    FileError
        The file is damaged, or of a kind that is not known: the pixels are no whole numbers of 8 or 16 bits, or there
        are several images.
    """
    import tifffile

    logging.getLogger("tifffile").setLevel(logging.CRITICAL)  # what matters is raised here, in one line
    try:
        with tifffile.TiffFile(path) as tiff:
            page: Any = tiff.pages[0]
            image = _described(path, page, tiff.byteorder)
            several = _second_image(tiff, page)
            bits, kind = page.bitspersample, page.sampleformat
    except Exception as fault:  # tifffile raises whatever the bytes lead to
        said = " ".join(str(fault).split())[:120] or type(fault).__name__
        raise FileError(f"{path}: damaged TIFF ({said}); copy or scan it again") from fault
    if bits not in (8, 16) or kind != 1:
        kinds = {1: "whole numbers", 2: "signed numbers", 3: "floating point"}
        raise FileError(f"{path}: pixels are {kinds.get(kind, 'data')} of {bits} bits; save it as 8 or 16 bit grey")
    if several:
        raise FileError(f"{path}: holds several images; save each strip of film to a file, and add --strips")
    refuse_absurd_size(path, image.rows, image.columns)
    is_known = image.compression in (_NO_COMPRESSION, _DEFLATE, _DEFLATE_OLD)
    if not is_known or image.photometric not in (_WHITE_IS_ZERO, _BLACK_IS_ZERO, _RGB):
        from pipeline.film.scan.whole import open_whole

        return open_whole(path, "TIFF")
    image.check()
    return image


def _described(path: Path, page: Any, byteorder: str) -> TiffImage:
    """What the tags of a page say."""
    rows, columns = int(page.imagelength), int(page.imagewidth)
    tiled = bool(page.is_tiled)
    height = int(page.tilelength) if tiled else min(int(page.rowsperstrip or rows), rows)
    return TiffImage(
        path=path,
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


@dataclass
class TiffImage(ImageFile):
    """A TIFF on the disk; nothing of it is held but the bands of rows last decoded.

    Strips are tiles as wide as the image. Any number of threads may read.

    Attributes
    ----------
    samples : int
        Channels of a pixel.
    dtype : dtype
        Of a sample, in the file's byte order.
    segment_rows, segment_columns : int
        Size of a strip or tile.
    offsets, sizes : tuple of int
        Where each lies in the file, bytes.
    is_tiled, is_planar : bool
        Tiles are stored whole also at the edges; planar keeps each channel in segments of its own.
    photometric, compression, predictor : int
        Codes of TIFF.
    """

    path: Path
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
    _bands: OrderedDict[int, Pixels] = field(default_factory=OrderedDict, repr=False)
    _lock: Lock = field(default_factory=Lock, repr=False)

    def __post_init__(self) -> None:
        self.full_scale = 255 if self.dtype.itemsize == 1 else 65535
        self.down, self.across = -(-self.rows // self.segment_rows), -(-self.columns // self.segment_columns)
        self.planes, self.together = (self.samples, 1) if self.is_planar else (1, self.samples)  # channels of a segment

    def check(self) -> None:
        """Raise `FileError` where the tags contradict each other or the file's length.

        Strips of any height that follow each other without compression are taken for lower ones.
        """
        count = self.planes * self.down * self.across
        if not len(self.offsets) == len(self.sizes) == count:
            raise FileError(f"{self.path}: lists {len(self.offsets)} of {count} strips or tiles; save it again")
        length = self.path.stat().st_size
        last = max(offset + size for offset, size in zip(self.offsets, self.sizes, strict=True))
        if last > length or min(self.offsets) < 8:
            raise FileError(f"{self.path}: has {length} of {last} bytes; it was cut off, copy it again")
        if sum(self.sizes) > length:
            raise FileError(f"{self.path}: its strips or tiles overlap in the file; save it again")
        needed = self.rows * self.columns * self.samples * self.dtype.itemsize
        if needed > sum(self.sizes) * (1 if self.compression == _NO_COMPRESSION else _MOST_INFLATION):
            raise FileError(f"{self.path}: holds too few bytes for {self.columns} x {self.rows} pixels; save it again")
        follow = all(a + n == b for a, n, b in zip(self.offsets, self.sizes, self.offsets[1:], strict=False))
        if self.compression == _NO_COMPRESSION and not self.is_tiled and not self.is_planar and follow:
            pitch = self.columns * self.samples * self.dtype.itemsize
            self.segment_rows = max(1, _SLAB // pitch)
            self.down = -(-self.rows // self.segment_rows)
            self.offsets = tuple(self.offsets[0] + k * self.segment_rows * pitch for k in range(self.down))
            self.sizes = (self.segment_rows * pitch,) * self.down
        band = self.segment_rows * self.segment_columns * self.across * self.together * self.dtype.itemsize
        if band > MOST_BYTES_AT_ONCE:
            raise FileError(
                f"{self.path}: its strips or tiles are too large to be decoded; save it with 1024 rows a strip"
            )

    def read(self, first: int, stop: int) -> Pixels:
        """Rows `first` to `stop`, grey."""
        pixels = np.empty((stop - first, self.columns), dtype=self.dtype.newbyteorder("="))
        height = self.segment_rows
        for band in range(first // height, (stop + height - 1) // height):
            start = band * height
            a, b = max(first, start), min(stop, start + height)
            pixels[a - first : b - first] = self._band(band)[a - start : b - start]
        return pixels

    def _band(self, band: int) -> Pixels:
        """All columns of one row of strips or tiles, decoded, grey."""
        with self._lock:
            if band in self._bands:
                self._bands.move_to_end(band)
                return self._bands[band]
        pixels = self._decode_band(band)
        with self._lock:
            self._bands[band] = pixels
            while len(self._bands) > 1 and sum(kept.nbytes for kept in self._bands.values()) > _KEPT:
                self._bands.popitem(last=False)
        return pixels

    def _decode_band(self, band: int) -> Pixels:
        height = min(self.segment_rows, self.rows - band * self.segment_rows)
        whole = np.empty((height, self.columns, self.samples), dtype=self.dtype)
        with self.path.open("rb") as stream:
            for plane in range(self.planes):
                for tile in range(self.across):
                    number = (plane * self.down + band) * self.across + tile
                    left = tile * self.segment_columns
                    right = min(self.columns, left + self.segment_columns)
                    segment = self._decode(stream.fileno(), number, height)
                    channels: Any = plane if self.is_planar else slice(None)
                    shown = segment[:height, : right - left]
                    whole[:, left:right, channels] = shown[:, :, 0] if self.is_planar else shown
        return self._finish(whole)

    def _finish(self, pixels: Pixels) -> Pixels:
        """Grey in the machine's byte order, white above black."""
        grey = to_grey(pixels if self.samples > 1 else pixels[:, :, 0])
        grey = np.ascontiguousarray(grey, dtype=grey.dtype.newbyteorder("="))
        return self.full_scale - grey if self.photometric == _WHITE_IS_ZERO else grey

    def _decode(self, descriptor: int, number: int, rows: int) -> Pixels:
        """Pixels of one segment of the open file, (rows, columns, channels), in the file's byte order.

        A last strip may hold fewer `rows` than the others, a tile never does.
        """
        height = self.segment_rows if self.is_tiled else rows
        shape = (height, self.segment_columns, self.together)
        needed = int(np.prod(shape)) * self.dtype.itemsize
        where = f"{self.path}: strip or tile {number}"
        data = os.pread(descriptor, self.sizes[number], self.offsets[number])
        if self.compression != _NO_COMPRESSION:
            try:
                data = zlib.decompressobj().decompress(data, needed)
            except zlib.error as fault:
                raise FileError(f"{where} is damaged ({fault}); copy or scan it again") from fault
        if len(data) < needed:
            raise FileError(f"{where} has {len(data)} of {needed} bytes; copy or scan it again")
        pixels = np.frombuffer(data, self.dtype, count=needed // self.dtype.itemsize).reshape(shape)
        if self.compression == _NO_COMPRESSION or self.predictor == 1:
            return pixels
        if self.predictor != _HORIZONTAL:
            raise FileError(f"{where} stores differences of kind {self.predictor}; save it without a predictor")
        return np.asarray(np.add.accumulate(pixels, axis=1, dtype=self.dtype.newbyteorder("=")))
