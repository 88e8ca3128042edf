"""Overlapping strips of one film as one image, each turned and shifted onto the first.

A strip lies where its lines and its grain are those of the strip before. Swings look alike: shifts that match over the
whole overlap that they imply are aligned pixel by pixel, and the best must be better than all others by far.
"""

import cmath
import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import FileError
from pipeline.film.parts import Floats
from pipeline.film.scan.files import Image, Pixels
from synth.kernels.compiled import making_kernel

DOWN, ACROSS = 2, 6  # pixels to a bin of the search
LONGEST = 8192  # rows of overlap that are searched
LEAST, NEAR = 48, 6  # bins of rows that overlap at least, and that count as one shift
ROUGH, FINE = 16, 3  # of the best shifts, aligned roughly and finely:
ROUGHLY, FINELY = (4.0,), (2.0, 1.0)  # 1 sigma of the smoothing, px: wide first, to converge from the search's bins
ROWS = 720  # of the overlap that are compared
STEPS, CONVERGED = 12, 1e-4  # px
LEAST_MATCH = 0.9  # correlation of the aligned grey values
LEAST_LEAD = 2.5  # by which the second best must be further from a perfect match than the best
EXACT = 0.02  # px: a placement this close to whole pixels is taken for them
MARGIN = 3  # rows that cubic convolution reaches beyond
CHUNK = 1024  # rows resampled at a time
Grey = NDArray[np.float32]


class Placement(NamedTuple):
    """Where a strip lies on the one before: pixel z = row + i column of it falls on `offset + z exp(-i turn)`."""

    offset: complex  # px
    turn: float  # rad
    match: float  # correlation of the grey values where they overlap, 1 at best
    second: float = 0.0  # of the best other placement

    @property
    def is_certain(self) -> bool:
        """Whether the strips match here and nowhere else."""
        return self.match >= LEAST_MATCH and 1.0 - self.second >= LEAST_LEAD * (1.0 - self.match)


class Part(NamedTuple):
    """A strip in the frame of the film, which is the first strip's."""

    image: Image
    offset: complex  # see `Placement`
    turn: float
    first: int  # row of the film from which on it is read


def join(images: Sequence[Image], paths: Sequence[Path]) -> Image:
    """Lay strips on each other, as wide as the first; `FileError`: two do not overlap, or not in one way only."""
    if len({image.full_scale for image in images}) > 1:
        raise FileError(f"{paths[0]}: the strips have 8 and 16 bits; save them alike")
    parts = [Part(images[0], 0.0, 0.0, 0)]
    for image, (last, path) in zip(images[1:], itertools.pairwise(paths), strict=True):
        before, size = parts[-1], max(image.rows, image.columns)
        placed = place(before.image, image)
        if not placed.is_certain:
            fault = "no overlap found" if placed.match < LEAST_MATCH else "the overlap fits at several places"
            raise FileError(
                f"{path}: {fault} with the end of {last.name}; give the strips in the order of time, each overlapping "
                "the one before by some 200 rows or more"
            )
        offset = before.offset + placed.offset * cmath.exp(-1j * before.turn)
        turn, whole = before.turn + placed.turn, complex(round(offset.real), round(offset.imag))
        if max(abs((offset - whole).real), abs((offset - whole).imag)) + abs(turn) * size < EXACT:
            offset, turn = whole, 0.0
        seam = math.ceil(0.5 * (offset.real + before.offset.real + before.image.rows))
        parts.append(Part(image, offset, turn, max(before.first + 1, seam)))
    rows = math.floor(parts[-1].offset.real + images[-1].rows + min(0.0, parts[-1].turn * images[0].columns))
    kind = np.uint8 if images[0].full_scale == 255 else np.uint16

    def read(first: int, stop: int) -> Pixels:
        pixels = np.empty((stop - first, images[0].columns), dtype=kind)
        for part, end in zip(parts, [*(part.first for part in parts[1:]), rows], strict=True):
            begin, last = max(first, part.first), min(stop, end)
            if begin < last:
                turn = cmath.exp(1j * part.turn)
                sample(part.image, -part.offset * turn, turn, 1j * turn, begin, pixels[begin - first : last - first])
        return pixels

    return replace(images[0], rows=rows, read=read)


