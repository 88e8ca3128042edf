"""One image file, or several overlapping strips, as one scan whose rows run with time and whose lines are dark."""

import importlib.util
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import FileError, UsageError
from data_schemas.text_files import MOST_BYTES, file_sha256, ordinary_size
from pipeline.film.scan.files import (
    CLOCKWISE,
    TURNS,
    Image,
    ImageFile,
    Pixels,
    inverted,
    open_tiff,
    open_whole,
    part_of,
    turned,
)

SAMPLES, SAMPLE_ROWS = 24, 48  # pieces of the image that show whether lines are light
BLOCK = 48  # columns of one level of the blank film
FAINTEST = 6.0  # times the grain: what counts as a line
ACROSS = 1.5  # times the grain, of a block's row of which half the pixels depart
ORIENTATIONS = ("auto", "0", "90", "180", "270")
LINES = ("auto", "dark", "light")
MM_PER_INCH = 25.4
COARSE = 150.0  # dpi, below which a line of .1 mm is hardly wider than a pixel
FLAT = 0.12  # of the grey levels, by which lines and film differ at least
STEPS = 8  # grey levels, of a scan that has few
SQUARES, JPEG_SIDE = 1.25, 8  # step across the edges of JPEG's squares over that beside them; px
PIECES, ROWS = 5, 256
UNSTATED = (1.0, 72.0, 96.0)  # pixels per inch that programs write where they know nothing; no film is scanned so
MOST_PART = 2.0  # usual departures, for which those of one place count at most
SQUARE = 0.01  # largest relative difference of pixels' two sides
PROFILES, PROFILE_ROWS = 17, 64  # along the film, in which its border is searched
LEAST_STEP = 0.05  # of full scale: what counts as an edge
SHADOW = 6  # px of film beside the edge that show blank film too
WIDEST = 0.45  # of the columns, that a border may fill
FEWEST, AGREE = 4, 0.7  # profiles that must show an edge, and share of those where it should be
SHARP = 6  # px within which the level changes at an edge
ALL_ALONG = 0.9  # of the border's columns are away from the film's level
STRAIGHT = 12.0  # px by which edges may depart from a straight line
REMEDY = "give a scan of a film as TIFF, PNG or JPEG"
TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
PNG, JPEG = b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff"


@dataclass
class OpenScan:
    """An opened image of a film, turned so that rows run with time and lines are dark; read piece by piece."""

    image: Image
    scale: float | None  # size of a pixel on the film, mm
    paths: tuple[Path, ...]  # in order
    notes: tuple[str, ...] = ()  # what was inferred from the image and might be wrong
    orientation: int = 0  # degrees by which it is turned clockwise
    directed: bool = False  # whether the user said how time runs

    def __post_init__(self) -> None:
        self.rows, self.columns, self.full_scale = self.image.rows, self.image.columns, self.image.full_scale

    def read(self, first: int, stop: int) -> Pixels:
        """Rows `first` to `stop`, (stop - first, columns); only what lies in the scan."""
        return self.image.read(max(0, first), min(self.rows, stop))

    @cached_property
    def sha256(self) -> tuple[str, ...]:
        """Of the files, in order."""
        return tuple(file_sha256(path) for path in self.paths)

    def part(self, first: int, stop: int | None) -> "OpenScan":
        """Some rows of the same scan; `UsageError` where there are none."""
        last = self.rows if stop is None else min(stop, self.rows)
        if not 0 <= first < last:
            raise UsageError(f"rows {first} to {last}: the film has rows 0 to {self.rows}")
        notes = (*self.notes, f"rows {first} to {last} of {self.rows} were read")
        return replace(self, image=part_of(self.image, first, last), notes=notes)

    def upside_down(self) -> "OpenScan":
        """The same scan turned by half a turn."""
        notes = (*self.notes, "the scan lay upside down and was turned")
        degrees = (self.orientation + 180) % 360
        return replace(self, image=turned(self.image, CLOCKWISE[180]), notes=notes, orientation=degrees, directed=False)

    def straightened(self, lean: float, shear: float) -> "OpenScan":
        """The same scan set upright: traces ran aside by `lean` columns a row, and lagged by `shear` rows a column."""
        if not (lean or shear):
            return self
        from pipeline.film.scan.strips import straightened

        by = np.degrees(np.arctan([lean, shear]))
        notes = (*self.notes, f"traces ran aside by {by[0]:.2f} and the slit by {by[1]:.2f} degrees: set upright")
        return replace(self, image=straightened(self.image, lean, shear), notes=notes)


