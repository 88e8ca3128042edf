"""Everything about a film that is settled before its first row: where the traces lie, whether they fit, when."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import UsageError
from data_schemas.scene_recording import Film
from synth.film.shutter import Light, Marks, Transport, light_of, set_marks
from synth.film.source import Source
from synth.phase import Floats

Pixels = NDArray[np.float32]
STRIP = 1024  # Rows of a strip, of the image file and of all chance
INCH = 25.4  # mm
_WIDEST = 4.0  # times the paper: a canvas wider than that is mostly empty
_MOST_ROWS = 2**31 - 1
_SPOTS = 3.0  # sigmas that must be left to the edge
_ROOM = 1.05  # between the steepest slope met at samples and that where a line would double back


@dataclass(frozen=True)
class Geometry:
    """The affine map from along and across the film, mm, to row and column, px; pixel i has its centre at i + 0.5."""

    rows: int
    columns: int  # Of the image
    row: tuple[float, float, float]
    column: tuple[float, float, float]  # (constant, per mm along, per mm across)
    turn: float  # Rotation of the paper, rad
    corner: tuple[float, float]  # (row, column) of the paper's corner where along and left edge begin, px
    length: float
    width: float  # Of the paper, px
    pixels: float  # Pixels to the millimetre of the scan

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
    row = (before * cosine + corner[0], along * cosine, lean * across * cosine - across * sine)
    column = (before * sine + corner[1], along * sine, across * cosine + lean * across * sine)
    return Geometry(max(rows, 1), max(columns, 1), row, column, turn, corner, length, width, pixels)


class Layout(NamedTuple):
    """Place of each trace, (traces,): across at rest, mm; later along the film, mm; mm/rad."""

    position: Floats
    offset: Floats
    lever: Floats


class FilmPlan(NamedTuple):
    """What is exposed, on what, where and when."""

    source: Source
    film: Film
    seed: int
    layout: Layout
    light: tuple[Light, ...]  # When each trace is lit
    transport: Transport
    geometry: Geometry
    marks: Marks


def plan_film(source: Source, film: Film, seed: int) -> FilmPlan:
    """Lay a film out.

    `UsageError`: the film names a trace that the record has not, the swing does not fit on the paper, or the film lies
    too crooked.
    """
    layout = _lay_out(source, film)
    _refuse_overhang(source, film, layout)
    transport = Transport(film, source.begin, source.end, seed)
    geometry = geometry_of(film, transport.length, layout.offset)
    _refuse_doubling(source, film, layout, geometry)
    marks = set_marks(film, source.begin, source.end, seed)
    light = tuple(light_of(film, marks, source.begin, source.end, dark) for dark in dark_stretches(source))
    return FilmPlan(source, film, seed, layout, light, transport, geometry, marks)


def _lay_out(source: Source, film: Film) -> Layout:
    """Place the traces as the film says, or evenly."""
    count = len(source.traces)
    layout = Layout(film.paper_width * (np.arange(count) + 0.5) / count, np.zeros(count), np.full(count, film.lever))
    for own in film.traces:
        if own.name not in source.traces:
            raise UsageError(f"film.traces names {own.name!r}; the record has {', '.join(source.traces)}")
        for name in Layout._fields:
            value = getattr(own, name)
            if value is not None:
                getattr(layout, name)[source.traces.index(own.name)] = value
    return layout


def _refuse_overhang(source: Source, film: Film, layout: Layout) -> None:
    edge = _SPOTS * film.spot
    for name, row, position, lever in zip(source.traces, source.elongation, layout.position, layout.lever, strict=True):
        swing = np.array([np.fmin.reduce(row, initial=np.inf), np.fmax.reduce(row, initial=-np.inf)])
        low, high = position + lever * swing
        if low >= edge and high <= film.paper_width - edge:
            continue
        room = min(position, film.paper_width - position) - edge
        fitting = math.floor(0.99 * max(room, 0.0) / float(np.max(np.abs(swing))))
        raise UsageError(
            f"film: trace {name!r} would reach from {low:.1f} to {high:.1f} mm, over the edge of a paper of"
            f" {film.paper_width:g} mm; give lever = {fitting:g} or less"
            f" (it is {lever:g} mm/rad), a wider paper_width, or positions"
        )


def _refuse_doubling(source: Source, film: Film, layout: Layout, geometry: Geometry) -> None:
    """Refuse a skew or rotation so large that a line would run backwards along the film."""
    forwards = geometry.row[1] * film.speed * (1.0 - max(-film.drift, 0.0) - film.wow - 4.0 * film.walk)
    steps = np.diff(source.time)
    for name, row, lever in zip(source.traces, source.elongation, layout.lever, strict=True):
        rate = np.fmax.reduce(np.abs(np.diff(row) / steps), initial=0.0)  # rad/s
        if abs(geometry.row[2]) * lever * rate * _ROOM >= forwards:
            slope = lever * rate / film.speed
            raise UsageError(
                f"film.skew = {film.skew:g} with rotation = {film.rotation:g} degrees would make trace {name!r}, of"
                f" slope {slope:.1f}, run backwards along the film; make their difference less than"
                f" {math.degrees(math.atan(forwards / (geometry.row[1] * film.speed) / slope)):.2g} degrees"
            )


def dark_stretches(source: Source) -> list[Floats]:
    """Stretches without samples of each trace, (stretches, 2) begin and end, s: there the lamp is off."""
    dark = []
    for row in source.elongation:
        good = np.flatnonzero(np.isfinite(row))
        times = np.concatenate([[source.begin], source.time[good], [source.end]])
        broken = (np.diff(good, prepend=-1, append=row.size) > 1) | (np.diff(times) > source.longest)
        stretches = np.column_stack([times[:-1], times[1:]])[broken]
        dark.append(stretches[stretches[:, 1] > stretches[:, 0]])
    return dark