def straightened(image: Image, lean: float, shear: float) -> Image:
    """An image whose pixel (i, j) was at (i + shear j, j + lean i), but for where it begins; edges are repeated."""
    aside = math.ceil(abs(lean) * image.rows)
    columns = image.columns + aside
    late = math.ceil(abs(shear) * columns)
    rows, begin = image.rows - late, complex(late if shear < 0.0 else 0.0, -aside if lean > 0.0 else 0.0)

    def read(first: int, stop: int) -> Pixels:
        pixels = np.empty((stop - first, columns), dtype=np.uint8 if image.full_scale == 255 else np.uint16)
        sample(image, begin, 1.0 + 1j * lean, shear + 1j, first, pixels)
        return pixels

    return replace(image, rows=rows, columns=columns, read=read)


def sample(image: Image, origin: complex, along: complex, across: complex, first: int, wanted: Pixels) -> None:
    """Fill `wanted` from `first` on: pixel (i, j) is at `origin + i along + j across` of an image, row + i column."""
    for a in range(0, wanted.shape[0], CHUNK):
        some, begin = wanted[a : a + CHUNK], origin + (first + a) * along
        ends = [begin.real + i * along.real + j * across.real for i in (0, some.shape[0]) for j in (0, some.shape[1])]
        low = min(max(0, math.floor(min(ends)) - MARGIN), image.rows - 1)
        high = min(image.rows, math.ceil(max(ends)) + MARGIN)
        source = image.read(low, max(high, low + 1))
        resample(source, some, begin - low, along, across, float(image.full_scale))


@making_kernel
def resample(source: Pixels, wanted: Pixels, begin: complex, along: complex, across: complex, top: float) -> None:
    """See `sample`, from pixels' centres: cubic convolution of Keys (1981), a = -1/2; the edge is repeated."""
    rows, columns = source.shape
    of_rows, of_columns = np.empty(4), np.empty(4)
    for i in range(wanted.shape[0]):
        for j in range(wanted.shape[1]):
            y = begin.real + i * along.real + j * across.real
            x = begin.imag + i * along.imag + j * across.imag
            below, left, value = math.floor(y), math.floor(x), 0.0
            for u, weight in ((y - below, of_rows), (x - left, of_columns)):
                weight[0], weight[1] = u * (-0.5 + u * (1.0 - 0.5 * u)), 1.0 + u * u * (-2.5 + 1.5 * u)
                weight[2], weight[3] = u * (0.5 + u * (2.0 - 1.5 * u)), u * u * (-0.5 + 0.5 * u)
            for k in range(4):
                line = source[min(max(int(below) + k - 1, 0), rows - 1)]
                for m in range(4):
                    value += of_rows[k] * of_columns[m] * line[min(max(int(left) + m - 1, 0), columns - 1)]
            wanted[i, j] = min(max(math.floor(value + 0.5), 0.0), top)


def place(before: Image, strip: Image) -> Placement:
    """Find where a strip's beginning lies on the end of the strip before; its match is 0 if nothing matches at all."""
    length = min(LONGEST, before.rows, strip.rows)
    first = before.rows - length
    shifts = _shifts(_binned(before, first, before.rows), _binned(strip, 0, length))
    tried = [align(before, strip, complex(first + down * DOWN, across * ACROSS), ROUGHLY) for down, across in shifts]
    rough = sorted(tried, key=lambda each: -each.match)[:FINE]
    fine = [align(before, strip, each.offset, FINELY, each.turn) for each in rough] or [Placement(0j, 0.0, 0.0)]
    best, *others = sorted(fine, key=lambda each: -each.match)
    return best._replace(second=max((each.match for each in others), default=0.0))


