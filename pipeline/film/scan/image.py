"""Rows of an image in grey, and views of them: turned, inverted, without the scanner's border."""

from __future__ import annotations

import os
import tempfile
import weakref
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import FileError

Pixels = NDArray[Any]  # uint8 or uint16, (rows, columns)

CHUNK = 2**22  # bytes of a transposed image written at a time
PROFILES, PROFILE_ROWS = 17, 64  # along the film, in which its border is searched
LEAST_STEP = 0.05  # of full scale: what counts as an edge
SHADOW = 6  # px of film beside the edge that show blank film too
WIDEST = 0.45  # of the columns, that a border may fill
FEWEST, AGREE = 4, 0.7  # profiles that must show an edge, and share of those where it should be
SHARP = 6  # px within which the level changes at an edge
ALL_ALONG = 0.9  # of the border's columns are away from the film's level
STRAIGHT = 12.0  # px by which edges may depart from a straight line

TURNS = ("", "c", "rc", "r", "t", "tc", "trc", "tr")
"""Rows and columns exchanged (t), then rows (r) and columns (c) reversed: what sets the rows of a file upright, by the
orientation of TIFF and EXIF from 1 on."""
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
    """An image whose columns have become rows, kept in a temporary file that goes with it.

    The file holds chunks of rows one after the other, each transposed: it is written in order.
    """
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


class Edge(NamedTuple):
    """Column of the film's edge at row 0, its change a row, and the level of the film beside it."""

    start: float
    slope: float
    level: float


def without_border(image: Image) -> Image:
    """An image whose borders show blank film, so that columns keep their numbers; itself where it has none."""
    left, right = border_of(image)

    def read(first: int, stop: int) -> Pixels:
        pixels = np.array(image.read(first, stop))
        rows, columns = np.arange(first, stop)[:, None], np.arange(image.columns)
        if left is not None:
            pixels[columns < left.start + left.slope * rows + SHADOW] = round(left.level)
        if right is not None:
            pixels[columns >= right.start + right.slope * rows - SHADOW] = round(right.level)
        return pixels

    return image if left is None and right is None else replace(image, read=read)


def border_of(image: Image) -> tuple[Edge | None, Edge | None]:
    """The film's left and right edge where the scanner's border lies beside it.

    The border is lighter or darker than blank film, and straight but perhaps oblique.
    """
    starts = np.unique(np.linspace(0, max(0, image.rows - PROFILE_ROWS), PROFILES).astype(np.int64)).tolist()
    profiles = np.array(
        [np.median(image.read(a, min(image.rows, a + PROFILE_ROWS)), axis=0) for a in starts], dtype=np.float64
    )
    middle = np.array(starts) + 0.5 * min(PROFILE_ROWS, image.rows)
    left, right = (_edge(each, middle, LEAST_STEP * image.full_scale) for each in (profiles, profiles[:, ::-1]))
    return left, right and Edge(image.columns - right.start, -right.slope, right.level)


def _edge(profiles: NDArray[np.float64], rows: NDArray[np.float64], limit: float) -> Edge | None:
    """Straight line through the edges at the left of the profiles; None without."""
    widths = np.array([_width(profile, limit) for profile in profiles])
    visible = widths > 0
    if np.count_nonzero(visible) < FEWEST:
        return None
    slope, start = np.polyfit(rows[visible], widths[visible], 1)
    apart = widths[visible] - slope * rows[visible] - start
    # an oblique border may leave the image, but may not be missing where it should be
    missing = slope * rows[~visible] + start > 2.0 * SHARP
    if np.abs(apart).max() > STRAIGHT or np.count_nonzero(missing) > (1.0 - AGREE) * rows.size:
        return None
    film = [each[width + SHARP : width + 60] for each, width in zip(profiles[visible], widths[visible], strict=True)]
    return Edge(float(start + apart.max()), float(slope), float(np.median(np.concatenate(film))))


def _width(profile: NDArray[np.float64], limit: float) -> int:
    """Columns of border at the left of a profile, 0 if there is none.

    An edge is a step between a few pixels, beyond which the level never comes back halfway: a vignette has no step,
    and beside a scratch there is film again.
    """
    step = profile[SHARP:] - profile[:-SHARP]
    for edge in np.flatnonzero(np.abs(step[: int(WIDEST * profile.size)]) > limit)[::-1].tolist():
        film = float(np.median(profile[edge + SHARP : edge + SHARP + 60]))
        away = (film - profile[: edge + 1]) * np.sign(step[edge])
        if np.mean(away > 0.5 * abs(step[edge])) > ALL_ALONG:
            return int(edge) + 1
    return 0
