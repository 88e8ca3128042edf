"""Rows of an image in grey, and views of them: turned, inverted, without the scanner's border."""

from __future__ import annotations

import os
import tempfile
import weakref
from abc import ABC, abstractmethod
from dataclasses import dataclass
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


class Image(ABC):
    """Rows of an image in grey; `full_scale` is the value of the lightest pixel, 255 or 65535."""

    rows: int
    columns: int
    full_scale: int

    @abstractmethod
    def read(self, first: int, stop: int) -> Pixels:
        """Rows `first` to `stop`."""


@dataclass
class View(Image):
    """An image seen through something that keeps its size and its white."""

    image: Image

    def __post_init__(self) -> None:
        self.rows, self.columns, self.full_scale = self.image.rows, self.image.columns, self.image.full_scale


@dataclass
class Part(View):
    """Some rows of an image."""

    first: int
    stop: int

    def __post_init__(self) -> None:
        super().__post_init__()
        self.rows = self.stop - self.first

    def read(self, first: int, stop: int) -> Pixels:
        """Rows `first` to `stop` of the part."""
        return self.image.read(self.first + first, self.first + stop)


@dataclass
class Inverted(View):
    """An image whose light lines have become dark."""

    def read(self, first: int, stop: int) -> Pixels:
        """Rows `first` to `stop`."""
        pixels = self.image.read(first, stop)
        return np.asarray(pixels.dtype.type(self.full_scale) - pixels)


class Turn(NamedTuple):
    """Rows and columns exchanged, then either reversed."""

    transposed: bool = False
    rows_reversed: bool = False
    columns_reversed: bool = False

    def then(self, other: Turn) -> Turn:
        """This turn and after it another.

        >>> Turn(True, False, True).then(Turn(True, False, True)) == Turn(False, True, True)
        True
        """
        _, rows, columns = self
        if other.transposed:
            rows, columns = columns, rows
        return Turn(self.transposed != other.transposed, rows != other.rows_reversed, columns != other.columns_reversed)


TURNS = ("", "c", "rc", "r", "t", "tc", "trc", "tr")  # transposed, rows reversed, columns reversed
UPRIGHT = {code: Turn(*(letter in turn for letter in "trc")) for code, turn in enumerate(TURNS, 1)}
"""What sets the rows of a file upright, by the orientation of TIFF and EXIF."""
CLOCKWISE = {0: UPRIGHT[1], 90: UPRIGHT[6], 180: UPRIGHT[3], 270: UPRIGHT[8]}  # Turns by degrees


@dataclass
class Reversed(View):
    """An image whose rows, or columns, run the other way."""

    rows_reversed: bool = True
    columns_reversed: bool = True

    def read(self, first: int, stop: int) -> Pixels:
        """Rows `first` to `stop`."""
        if self.rows_reversed:
            pixels = self.image.read(self.rows - stop, self.rows - first)[::-1]
        else:
            pixels = self.image.read(first, stop)
        return np.ascontiguousarray(pixels[:, ::-1] if self.columns_reversed else pixels)


class Transposed(Image):
    """An image whose columns have become rows, kept in a temporary file that goes with the process.

    The file holds chunks of rows one after the other, each transposed: it is written in order.
    """

    def __init__(self, image: Image) -> None:
        self.rows, self.columns, self.full_scale = image.columns, image.rows, image.full_scale
        self._type = np.dtype(np.uint8 if image.full_scale == 255 else np.uint16)
        self._chunk = max(16, CHUNK // (image.columns * self._type.itemsize))
        try:
            self._file: BinaryIO = tempfile.TemporaryFile(prefix="isochrony-")  # noqa: SIM115
            weakref.finalize(self, self._file.close)
            for first in range(0, image.rows, self._chunk):
                self._file.write(image.read(first, min(image.rows, first + self._chunk)).T.tobytes())
            self._file.flush()
        except OSError as fault:
            raise FileError(
                f"{tempfile.gettempdir()}: too little space to turn the image ({fault.strerror}); set TMPDIR to "
                "another folder, or turn it beforehand so that the film runs down"
            ) from fault

    def read(self, first: int, stop: int) -> Pixels:
        """Rows `first` to `stop`."""
        pixels = np.empty((stop - first, self.columns), dtype=self._type)
        for left in range(0, self.columns, self._chunk):
            width = min(self._chunk, self.columns - left)
            start = (left * self.rows + first * width) * self._type.itemsize
            data = os.pread(self._file.fileno(), (stop - first) * width * self._type.itemsize, start)
            pixels[:, left : left + width] = np.frombuffer(data, self._type).reshape(stop - first, width)
        return pixels


def turned(image: Image, turn: Turn) -> Image:
    """The image after a turn."""
    image = Transposed(image) if turn.transposed else image
    return Reversed(image, *turn[1:]) if any(turn[1:]) else image


class Edge(NamedTuple):
    """Column of the film's edge at row 0, its change a row, and the level of the film beside it."""

    start: float
    slope: float
    level: float


@dataclass
class WithoutBorder(View):
    """An image whose borders show blank film, so that columns keep their numbers; None where there is no border."""

    left: Edge | None
    right: Edge | None

    def read(self, first: int, stop: int) -> Pixels:
        """Rows `first` to `stop`."""
        pixels = np.array(self.image.read(first, stop))
        rows, columns = np.arange(first, stop)[:, None], np.arange(self.columns)
        if self.left is not None:
            pixels[columns < self.left.start + self.left.slope * rows + SHADOW] = round(self.left.level)
        if self.right is not None:
            pixels[columns >= self.right.start + self.right.slope * rows - SHADOW] = round(self.right.level)
        return pixels


def without_border(image: Image) -> Image:
    """The image with the scanner's border beside the film overlaid; the image itself where it has none.

    The border is lighter or darker than blank film, and straight but perhaps oblique.
    """
    starts = np.unique(np.linspace(0, max(0, image.rows - PROFILE_ROWS), PROFILES).astype(np.int64)).tolist()
    profiles = np.array(
        [np.median(image.read(a, min(image.rows, a + PROFILE_ROWS)), axis=0) for a in starts], dtype=np.float64
    )
    middle = np.array(starts) + 0.5 * min(PROFILE_ROWS, image.rows)
    left = _edge(profiles, middle, image.full_scale)
    right = _edge(profiles[:, ::-1], middle, image.full_scale)
    if right is not None:
        right = Edge(image.columns - right.start, -right.slope, right.level)
    return image if left is None and right is None else WithoutBorder(image, left, right)


def _edge(profiles: NDArray[np.float64], rows: NDArray[np.float64], full_scale: int) -> Edge | None:
    """Straight line through the edges at the left of the profiles; None without."""
    widths = np.array([_width(profile, LEAST_STEP * full_scale) for profile in profiles])
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