def _binned(image: Image, first: int, stop: int) -> Grey:
    """Departures from the local level in bins, in units of their own spread."""
    rows, columns = (stop - first) // DOWN, image.columns // ACROSS
    bins = np.empty((rows, columns), dtype=np.float32)
    for a in range(0, rows, CHUNK):
        b = min(rows, a + CHUNK)
        pixels = image.read(first + a * DOWN, first + b * DOWN)[:, : columns * ACROSS]
        bins[a:b] = pixels.reshape(b - a, DOWN, columns, ACROSS).mean(axis=(1, 3), dtype=np.float32)
        bins[a:b] -= np.median(bins[a:b], axis=0)
    return bins / max(float(bins.std()), 1e-6)


def _shifts(old: Grey, new: Grey) -> list[tuple[int, int]]:
    """Shifts (down, across), bins, at which the strip's beginning matches best over the overlap that each implies."""
    from scipy.signal import correlate

    rows, middle = new.shape[0] - 1, new.shape[1] - 1  # of no shift
    some = slice(rows, rows + max(old.shape[0] - LEAST, 1)), slice(middle - middle // 8, middle + middle // 8 + 1)

    def products(one: Grey, other: Grey) -> Grey:
        return correlate(one, other, method="fft")[some]

    norm = products(old**2, np.ones_like(new)) * products(np.ones_like(old), new**2)
    match = products(old, new) / np.sqrt(np.maximum(norm, 1.0))
    best = match.max(axis=1)
    shifts: list[tuple[int, int]] = []
    while len(shifts) < ROUGH and best.max() > 0.0:
        down = int(np.argmax(best))
        shifts.append((down, int(np.argmax(match[down])) - middle // 8))
        best[max(0, down - NEAR) : down + NEAR + 1] = 0.0
    return shifts


def align(before: Image, strip: Image, offset: complex, widths: Sequence[float], turn: float = 0.0) -> Placement:
    """Refine a placement that is right to a few pixels, by Gauss-Newton on the images smoothed by `widths` in turn."""
    from scipy.ndimage import gaussian_filter, map_coordinates

    row = round(offset.real)
    overlap = min(before.rows - row, strip.rows)
    first = max(0, (overlap - ROWS) // 2)
    rows, columns = min(ROWS, overlap), strip.columns
    new = _levelled(strip.read(first, first + rows))
    start = max(0, row + first - 16)
    old = _levelled(before.read(start, min(before.rows, row + first + rows + 16)))
    inner = slice(8, rows - 8, 2), slice(8, columns - 8, 2)
    down, across = np.mgrid[inner]
    match, middle, places = 0.0, 0.5 * complex(rows, columns), down + 1j * across
    about = places - middle
    # of the compared part's own frame, turning about its middle instead of the strip's first pixel
    shift = offset + first - start - 1j * turn * (first + middle)
    for width in widths:
        smooth = gaussian_filter(old, width)
        slopes, wanted = np.gradient(smooth), gaussian_filter(new, width)[inner]
        for _ in range(STEPS):
            where = places + shift - 1j * turn * about
            at = np.stack([where.real, where.imag])
            inside = (at[0] >= 0) & (at[0] <= old.shape[0] - 1) & (at[1] >= 0) & (at[1] <= old.shape[1] - 1)
            shown, by_row, by_column = (
                map_coordinates(each, at[:, inside], order=1, mode="nearest") for each in (smooth, *slopes)
            )
            if shown.size < 100:  # away from the overlap: no match
                return Placement(offset, 0.0, 0.0)
            match = float(np.corrcoef(shown, wanted[inside])[0, 1])
            design = np.stack([by_row, by_column, by_row * about.imag[inside] - by_column * about.real[inside]])
            step = np.linalg.lstsq(design @ design.T, design @ (wanted[inside] - shown), rcond=1e-10)[0]
            shift, turn = shift + complex(step[0], step[1]), turn + float(step[2])
            if np.abs(step * (1.0, 1.0, max(rows, columns))).max() < CONVERGED:
                break
    return Placement(shift + start - first + 1j * turn * (first + middle), turn, match)


def _levelled(pixels: Pixels) -> Floats:
    """Pixels less the level of their columns, in units of their spread."""
    grey = pixels.astype(np.float64)
    grey -= np.median(grey, axis=0)
    return np.asarray(grey / max(float(grey.std()), 1e-9))
