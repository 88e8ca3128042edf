"""TIFF and BigTIFF, decoded a strip or a row of tiles at a time."""

from __future__ import annotations

import os
import zlib
from collections import OrderedDict
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from data_schemas.errors import FileError
from pipeline.film.scan.image import ImageFile, Pixels, refuse_absurd_size, to_grey
from pipeline.film.scan.tiff_layout import NO_COMPRESSION, TiffLayout, is_streamable, read_layout

_HORIZONTAL = 2
_KEPT = 16 * 2**20  # bytes of decoded bands
_SLAB = 2**22  # bytes read at once of a file without compression


def open_tiff(path: Path) -> ImageFile:
    """Open a TIFF.

    Raises
    ------
    FileError
        The file is damaged, or of a kind that is not known.
    """
    layout = read_layout(path)
    refuse_absurd_size(path, layout.rows, layout.columns)
    if not is_streamable(layout):
        from pipeline.film.scan.whole import open_whole

        return open_whole(path, "TIFF")
    layout.check(path)
    return TiffImage(path, layout)


@dataclass(frozen=True)
class TiffImage:
    """A TIFF on the disk; nothing of it is held but the bands of rows last decoded.

    Any number of threads may read.
    """

    path: Path
    layout: TiffLayout
    _bands: OrderedDict[int, Pixels] = field(default_factory=OrderedDict, repr=False)
    _lock: Lock = field(default_factory=Lock, repr=False)

    @property
    def rows(self) -> int:
        """Rows of the image."""
        return self.layout.rows

    @property
    def columns(self) -> int:
        """Columns of the image."""
        return self.layout.columns

    @property
    def full_scale(self) -> int:
        """Value of the lightest pixel."""
        return 255 if self.layout.dtype.itemsize == 1 else 65535

    @property
    def resolution(self) -> tuple[float, float] | None:
        """Pixels per inch down and across."""
        return self.layout.resolution

    @property
    def upright(self) -> int:
        """How the stored rows lie in the picture."""
        return self.layout.upright

    def read(self, first: int, stop: int) -> Pixels:
        """Rows `first` to `stop`, grey."""
        if self.layout.is_plain:
            return self._plain(first, stop)
        pixels = np.empty((stop - first, self.columns), dtype=self.layout.dtype.newbyteorder("="))
        height = self.layout.segment_rows
        for band in range(first // height, (stop + height - 1) // height):
            start = band * height
            a, b = max(first, start), min(stop, start + height)
            pixels[a - first : b - first] = self._band(band)[a - start : b - start]
        return pixels

    def _plain(self, first: int, stop: int) -> Pixels:
        """Rows of a file without compression whose strips follow each other: read where they lie."""
        layout = self.layout
        pitch = layout.columns * layout.samples * layout.dtype.itemsize
        pixels = np.empty((stop - first, layout.columns), dtype=layout.dtype.newbyteorder("="))
        step = max(1, _SLAB // pitch)
        with self.path.open("rb") as stream:
            for a in range(first, stop, step):
                b = min(stop, a + step)
                data = os.pread(stream.fileno(), (b - a) * pitch, layout.offsets[0] + a * pitch)
                if len(data) < (b - a) * pitch:
                    raise FileError(f"{self.path}: ends within row {a}; it was cut off, copy it again")
                pixels[a - first : b - first] = self._finish(
                    np.frombuffer(data, layout.dtype).reshape(b - a, layout.columns, layout.samples)
                )
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
        layout = self.layout
        height = min(layout.segment_rows, layout.rows - band * layout.segment_rows)
        whole = np.empty((height, layout.columns, layout.samples), dtype=layout.dtype)
        planes = layout.samples if layout.is_planar else 1
        with self.path.open("rb") as stream:
            for plane in range(planes):
                for tile in range(layout.segments_across):
                    number = (plane * layout.segments_down + band) * layout.segments_across + tile
                    left = tile * layout.segment_columns
                    right = min(layout.columns, left + layout.segment_columns)
                    segment = decode(self.path, stream.fileno(), layout, number, height)
                    channels: Any = plane if layout.is_planar else slice(None)
                    shown = segment[:height, : right - left]
                    whole[:, left:right, channels] = shown[:, :, 0] if layout.is_planar else shown
        return self._finish(whole)

    def _finish(self, pixels: Pixels) -> Pixels:
        """Grey in the machine's byte order, white above black."""
        grey = to_grey(pixels if self.layout.samples > 1 else pixels[:, :, 0])
        grey = np.ascontiguousarray(grey, dtype=grey.dtype.newbyteorder("="))
        return self.full_scale - grey if self.layout.is_white_zero else grey


def decode(path: Path, descriptor: int, layout: TiffLayout, number: int, rows: int) -> Pixels:
    """Pixels of one segment, (rows, columns, channels), in the file's byte order.

    Parameters
    ----------
    descriptor : int
        Of the open file.
    number : int
        Of the segment, in the order of the file's tables.
    rows : int
        Rows wanted; a last strip may hold fewer than the others, a tile never does.

    Raises
    ------
    FileError
        The segment is damaged or short, or stores differences of a kind that is not known.
    """
    size = layout.sizes[number]
    data = os.pread(descriptor, size, layout.offsets[number])
    height = layout.segment_rows if layout.is_tiled else rows
    samples = 1 if layout.is_planar else layout.samples
    needed = height * layout.segment_columns * samples * layout.dtype.itemsize
    if layout.compression != NO_COMPRESSION:
        try:
            data = zlib.decompressobj().decompress(data, needed)
        except zlib.error as fault:
            raise FileError(f"{path}: strip or tile {number} is damaged ({fault}); copy or scan it again") from fault
    if len(data) < needed:
        raise FileError(f"{path}: strip or tile {number} has {len(data)} of {needed} bytes; copy or scan it again")
    pixels = np.frombuffer(data, layout.dtype, count=needed // layout.dtype.itemsize)
    pixels = pixels.reshape(height, layout.segment_columns, samples)
    if layout.compression == NO_COMPRESSION or layout.predictor == 1:
        return pixels
    if layout.predictor != _HORIZONTAL:
        raise FileError(f"{path}: stores differences of kind {layout.predictor}; save it without a predictor")
    return np.asarray(np.add.accumulate(pixels, axis=1, dtype=layout.dtype.newbyteorder("=")))
