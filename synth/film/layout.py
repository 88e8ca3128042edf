"""Everything about a film that is settled before its first row: where the traces lie, whether they fit, when."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import UsageError
from data_schemas.scene_film import Film
from synth.film.shutter import Light, Marks, Transport, light_of, set_marks
from synth.film.source import Source
from synth.phase import Floats

Pixels = NDArray[np.float32]
STRIP = 1024
"""Rows of a strip, of the image file and of all chance."""
INCH = 25.4  # mm
_WIDEST = 4.0  # times the paper: a canvas wider than that is mostly empty
_MOST_ROWS = 2**31 - 1
_SPOTS = 3.0  # sigmas that must be left to the edge
_ROOM = 1.05  # between the steepest slope met at samples and that where a line would double back


@dataclass(frozen=True)
class Geometry:
    """The affine map from along and across the film, mm, to row and column, px; pixel i has its centre at i + 0.5."""

    rows: int
    columns: int
    """Of the image."""
    row: tuple[float, float, float]
    column: tuple[float, float, float]
    """(constant, per mm along, per mm across)."""
    turn: float
    """Rotation of the paper, rad."""
    corner: tuple[float, float]
    """(row, column) of the paper's corner where along and left edge begin, px."""
    length: float
    width: float
    """Of the paper, px."""
    pixels: float
    """Pixels to the millimetre of the scan."""

    def rows_of(self, along: Floats, across: Floats) -> Floats:
        """Row of places, px."""
        return self.row[0] + self.row[1] * along + self.row[2] * across

    def columns_of(self, along: Floats, across: Floats) -> Floats:
        """Column of places, px."""
        return self.column[0] + self.column[1] * along + self.column[2] * across

    def row_at_left(self, along: Floats) -> Floats:
        """Row at the image's column 0 of the line that is lit at once, px."""
        across = -(self.column[0] + self.column[1] * along) / self.column[2]
        return self.rows_of(along, across)

    def along_at_left(self, row: Floats) -> Floats:
        """Inverse of `row_at_left`, mm."""
        slant = self.row[2] / self.column[2]
        return (row - self.row[0] + slant * self.column[0]) / (self.row[1] - slant * self.column[1])

    def paper_edges(self, first: int, stop: int) -> tuple[Floats, Floats]:
        """First and last column of the paper in each row, at its centre line, (rows,) px; equal where there is none."""
        down = np.arange(first, stop, dtype=np.float64) + 0.5 - self.corner[0]
        cosine, sine = math.cos(self.turn), math.sin(self.turn)
        left, right = down * sine / cosine, (down * sine + self.width) / cosine  # the long edges
        if self.turn:
            ends = (0.0, self.length) if self.turn > 0.0 else (self.length, 0.0)
            left = np.maximum(left, (ends[0] - down * cosine) / sine)
            right = np.minimum(right, (ends[1] - down * cosine) / sine)
        else:
            right = np.where((down >= 0.0) & (down < self.length), right, left)
        right = np.maximum(right, left)
        shift = self.corner[1]
        return (left + shift, right + shift)


def geometry_of(film: Film, travel: float, offsets: Floats) -> Geometry:
    """Lay a film of some travel, mm, out on the scanner.

    `UsageError`: the paper lies so crooked that the image would be mostly empty, or the image would have too many rows.
    """
    pixels = film.dpi / INCH
    along, across = pixels * (1.0 + film.stretch_along), pixels * (1.0 + film.stretch_across)
    width = film.paper_width * across
    lean, turn = math.tan(math.radians(film.skew)), math.radians(film.rotation)
    before = (film.margin - min(0.0, float(np.min(offsets)))) * along - min(0.0, lean * width)
    after = (film.margin + max(0.0, float(np.max(offsets)))) * along + max(0.0, lean * width)
    length = before + travel * along + after
    cosine, sine = math.cos(turn), math.sin(turn)
    columns = round(width * cosine + length * abs(sine))
    rows = round(length * cosine + width * abs(sine))
    if columns > _WIDEST * width and film.rotation:
        raise UsageError(
            f"film.rotation = {film.rotation:g} degrees would spread a film of {length / pixels / 1000:.3g} m over"
            f" {columns} columns; give less than {math.degrees((_WIDEST - 1) * width / length):.2g} degrees"
        )
    if rows > _MOST_ROWS:
        raise UsageError(f"film: the image would have {rows} rows; make the record shorter, or speed or dpi smaller")
    corner = (max(0.0, sine) * width, max(0.0, -sine) * length)
    # on the paper: down = before + along * s + lean * (across * u), right = across * u; then turned
    down, right = (before, along, lean * across), (0.0, 0.0, across)
    row = tuple(a * cosine - b * sine for a, b in zip(down, right, strict=True))
    column = tuple(b * cosine + a * sine for a, b in zip(down, right, strict=True))
    return Geometry(
        max(rows, 1), max(columns, 1), (row[0] + corner[0], row[1], row[2]),
        (column[0] + corner[1], column[1], column[2]), turn, corner, length, width, pixels,
    )  # fmt: skip


@dataclass(frozen=True)
class Layout:
    """Place of each trace."""

    position: Floats
    offset: Floats
    lever: Floats
    """(traces,) across at rest, mm; later along the film, mm; mm/rad."""
    swing: Floats
    """(traces, 2) smallest and largest elongation, rad."""
    rate: Floats
    """(traces,) largest rate of the elongation, rad/s."""
    light: tuple[Light, ...] = ()
    """When each is lit."""


