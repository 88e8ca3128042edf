"""One strip or tile of a TIFF: its bytes inflated, never beyond what its tags promise, and its differences added up."""

from __future__ import annotations

import os
import zlib
from pathlib import Path

import numpy as np

from data_schemas.errors import FileError
from pipeline.film.scan.image import Pixels
from pipeline.film.scan.tiff_layout import NO_COMPRESSION, TiffLayout

_HORIZONTAL = 2


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
