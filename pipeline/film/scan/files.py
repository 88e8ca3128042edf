"""Image files as rows of grey, and views of them.

TIFFs are decoded by strips or rows of tiles, from where tifffile says these lie, if that holds; others by Pillow.
"""

import contextlib
import functools
import importlib
import itertools
import logging
import math
import os
import tempfile
import warnings
import weakref
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import FileError

Pixels = NDArray[Any]  # uint8 or uint16, (rows, columns)
MOST_PIXELS = 2**36
MOST_BYTES_AT_ONCE = 2**29  # of a file that can only be decoded whole
NO_COMPRESSION = 1
COMPRESSIONS = NO_COMPRESSION, 8, 32946  # the others are deflate, by its new and old number
HORIZONTAL = 2  # differences along the rows
WHITE_IS_ZERO, BLACK_IS_ZERO, RGB = 0, 1, 2
MOST_INFLATION = 1032  # of deflate, by its format
CACHED = 2**24  # bytes of decoded bands
CHUNK = 2**22  # bytes read at once of a file without compression, or written of a transposed image
MOST_PAGES, SMALL = 16, 0.3  # of a file; pixels of its largest page, from which another one is no thumbnail
ORIENTATION = 274  # tag of TIFF and EXIF
BYTES = {"1": 1, "L": 1, "LA": 4, "P": 4, "PA": 4, "RGB": 4, "RGBA": 4, "YCbCr": 4, "CMYK": 4, "I;16": 2, "I": 4}

# rows and columns exchanged (t), then rows (r) and columns (c) reversed: by the orientation of TIFF and EXIF from 1 on
TURNS = ("", "c", "rc", "r", "t", "tc", "trc", "tr")
CLOCKWISE = {0: "", 90: "tc", 180: "rc", 270: "tr"}  # Turns by degrees


@dataclass(frozen=True)
class Image:
    """Rows of an image in grey; `full_scale` is the value of the lightest pixel, 255 or 65535."""

    rows: int
    columns: int
    full_scale: int
    read: Callable[[int, int], Pixels]  # rows from a first one to before another


def part_of(image: Image, first: int, stop: int) -> Image:
    """Some rows of an image."""
    return replace(image, rows=stop - first, read=lambda a, b: image.read(first + a, first + b))


def inverted(image: Image) -> Image:
    """An image whose light lines have become dark."""

    def read(first: int, stop: int) -> Pixels:
        pixels = image.read(first, stop)
        return np.asarray(pixels.dtype.type(image.full_scale) - pixels)

    return replace(image, read=read)


def turned(image: Image, turn: str) -> Image:
    """An image after one of the `TURNS`."""
    whole, columns = transposed(image) if "t" in turn else image, slice(None, None, -1 if "c" in turn else 1)

    def read(first: int, stop: int) -> Pixels:
        if "r" in turn:
            return np.ascontiguousarray(whole.read(whole.rows - stop, whole.rows - first)[::-1, columns])
        return np.ascontiguousarray(whole.read(first, stop)[:, columns])

    return replace(whole, read=read) if turn.strip("t") else whole