def open_scan(
    paths: str | os.PathLike[str] | Sequence[str | os.PathLike[str]], *,
    dpi: float | None = None, orientation: str = "auto", lines: str = "auto",
) -> OpenScan:  # fmt: skip
    """Open the image of a film, or overlapping strips of it in order; only a few pieces of them are read.

    `dpi`, pixels per inch, is by default as the files say. `orientation` are degrees by which the image is turned
    clockwise so that time runs down; auto puts the long side down, its left end up. `lines` are dark or light; auto: by
    what departs from blank film. `UsageError`: no file is named, or an option cannot be meant; `FileError`: one is no
    image that can be read (TIFF, PNG, JPEG; 8 or 16 bit; grey or colour), or strips do not overlap.
    """
    if dpi is not None and not 10.0 <= dpi <= 20_000.0:
        raise UsageError(f"dpi {dpi:g}: give 10 to 20000 pixels per inch")
    for name, value, known in (("orientation", orientation, ORIENTATIONS), ("lines", lines, LINES)):
        if value not in known:
            raise UsageError(f"{name} '{value}': give one of {', '.join(known)}")
    named = tuple(Path(name) for name in ([paths] if isinstance(paths, str | os.PathLike) else paths))
    if not named:
        raise UsageError("no film is named; give the image of a film, or its strips in order")
    files = [open_image(name) for name in named]
    notes: list[str] = []
    upright = [turned(file, TURNS[file.upright - 1 if file.upright in range(1, 9) else 0]) for file in files]
    degrees = [90 * (each.columns > each.rows) if orientation == "auto" else int(orientation) for each in upright]
    whole = [turned(image, CLOCKWISE[each]) for image, each in zip(upright, degrees, strict=True)]
    images = [without_border(image) for image in whole]
    if any(one is not other for one, other in zip(images, whole, strict=True)):
        notes.append("a border beside the film was found and overlaid")
    if lines == "light" or (lines == "auto" and lines_are_light(images[0])):
        images = [inverted(image) for image in images]
        notes += ["lines are light on dark film"] * (lines == "auto")
    scale, image = _scale(files, notes) if dpi is None else MM_PER_INCH / dpi, images[0]
    if len(images) > 1:
        from pipeline.film.scan.strips import join

        image = join(images, named)
    return OpenScan(image, scale, named, tuple(notes), degrees[0], orientation != "auto")


def _scale(files: Sequence[ImageFile], notes: list[str]) -> float | None:
    """Size of a pixel on the film, mm, from the files' tags."""
    stated = set()
    for file in files:
        if file.resolution is None or not all(10.0 <= value <= 20_000.0 for value in file.resolution):
            return None
        down, across = file.resolution
        if any(abs(down - unstated) < 0.5 for unstated in UNSTATED):
            notes.append(f"{down:g} dpi in the file's tags are taken for none at all")
            return None
        if abs(down / across - 1.0) > SQUARE:
            raise FileError(
                f"{file.path}: {across:g} pixels per inch across and {down:g} down; only square pixels can be read, "
                "scale the image or say --dpi"
            )
        stated.add(round(down, 1))
    if len(stated) > 1:
        raise FileError(
            f"strips of {', '.join(f'{dpi:g}' for dpi in sorted(stated))} dpi cannot be one film; say --dpi"
        )
    return MM_PER_INCH / stated.pop()


class Edge(NamedTuple):
    """Column of the film's edge at row 0, its change a row, and the level of the film beside it."""

    start: float
    slope: float
    level: float


def _spread(last: int, count: int) -> list[int]:
    """At most so many rows from the first to the last, evenly."""
    rows: list[int] = np.unique(np.linspace(0, last, count).astype(np.int64)).tolist()
    return rows


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
    """The film's left and right edge, straight but perhaps oblique, where a lighter or darker border lies beside."""
    height = min(PROFILE_ROWS, image.rows)
    starts = _spread(image.rows - height, PROFILES)
    profiles = np.array([np.median(image.read(a, a + height), axis=0) for a in starts], dtype=np.float64)
    middle = np.array(starts) + 0.5 * height
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
    """Columns of border at the left of a profile, up to a step beyond which the level never comes back halfway."""
    step = profile[SHARP:] - profile[:-SHARP]
    for edge in np.flatnonzero(np.abs(step[: int(WIDEST * profile.size)]) > limit)[::-1].tolist():
        film = float(np.median(profile[edge + SHARP : edge + SHARP + 60]))
        away = (film - profile[: edge + 1]) * np.sign(step[edge])
        if np.mean(away > 0.5 * abs(step[edge])) > ALL_ALONG:
            return int(edge) + 1
    return 0


