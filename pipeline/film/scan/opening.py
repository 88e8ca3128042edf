"""One image file, or several overlapping strips, as one scan whose rows run with time and whose lines are dark."""

from __future__ import annotations

import hashlib
import importlib.util
import io
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from data_schemas.errors import FileError, UsageError
from data_schemas.ordinary import MOST_BYTES, ordinary_size
from pipeline.film.scan.border import WithoutBorder, without_border
from pipeline.film.scan.image import Image, ImageFile, Pixels, View
from pipeline.film.scan.turning import CLOCKWISE, UPRIGHT, Turn, Turned, turned

_SLABS = 24
_SLAB_ROWS = 48
_BLOCK = 48  # columns of one level of the blank film
_FAINTEST = 6.0  # times the grain: what counts as a line
ORIENTATIONS = ("auto", "0", "90", "180", "270")
LINES = ("auto", "dark", "light")
_MM_PER_INCH = 25.4
_UNSAID = (1.0, 72.0, 96.0)  # pixels per inch that programs write where they know nothing; no film is scanned so
_SQUARE = 0.01  # largest relative difference of pixels' two sides

REMEDY = "give a scan of a film as TIFF, PNG or JPEG"
_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_PNG, _JPEG = b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff"


@dataclass
class OpenScan(View):
    """An opened image of a film, turned so that rows run with time and lines are dark; read piece by piece.

    Attributes
    ----------
    image : Image
        Its rows, all turning and joining done.
    scale : float or None
        Size of a pixel on the film, mm.
    paths : tuple of Path
        The files, in order.
    notes : tuple of str
        What was told from the image and might be wrong.
    """

    scale: float | None
    paths: tuple[Path, ...]
    notes: tuple[str, ...] = ()

    def read(self, first: int, stop: int) -> Pixels:
        """Rows `first` to `stop`, (stop - first, columns); only what lies in the scan."""
        return self.image.read(max(0, first), min(self.rows, stop))

    def upside_down(self) -> OpenScan:
        """The same scan turned by half a turn."""
        notes = (*self.notes, "the scan lay upside down and was turned")
        return OpenScan(Turned(self.image, True, True), self.scale, self.paths, notes)


def open_scan(
    paths: str | os.PathLike[str] | Sequence[str | os.PathLike[str]], options: ScanOptions | None = None
) -> OpenScan:
    """Open the image of a film; nothing but a few slabs of rows is read.

    Parameters
    ----------
    paths : path or sequence of path
        One image (TIFF, PNG, JPEG; 8 or 16 bit; grey or colour), or overlapping strips of one film in order.
    options : ScanOptions, optional
        What the user says of them.

    Raises
    ------
    UsageError
        No file is named.
    FileError
        A file cannot be read, is no image, or strips do not overlap.
    """
    options = options or ScanOptions()
    named = [paths] if isinstance(paths, str | os.PathLike) else list(paths)
    if not named:
        raise UsageError("no film is named; give the image of a film, or its strips in order")
    files = [open_image(Path(name)) for name in named]
    notes: list[str] = []
    turns = [_turn(file, options) for file in files]
    images = [turned(file, turn) for file, turn in zip(files, turns, strict=True)]
    covered = [without_border(image) for image in images]
    if any(isinstance(image, WithoutBorder) for image in covered):
        notes.append("a border beside the film was found and overlaid")
    images = covered
    if options.lines == "light" or (options.lines == "auto" and lines_are_light(images[0])):
        images = [Inverted(image) for image in images]
        notes += ["lines are light on dark film"] * (options.lines == "auto")
    scale = _scale(files, options, notes)
    image = images[0]
    if len(images) > 1:
        from pipeline.film.scan.joining import join

        image = join(images, [Path(name) for name in named])
    return OpenScan(image, scale, tuple(Path(name) for name in named), tuple(notes))


def _turn(file: ImageFile, options: ScanOptions) -> Turn:
    """From the rows of the file to rows in time."""
    upright = UPRIGHT[file.upright]
    if options.orientation != "auto":
        return upright.then(CLOCKWISE[int(options.orientation)])
    rows, columns = (file.columns, file.rows) if upright.transposed else (file.rows, file.columns)
    return upright.then(CLOCKWISE[90 if columns > rows else 0])