def transposed(image: Image) -> Image:
    """An image whose columns have become rows, kept as transposed chunks in a temporary file that goes with it."""
    kind, rows, columns = np.dtype(np.uint8 if image.full_scale == 255 else np.uint16), image.columns, image.rows
    chunk = max(16, CHUNK // (rows * kind.itemsize))
    try:
        file: BinaryIO = tempfile.TemporaryFile(prefix="isochrony-")  # noqa: SIM115
        for first in range(0, columns, chunk):
            file.write(image.read(first, min(columns, first + chunk)).T.tobytes())
        file.flush()
    except OSError as fault:
        raise FileError(
            f"{tempfile.gettempdir()}: too little space to turn the image ({fault.strerror}); set TMPDIR to "
            "another folder, or turn it beforehand so that the film runs down"
        ) from fault

    def read(first: int, stop: int) -> Pixels:
        pixels = np.empty((stop - first, columns), dtype=kind)
        for left in range(0, columns, chunk):
            width = min(chunk, columns - left)
            start = (left * rows + first * width) * kind.itemsize
            data = os.pread(file.fileno(), (stop - first) * width * kind.itemsize, start)
            pixels[:, left : left + width] = np.frombuffer(data, kind).reshape(stop - first, width)
        return pixels

    weakref.finalize(read, file.close)
    return Image(rows, columns, image.full_scale, read)


@dataclass(frozen=True)
class ImageFile(Image):
    """An image file."""

    path: Path
    resolution: tuple[float, float] | None  # pixels per inch down and across, as the file's tags say
    upright: Any  # the orientation of TIFF and EXIF, 1 to 8: how the stored rows lie in the picture


def in_memory(pixels: Pixels, path: Path, resolution: tuple[float, float] | None = None, tag: Any = 1) -> ImageFile:
    """An image file that was decoded whole; `tag` is its orientation."""
    (rows, columns), full_scale = pixels.shape, 255 if pixels.dtype == np.uint8 else 65535
    return ImageFile(rows, columns, full_scale, lambda a, b: pixels[a:b], path, resolution, tag)


def refuse_absurd_size(path: Path, rows: int, columns: int) -> None:
    """Raise `FileError` for an image too narrow for a film, or larger than any scan."""
    if min(rows, columns) < 16:
        raise FileError(f"{path}: {columns} x {rows} pixels hold no film; at least 16 across are needed")
    if rows * columns > MOST_PIXELS:
        raise FileError(f"{path}: claims {columns} x {rows} pixels, more than any scan of a film; save it anew")


def to_grey(pixels: Pixels) -> Pixels:
    """Grey of (rows, columns, channels): luma of ITU-R BT.601 in whole numbers; alpha is left out."""
    if pixels.shape[2] < 3:
        return pixels[:, :, 0]
    luma = np.full(pixels.shape[:2], 32768, dtype=np.uint32)  # 65535 * 65536 + 32768 fits
    for channel, weight in enumerate((19595, 38470, 7471)):  # of 65536
        luma += pixels[:, :, channel] * np.uint32(weight)
    return np.asarray(luma >> np.uint32(16), dtype=pixels.dtype)


def open_whole(path: Path, kind: str) -> ImageFile:
    """Decode a file of `kind` PNG, JPEG or TIFF alone; `FileError`: damaged, of an unknown mode, or too large."""
    # Pillow's general reader refuses large images, which films are, by a global limit
    name = {"PNG": "Png", "JPEG": "Jpeg", "TIFF": "Tiff"}[kind]
    opener = getattr(importlib.import_module(f"PIL.{name}ImagePlugin"), f"{name}ImageFile")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # what matters of a damaged file is raised
            with contextlib.closing(opener(str(path))) as image:
                columns, rows = image.size
                refuse_absurd_size(path, rows, columns)
                if image.mode not in BYTES:
                    raise FileError(f"{path}: pixels of mode {image.mode} are not known; save it as 8 or 16 bit grey")
                if rows * columns * BYTES[image.mode] > MOST_BYTES_AT_ONCE:
                    raise FileError(
                        f"{path}: {columns} x {rows} pixels are too many for {kind}, which can only be decoded whole; "
                        "save it as TIFF in strips, or cut it and add --strips"
                    )
                resolution = None
                with contextlib.suppress(TypeError, ValueError, ZeroDivisionError):
                    across, down = (float(value) for value in image.info.get("dpi"))
                    resolution = down, across
                deep = image.mode in ("I", "I;16")
                pixels = np.array(np.clip(image, 0, 65535), np.uint16) if deep else np.array(image.convert("L"))
                return in_memory(pixels, path, resolution, image.getexif().get(ORIENTATION, 1))
    except FileError:
        raise
    except MemoryError as fault:
        raise FileError(f"{path}: does not fit into memory; save it as TIFF in strips") from fault
    except Exception as fault:  # Pillow's decoders raise whatever their bytes lead to
        raise FileError(f"{path}: damaged or unusual {kind} ({_short(fault)}); scan or save it again") from fault


def _short(fault: Exception) -> str:
    return " ".join(str(fault).split())[:120] or type(fault).__name__


def open_tiff(path: Path) -> ImageFile:
    """Open the largest image of a TIFF, by Pillow if small; `FileError`: damaged, several images, not 8 or 16 bit."""
    import tifffile

    logging.getLogger("tifffile").setLevel(logging.CRITICAL)  # what matters is raised here, in one line
    try:
        with tifffile.TiffFile(path) as tiff:
            pages: list[Any] = list(itertools.islice(tiff.pages, MOST_PAGES))
            sizes = [int(each.imagelength) * int(each.imagewidth) for each in pages]
            page = pages[sizes.index(max(sizes))]
            image = Tiff(path, page, tiff.byteorder)
            several = sum(size > SMALL * max(sizes) for size in sizes) > 1
            bits, kind = page.bitspersample, page.sampleformat
    except Exception as fault:  # tifffile raises whatever the bytes lead to
        raise FileError(f"{path}: damaged TIFF ({_short(fault)}); copy or scan it again") from fault
    if bits not in (8, 16) or kind != 1:
        kinds = {1: "whole numbers", 2: "signed numbers", 3: "floating point"}
        raise FileError(f"{path}: pixels are {kinds.get(kind, 'data')} of {bits} bits; save it as 8 or 16 bit grey")
    if several:
        raise FileError(f"{path}: holds several images; save each strip of film to a file, and add --strips")
    refuse_absurd_size(path, image.rows, image.columns)
    if image.compression not in COMPRESSIONS or image.photometric not in (WHITE_IS_ZERO, BLACK_IS_ZERO, RGB):
        return open_whole(path, "TIFF")
    image.check()
    shape = image.rows, image.columns, image.full_scale
    return ImageFile(*shape, image.read, path, image.resolution, image.upright)


class Tiff:
    """A TIFF on the disk, of which nothing is held but the bands of rows last decoded; any number of threads may read.

    A band is a row of tiles or a strip, `segment` the shape of either; they lie at `offsets`, `sizes` bytes each.
    """

    def __init__(self, path: Path, page: Any, byteorder: str) -> None:
        """What the tags of a page say."""
        self.path, self.rows, self.columns = path, int(page.imagelength), int(page.imagewidth)
        self.photometric, self.compression = int(page.photometric), int(page.compression)
        self.predictor, self.is_tiled = int(page.predictor), bool(page.is_tiled)
        self.channels = int(page.samplesperpixel)
        self.is_planar = int(page.planarconfig) == 2 and self.channels > 1
        height = int(page.tilelength) if self.is_tiled else min(int(page.rowsperstrip or self.rows), self.rows)
        width = int(page.tilewidth) if self.is_tiled else self.columns
        self.segment = max(1, height), max(1, width), 1 if self.is_planar else self.channels
        self.offsets = [int(value) for value in page.dataoffsets]
        self.sizes = [int(value) for value in page.databytecounts]
        self.dtype = np.dtype(f"{byteorder}u{max(1, int(page.bitspersample) // 8)}")
        self.full_scale = 255 if self.dtype.itemsize == 1 else 65535
        across, down = map(float, page.get_resolution("INCH"))
        self.resolution = down, across
        self.upright = page.tags.valueof(ORIENTATION, default=1)

    def check(self) -> None:
        """Raise `FileError` where tags contradict each other or the file; split plain strips into lower ones."""
        length, (height, width, together) = self.path.stat().st_size, self.segment
        across = -(-self.columns // width)
        count = -(-self.rows // height) * across * (self.channels // together)
        if not len(self.offsets) == len(self.sizes) == count:
            raise FileError(f"{self.path}: lists {len(self.offsets)} of {count} strips or tiles; save it again")
        last = max(offset + size for offset, size in zip(self.offsets, self.sizes, strict=True))
        if last > length or min(self.offsets) < 8:
            raise FileError(f"{self.path}: has {length} of {last} bytes; it was cut off, copy it again")
        if sum(self.sizes) > length:
            raise FileError(f"{self.path}: its strips or tiles overlap in the file; save it again")
        plain = self.compression == NO_COMPRESSION
        pitch = self.columns * self.channels * self.dtype.itemsize
        if self.rows * pitch > sum(self.sizes) * (1 if plain else MOST_INFLATION):
            raise FileError(f"{self.path}: holds too few bytes for {self.columns} x {self.rows} pixels; save it again")
        follow = all(a + n == b for a, n, b in zip(self.offsets, self.sizes, self.offsets[1:], strict=False))
        if plain and not self.is_tiled and not self.is_planar and follow:
            height = max(1, CHUNK // pitch)
            self.segment = height, width, together
            self.offsets = [self.offsets[0] + first * pitch for first in range(0, self.rows, height)]
            self.sizes = [height * pitch] * len(self.offsets)
        band = height * width * across * together * self.dtype.itemsize
        if band > MOST_BYTES_AT_ONCE:
            raise FileError(
                f"{self.path}: its strips or tiles are too large to be decoded; save it with 1024 rows a strip"
            )
        self._band = functools.lru_cache(max(1, CACHED // max(band, 1)))(self._decode_band)

    def read(self, first: int, stop: int) -> Pixels:
        """Rows `first` to `stop`, grey."""
        pixels = np.empty((stop - first, self.columns), dtype=self.dtype.newbyteorder("="))
        height = self.segment[0]
        for band in range(first // height, -(-stop // height)):
            start = band * height
            a, b = max(first, start), min(stop, start + height)
            pixels[a - first : b - first] = self._band(band)[a - start : b - start]
        return pixels

    def _decode_band(self, band: int) -> Pixels:
        """All columns of one row of strips or tiles, grey, in the machine's byte order, white above black."""
        height, width, together = self.segment
        rows, across = min(height, self.rows - band * height), -(-self.columns // width)
        pixels = np.empty((rows, self.columns, self.channels), dtype=self.dtype)
        with self.path.open("rb") as stream:
            for plane, tile in np.ndindex(self.channels // together, across):
                number = (plane * -(-self.rows // height) + band) * across + tile
                part = pixels[:, tile * width : (tile + 1) * width, plane * together : (plane + 1) * together]
                part[:] = self._decode(stream.fileno(), number, rows)[:rows, : part.shape[1]]
        grey = np.ascontiguousarray(to_grey(pixels), dtype=self.dtype.newbyteorder("="))
        return self.full_scale - grey if self.photometric == WHITE_IS_ZERO else grey

    def _decode(self, descriptor: int, number: int, rows: int) -> Pixels:
        """Pixels of one segment of the open file; a last strip may hold fewer `rows` than the others, a tile never."""
        shape = (self.segment[0] if self.is_tiled else rows, *self.segment[1:])
        needed = math.prod(shape) * self.dtype.itemsize
        name = f"{self.path}: strip or tile {number}"
        data = os.pread(descriptor, self.sizes[number], self.offsets[number])
        if self.compression != NO_COMPRESSION:
            try:
                data = zlib.decompressobj().decompress(data, needed)
            except zlib.error as fault:
                raise FileError(f"{name} is damaged ({fault}); copy or scan it again") from fault
        if len(data) < needed:
            raise FileError(f"{name} has {len(data)} of {needed} bytes; copy or scan it again")
        pixels = np.frombuffer(data, self.dtype, count=needed // self.dtype.itemsize).reshape(shape)
        if self.compression == NO_COMPRESSION or self.predictor == 1:
            return pixels
        if self.predictor != HORIZONTAL:
            raise FileError(f"{name} stores differences of kind {self.predictor}; save it without a predictor")
        return np.asarray(np.add.accumulate(pixels, axis=1, dtype=self.dtype.newbyteorder("=")))
