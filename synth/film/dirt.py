"""Dust, scratches, handwriting and a torn end: what chance and people leave on a film. All sizes are assumed."""

import math

import numpy as np

from data_schemas.errors import UsageError
from data_schemas.scene_recording import Film
from synth.film.layout import STRIP, Geometry, Pixels
from synth.kernels.compiled import kernel
from synth.phase import Floats
from synth.seeds import generator

_LONGEST = 5.0  # mm of a fibre of dust: it must not reach beyond the next strip
_INK, _SCRAPED, _SPECK = 1.0, 0.03, 1.2  # densities


class Dirt:
    """All dirt of a film; `UsageError` where more of it is torn off than there is."""

    def __init__(self, film: Film, geometry: Geometry, seed: int) -> None:
        if film.torn_end and film.torn_end * geometry.pixels >= geometry.length:
            raise UsageError(
                f"film.torn_end = {film.torn_end:g} mm leaves nothing of a film of"
                f" {geometry.length / geometry.pixels:.4g} mm; make it shorter"
            )
        self._film, self._geometry, self._seed = film, geometry, seed
        self._strokes = np.concatenate([_scratches(film, geometry, seed), _handwriting(film, geometry, seed)])
        self._tear = _tear(film, geometry, seed) if film.torn_end else None

    def soil(self, image: Pixels, first: int) -> None:
        """Change the density of some rows, the first of which is number `first`, in place."""
        if self._film.dust:
            number = first // STRIP
            for strip in range(number - 1, number + 2):
                draw_strokes(image, first, self._dust(strip))
        if self._strokes.size:
            draw_strokes(image, first, self._strokes)
        if self._tear is not None:
            self._tear_off(image, first, self._tear)

    def _dust(self, number: int) -> Floats:
        """Dust of one strip: most of it round, some of it light, some of it fibres."""
        chance = generator(self._seed, f"film dust {number}")
        pixels, columns = self._geometry.pixels, self._geometry.columns
        area = STRIP * columns / (100.0 * pixels) ** 2
        count = int(chance.poisson(self._film.dust * area))
        row, column = (number + chance.random(count)) * STRIP, chance.random(count) * columns
        radius = np.clip(chance.lognormal(math.log(0.08), 0.6, count), 0.02, 1.0)
        length = radius * chance.random(count)
        fibre = chance.random(count) < 0.15
        length[fibre] = np.minimum(chance.exponential(1.5, count)[fibre], _LONGEST)
        radius[fibre] = 0.03
        angle = chance.uniform(0.0, math.pi, count)
        density = np.where(chance.random(count) < 0.5, _SPECK, _SCRAPED)
        ends = row + length * pixels * np.sin(angle), column + length * pixels * np.cos(angle)
        return np.stack([row, column, *ends, radius * pixels, density], axis=1)

    def _tear_off(self, image: Pixels, first: int, tear: Floats) -> None:
        """Nothing is left of the paper beyond the tear: the scanner's lid shows."""
        geometry = self._geometry
        if (first + len(image) - geometry.corner[0]) + geometry.width < float(np.min(tear)):
            return
        y = np.arange(first, first + len(image), dtype=np.float64)[:, None] + 0.5 - geometry.corner[0]
        x = np.arange(geometry.columns, dtype=np.float64) + 0.5 - geometry.corner[1]
        along = y * math.cos(geometry.turn) + x * math.sin(geometry.turn)
        across = x * math.cos(geometry.turn) - y * math.sin(geometry.turn)
        image[along > np.interp(across, np.arange(tear.size), tear)] = 0.0