def _scale(files: Sequence[ImageFile], options: ScanOptions, notes: list[str]) -> float | None:
    """Size of a pixel on the film, mm, from the option or the files' tags."""
    if options.dpi is not None:
        return _MM_PER_INCH / options.dpi
    stated = set()
    for file in files:
        if file.resolution is None or not all(10.0 <= value <= 20_000.0 for value in file.resolution):
            return None
        down, across = file.resolution
        if any(abs(down - unsaid) < 0.5 for unsaid in _UNSAID):
            notes.append(f"{down:g} dpi in the file's tags are taken for none at all")
            return None
        if abs(down / across - 1.0) > _SQUARE:
            raise FileError(
                f"{file.path}: {across:g} pixels per inch across and {down:g} down; only square pixels can be read, "
                "scale the image or say --dpi"
            )
        stated.add(round(down, 1))
    if len(stated) > 1:
        raise FileError(
            f"strips of {', '.join(f'{dpi:g}' for dpi in sorted(stated))} dpi cannot be one film; say --dpi"
        )
    return _MM_PER_INCH / stated.pop()


def sample_rows(image: Image) -> list[tuple[int, int]]:
    """First and last row of slabs spread evenly over the image."""
    height = min(_SLAB_ROWS, image.rows)
    starts = np.unique(np.linspace(0, image.rows - height, _SLABS).astype(np.int64))
    return [(int(start), int(start) + height) for start in starts]


def lines_are_light(image: Image) -> bool | None:
    """Whether what departs from the blank film is lighter than it; film is mostly blank. None: nothing departs.

    Dust and scratches depart both ways; lines are the most of what departs.
    """
    darker, lighter = 0.0, 0.0
    for first, stop in sample_rows(image):
        departure = _departures(image.read(first, stop))
        darker += float(-departure[departure < 0.0].sum())
        lighter += float(departure[departure > 0.0].sum())
    return lighter > darker if lighter or darker else None


def _departures(pixels: Pixels) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """By how many times the grain pixels depart from the median of their block, 0 where it is not clearly so."""
    columns = pixels.shape[1] // _BLOCK * _BLOCK or pixels.shape[1]
    blocks = pixels[:, :columns].reshape(pixels.shape[0], max(1, columns // _BLOCK), -1).astype(np.float32)
    blocks -= np.median(blocks, axis=(0, 2), keepdims=True)
    grain = 1.4826 * np.median(np.abs(blocks), axis=(0, 2), keepdims=True)
    # a block of even noise is film; one across the film's edge is wide, and its departures no lines
    blocks /= np.maximum(grain, np.median(grain)) + 0.5
    blocks[np.abs(blocks) < _FAINTEST] = 0.0
    return blocks


@dataclass
class Inverted(View):
    """An image whose light lines have become dark."""

    def read(self, first: int, stop: int) -> Pixels:
        """Rows `first` to `stop`."""
        pixels = self.image.read(first, stop)
        return np.asarray(pixels.dtype.type(self.full_scale) - pixels)


@dataclass(frozen=True)
class ScanOptions:
    """How the image is to be taken.

    Attributes
    ----------
    dpi : float or None
        Pixels per inch; None: as the file says.
    orientation : str
        Degrees by which the image is turned clockwise so that time runs downwards: "0", "90", "180", "270"; "auto"
        puts the long side down, its left end up.
    lines : str
        "dark" on light film, "light" on dark film, or "auto": what departs from the blank film decides.
    """

    dpi: float | None = None
    orientation: str = "auto"
    lines: str = "auto"

    def __post_init__(self) -> None:
        if self.dpi is not None and not 10.0 <= self.dpi <= 20_000.0:
            raise UsageError(f"dpi {self.dpi:g}: give 10 to 20000 pixels per inch")
        for name, known in (("orientation", ORIENTATIONS), ("lines", LINES)):
            value = getattr(self, name)
            if value not in known:
                raise UsageError(f"{name} '{value}': give one of {', '.join(known)}")


def open_image(path: Path) -> ImageFile:
    """Open an image file of any kind that is known.

    Raises
    ------
    FileError
        It cannot be read, is no image, or is damaged.
    UsageError
        What reads images is not installed.
    """
    with open_binary(path) as stream:
        magic = stream.read(8)
    for needed in ("tifffile", "PIL"):
        if importlib.util.find_spec(needed) is None:
            raise UsageError(f"reading films needs {needed}, which is not installed; pip install 'isochrony[film]'")
    if magic[:4] in _TIFF:
        from pipeline.film.scan.tiff import open_tiff

        return open_tiff(path)
    if magic == _PNG or magic[:3] == _JPEG:
        from pipeline.film.scan.whole import open_whole

        return open_whole(path, "PNG" if magic == _PNG else "JPEG")
    raise FileError(f"{path}: is no image that can be read; {REMEDY}")


def open_binary(path: Path) -> io.BufferedReader:
    """Open a file for reading; `FileError` where it is not there, no ordinary file, or may not be read."""
    ordinary_size(path, MOST_BYTES, REMEDY)
    try:
        return path.open("rb")
    except OSError as fault:
        raise FileError(f"{path}: cannot be read ({fault.strerror}); make the file readable") from fault


def sha256(path: Path) -> str:
    """SHA-256 of a file, read piece by piece."""
    with open_binary(path) as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