@dataclass(frozen=True)
class FilmPlan:
    """What is exposed, on what, where and when."""

    source: Source
    film: Film
    seed: int
    layout: Layout
    transport: Transport
    geometry: Geometry
    marks: Marks


def plan_film(source: Source, film: Film, seed: int) -> FilmPlan:
    """Lay a film out.

    `UsageError`: the swing does not fit on the paper, or the film lies too crooked.
    """
    layout = lay_out(source, film)
    transport = Transport(film, source.begin, source.end, seed)
    geometry = geometry_of(film, transport.length, layout.offset)
    refuse_doubling(source, film, layout, geometry)
    marks = set_marks(film, source.begin, source.end, seed)
    light = tuple(light_of(film, marks, source.begin, source.end, dark) for dark in dark_stretches(source))
    return FilmPlan(source, film, seed, replace(layout, light=light), transport, geometry, marks)


def lay_out(source: Source, film: Film) -> Layout:
    """Place the traces as the film says, or evenly.

    `UsageError`: the film names a trace that the record has not, or a trace does not fit on the paper.
    """
    named = {each.name: each for each in film.traces}
    for name in named:
        if name not in source.traces:
            raise UsageError(f"film.traces names {name!r}; the record has {', '.join(source.traces)}")
    count = len(source.traces)
    position, offset, lever = np.empty(count), np.zeros(count), np.full(count, film.lever)
    for k, name in enumerate(source.traces):
        position[k] = film.paper_width * (k + 0.5) / count
        own = named.get(name)
        if own is not None:
            offset[k] = own.offset
            lever[k] = own.lever if own.lever is not None else film.lever
            position[k] = own.position if own.position is not None else position[k]
    layout = Layout(position, offset, lever, *_extremes(source))
    _refuse_overhang(source, film, layout)
    return layout


def _extremes(source: Source) -> tuple[Floats, Floats]:
    count = len(source.traces)
    swing, rate = np.array([[np.inf, -np.inf]] * count), np.zeros(count)
    for seconds, values in source.blocks():
        with np.errstate(invalid="ignore"):
            swing[:, 0] = np.fmin(swing[:, 0], np.fmin.reduce(values, axis=1))
            swing[:, 1] = np.fmax(swing[:, 1], np.fmax.reduce(values, axis=1))
            if seconds.size > 1:
                rates = np.abs(np.diff(values, axis=1) / np.diff(seconds))
                rate = np.fmax(rate, np.fmax.reduce(rates, axis=1))
    return swing, rate


def _refuse_overhang(source: Source, film: Film, layout: Layout) -> None:
    edge = _SPOTS * film.spot
    for k, name in enumerate(source.traces):
        low, high = layout.position[k] + layout.lever[k] * layout.swing[k]
        if low >= edge and high <= film.paper_width - edge:
            continue
        largest = float(np.max(np.abs(layout.swing[k])))
        room = min(layout.position[k], film.paper_width - layout.position[k]) - edge
        lever = math.floor(0.99 * max(room, 0.0) / largest)
        raise UsageError(
            f"film: trace {name!r} would reach from {low:.1f} to {high:.1f} mm, over the edge of a paper of"
            f" {film.paper_width:g} mm; give lever = {lever:g} or less"
            f" (it is {layout.lever[k]:g} mm/rad), a wider paper_width, or positions"
        )


def refuse_doubling(source: Source, film: Film, layout: Layout, geometry: Geometry) -> None:
    """Refuse a skew or rotation so large that a line would run backwards along the film.

    Raises `UsageError`.
    """
    forwards = geometry.row[1] * film.speed * (1.0 - max(-film.drift, 0.0) - film.wow - 4.0 * film.walk)
    for k, name in enumerate(source.traces):
        if abs(geometry.row[2]) * layout.lever[k] * layout.rate[k] * _ROOM >= forwards:
            slope = layout.lever[k] * layout.rate[k] / film.speed
            raise UsageError(
                f"film.skew = {film.skew:g} with rotation = {film.rotation:g} degrees would make trace {name!r}, of"
                f" slope {slope:.1f}, run backwards along the film; make their difference less than"
                f" {math.degrees(math.atan(forwards / (geometry.row[1] * film.speed) / slope)):.2g} degrees"
            )


def dark_stretches(source: Source) -> list[list[tuple[float, float]]]:
    """Stretches without samples of each trace, (begin, end) s: there the lamp is off."""
    dark: list[list[tuple[float, float]]] = [[] for _ in source.traces]
    last = np.full(len(source.traces), source.begin)
    since = np.full(len(source.traces), True)  # whether a missing sample, or nothing yet, came after the last good one
    for seconds, values in source.blocks():
        for k, row in enumerate(values):
            good = np.flatnonzero(np.isfinite(row))
            if not good.size:
                since[k] = True
                continue
            times = np.concatenate([[last[k]], seconds[good]])
            broken = np.concatenate([[bool(since[k]) or good[0] > 0], np.diff(good) > 1])
            broken |= np.diff(times) > source.longest
            for j in np.flatnonzero(broken).tolist():
                if times[j + 1] > times[j]:
                    dark[k].append((float(times[j]), float(times[j + 1])))
            last[k], since[k] = seconds[good[-1]], good[-1] < row.size - 1
    for k, stretches in enumerate(dark):
        if last[k] < source.end:
            stretches.append((float(last[k]), source.end))
    return dark