def _scratches(film: Film, geometry: Geometry, seed: int) -> Floats:
    """Thin strokes along the film, a little bent; most scrape silver off."""
    chance = generator(seed, "film scratches")
    pixels = geometry.pixels
    count = int(chance.poisson(film.scratches * geometry.length / pixels / 1000.0))
    bends = 4
    length = chance.exponential(40.0, count)[:, None] / bends * pixels
    angle = np.cumsum(chance.normal(0.0, 0.04, (count, bends)), axis=1)
    row = np.cumsum(np.column_stack([chance.random(count) * geometry.rows, length * np.cos(angle)]), axis=1)
    column = np.cumsum(np.column_stack([chance.random(count) * geometry.columns, length * np.sin(angle)]), axis=1)
    radius = np.repeat(chance.uniform(0.01, 0.04, count) * pixels, bends)
    density = np.repeat(np.where(chance.random(count) < 0.7, _SCRAPED, _INK), bends)
    ends = (row[:, :-1], column[:, :-1], row[:, 1:], column[:, 1:])
    return np.stack([*(each.ravel() for each in ends), radius, density], axis=1)


def _handwriting(film: Film, geometry: Geometry, seed: int) -> Floats:
    """Notes in ink: loops that run on, of chance heights, somewhere on the film and nearly across it."""
    chance = generator(seed, "film handwriting")
    pixels = geometry.pixels
    notes = [np.empty((0, 6))]
    for _ in range(film.handwriting):
        loops = int(chance.integers(8, 24))
        turns = np.linspace(0.0, loops, 16 * loops + 1)
        height = np.interp(turns, np.arange(loops + 1), chance.choice([1.0, 1.2, 2.2], loops + 1)) * 1.5
        width = np.interp(turns, np.arange(loops + 1), chance.uniform(0.5, 1.5, loops + 1))
        right = 1.6 * turns + 0.8 * np.sin(2 * np.pi * turns) * width
        up = height * np.cos(2 * np.pi * turns)
        angle = chance.normal(0.0, 0.1)
        row = chance.random() * geometry.rows + pixels * (right * math.sin(angle) - up * math.cos(angle))
        column = (chance.random() * 0.8) * geometry.columns + pixels * (right * math.cos(angle) + up * math.sin(angle))
        pen = np.full(row.size - 1, 0.15 * pixels)
        notes.append(np.stack([row[:-1], column[:-1], row[1:], column[1:], pen, np.full(pen.size, _INK)], axis=1))
    return np.concatenate(notes)


def _tear(film: Film, geometry: Geometry, seed: int) -> Floats:
    """Where the paper ends, px along it, for every pixel across it: a slant, and a jagged walk at every millimetre."""
    chance = generator(seed, "film torn end")
    points = max(int(film.paper_width), 2)
    walk = np.cumsum(chance.normal(0.0, 0.4, points)) + chance.normal(0.0, 0.1) * np.arange(points)
    walk -= np.max(walk)  # what is left is nowhere longer than is said
    across = np.linspace(0.0, geometry.width, points)
    end = geometry.length - (film.torn_end - walk) * geometry.pixels
    return np.interp(np.arange(int(geometry.width) + 1), across, end)


@kernel
def draw_strokes(image: Pixels, first: int, strokes: Floats) -> None:
    """Draw straight strokes with soft round ends over densities from row number `first` on.

    Strokes are (strokes, 6): row and column of both ends, half of the width, px, and the density left where they pass.
    """
    rows, columns = image.shape
    for k in range(len(strokes)):
        y0, x0, y1, x1, radius, density = strokes[k]
        dy, dx = y1 - y0, x1 - x0
        square = max(dy * dy + dx * dx, 1e-12)
        top = max(0, math.floor(min(y0, y1) - radius - 1.0) - first)
        bottom = min(rows - 1, math.ceil(max(y0, y1) + radius + 1.0) - first)
        left = max(0, math.floor(min(x0, x1) - radius - 1.0))
        right = min(columns - 1, math.ceil(max(x0, x1) + radius + 1.0))
        for y in range(top, bottom + 1):
            for x in range(left, right + 1):
                oy, ox = first + y + 0.5 - y0, x + 0.5 - x0
                part = min(max((oy * dy + ox * dx) / square, 0.0), 1.0)
                distance = math.hypot(oy - part * dy, ox - part * dx)
                cover = min(max(radius + 0.5 - distance, 0.0), 1.0)
                image[y, x] += cover * (density - image[y, x])