def lines_are_light(image: Image) -> bool | None:
    """Whether the most of what departs from the blank film is lighter than it; None: nothing departs."""
    height, away = min(SAMPLE_ROWS, image.rows), []
    for first in _spread(image.rows - height, SAMPLES):
        departure = _departures(image.read(first, first + height))
        away.append((-departure[departure < 0.0].sum(), departure[departure > 0.0].sum()))
    size = np.sum(away, axis=1)
    if not size.any():
        return None
    # what lies above and below a film departs more than any line
    most = MOST_PART * float(np.median(size[size > 0.0]))
    darker, lighter = np.array(away).T @ np.minimum(most / np.maximum(size, most), 1.0)
    return bool(lighter > darker)


def _departures(pixels: Pixels) -> NDArray[np.float32]:
    """By how many times the grain pixels depart from the median of their block, 0 where it is not clearly so."""
    columns = pixels.shape[1] // BLOCK * BLOCK or pixels.shape[1]
    blocks = pixels[:, :columns].reshape(pixels.shape[0], max(1, columns // BLOCK), -1).astype(np.float32)
    blocks -= np.median(blocks, axis=(0, 2), keepdims=True)
    grain = 1.4826 * np.median(np.abs(blocks), axis=(0, 2), keepdims=True)
    # a block of even noise is film; one across the film's edge is wide, and its departures no lines
    blocks /= np.maximum(grain, np.median(grain)) + 0.5
    # a time mark across the film departs from end to end
    blocks[np.abs(np.median(blocks, axis=2)) > ACROSS] = 0.0
    blocks[np.abs(blocks) < FAINTEST] = 0.0
    return blocks


def cause_in(scan: OpenScan) -> str | None:
    """The likeliest fault of a scan that lies in the scan itself, with its remedy; None where it looks well."""
    if scan.scale is not None and (dpi := MM_PER_INCH / scan.scale) < COARSE:
        return f"the scan has {dpi:.0f} dpi, too few for its lines: scan at 300 dpi"
    pieces = [scan.read(first, first + ROWS) for first in _spread(max(0, scan.rows - ROWS), PIECES)]
    levels = np.unique(np.concatenate([np.unique(piece) for piece in pieces])).size
    if levels <= STEPS:
        return f"the scan has {levels} grey levels: scan in grey with 8 bits"
    if max(_squares(piece) for piece in pieces) > SQUARES:
        return "compression shows as squares of 8 pixels: save the scan as TIFF or PNG, or as JPEG of quality 90"
    dark, light = np.quantile(np.concatenate([piece.ravel() for piece in pieces]), [0.001, 0.999])
    if light - dark < FLAT * scan.full_scale:
        share = 100.0 * (light - dark) / scan.full_scale
        return f"the pixels span {share:.0f} % of the grey levels: scan with more contrast"
    return None


def _squares(pixels: Pixels) -> float:
    """Mean step from column to column across the edges of squares of 8 pixels, over that elsewhere."""
    step = np.abs(np.diff(pixels.astype(np.float32), axis=1))
    step = np.minimum(step, 4.0 * np.median(step) + 1.0).mean(axis=0)  # lines are steeper
    by_phase = np.array([step[phase::JPEG_SIDE].mean() for phase in range(JPEG_SIDE)])
    at = int(np.argmax(by_phase))
    return float(by_phase[at] / max(np.delete(by_phase, at).mean(), 1e-3))


def open_image(path: Path) -> ImageFile:
    """Open an image file of any kind that is known; `FileError` if it is none, `UsageError` if a library is missing."""
    ordinary_size(path, MOST_BYTES, REMEDY)
    try:
        with path.open("rb") as stream:
            magic = stream.read(8)
    except OSError as fault:
        raise FileError(f"{path}: cannot be read ({fault.strerror}); make the file readable") from fault
    for needed in ("tifffile", "PIL"):
        if importlib.util.find_spec(needed) is None:
            raise UsageError(f"reading films needs {needed}, which is not installed; pip install 'isochrony[film]'")
    if magic[:4] in TIFF:
        return open_tiff(path)
    if magic == PNG or magic[:3] == JPEG:
        return open_whole(path, "PNG" if magic == PNG else "JPEG")
    raise FileError(f"{path}: is no image that can be read; {REMEDY}")
