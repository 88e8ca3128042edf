"""The scanner's border beside the film: found by its own level, and overlaid with blank film.

A film narrower than the scanner's window leaves a border at its sides, lighter or darker than blank film, straight
but perhaps oblique. Nothing is cut off, so that columns keep their numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.film.scan.image import Image, Pixels, View

_PLACES = 17  # along the film
_ROWS = 64  # at each
_LEAST_STEP = 0.05  # of full scale: what counts as an edge
_MARGIN = 6  # px of film beside the edge that are overlaid too: its shadow
_WIDEST = 0.45  # of the columns
_FEWEST, _AGREE = 4, 0.7  # places that must show an edge, and part of those where it should be
_SHARP = 6  # px within which the level changes at an edge
_ALL_ALONG = 0.9  # of the border's columns are away from the film's level
_STRAIGHT = 12.0  # px by which edges may depart from a straight line


class Edge(NamedTuple):
    """Column of the film's edge at row 0, its change a row, and the level of the film beside it."""

    start: float
    slope: float
    level: float


@dataclass
class WithoutBorder(View):
    """An image whose borders show blank film.

    Attributes
    ----------
    image : Image
    left, right : Edge or None
        None where there is no border.
    """

    left: Edge | None
    right: Edge | None

    def read(self, first: int, stop: int) -> Pixels:
        """Rows `first` to `stop`."""
        pixels = np.array(self.image.read(first, stop))
        rows, columns = np.arange(first, stop)[:, None], np.arange(self.columns)
        if self.left is not None:
            edge = self.left.start + self.left.slope * rows + _MARGIN
            pixels[columns < edge] = round(self.left.level)
        if self.right is not None:
            edge = self.right.start + self.right.slope * rows - _MARGIN
            pixels[columns >= edge] = round(self.right.level)
        return pixels


def without_border(image: Image) -> Image:
    """The image with its borders overlaid; the image itself where it has none."""
    starts = np.unique(np.linspace(0, max(0, image.rows - _ROWS), _PLACES).astype(np.int64))
    profiles = np.array(
        [np.median(image.read(int(a), min(image.rows, int(a) + _ROWS)), axis=0) for a in starts], dtype=np.float64
    )
    middle = np.asarray(starts + 0.5 * min(_ROWS, image.rows), dtype=np.float64)
    left = _edge(profiles, middle, image.full_scale)
    mirrored = _edge(profiles[:, ::-1], middle, image.full_scale)
    right = None if mirrored is None else Edge(image.columns - mirrored.start, -mirrored.slope, mirrored.level)
    if left is None and right is None:
        return image
    return WithoutBorder(image, left, right)


def _edge(profiles: NDArray[np.float64], rows: NDArray[np.float64], full_scale: int) -> Edge | None:
    """Straight line through the edges at the left of the profiles; None without."""
    widths = np.array([_width(profile, _LEAST_STEP * full_scale) for profile in profiles])
    seen = widths > 0
    if np.count_nonzero(seen) < _FEWEST:
        return None
    slope, start = np.polyfit(rows[seen], widths[seen], 1)
    apart = widths[seen] - slope * rows[seen] - start
    # an oblique border may leave the image, but may not be missing where it should be
    unseen = slope * rows[~seen] + start > 2.0 * _SHARP
    if np.abs(apart).max() > _STRAIGHT or np.count_nonzero(unseen) > (1.0 - _AGREE) * rows.size:
        return None
    inside = [profile[width + _SHARP : width + 60] for profile, width in zip(profiles[seen], widths[seen], strict=True)]
    return Edge(float(start + apart.max()), float(slope), float(np.median(np.concatenate(inside))))


def _width(profile: NDArray[np.float64], limit: float) -> int:
    """Columns of border at the left of a profile, 0 if there is none.

    An edge is a step between a few pixels, beyond which the level never comes back halfway: a vignette has no step,
    and beside a scratch there is film again.
    """
    step = profile[_SHARP:] - profile[:-_SHARP]
    for place in np.flatnonzero(np.abs(step[: int(_WIDEST * profile.size)]) > limit)[::-1]:
        film = float(np.median(profile[place + _SHARP : place + _SHARP + 60]))
        away = (film - profile[: place + 1]) * np.sign(step[place])
        if np.mean(away > 0.5 * abs(step[place])) > _ALL_ALONG:
            return int(place) + 1
    return 0
