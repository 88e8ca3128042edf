"""What is settled before a film's first row: where the traces lie, how it runs, and when light falls on it."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import UsageError
from data_schemas.scene_recording import Film
from synth.film.source import Source
from synth.phase import Floats
from synth.seeds import generator

Pixels = NDArray[np.float32]
STRIP = 1024  # Rows of a strip, of the image file and of all chance
INCH = 25.4  # mm
_WIDEST = 4.0  # times the paper: a canvas wider than that is mostly empty
_MOST_ROWS = 2**31 - 1
_SPOTS = 3.0  # sigmas that must be left to the edge
_ROOM = 1.05  # between the steepest slope met at samples and that where a line would double back
_MINUTE = 60.0
_KNOTS = 8  # of the random error of the speed, in its correlation time
_MOST_WALK = 4.0  # sigmas: a wilder error is cut off, so that the film never stands


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
    """Lay a film of some travel, mm, out on the scanner; `UsageError`: the paper is too crooked, or too many rows."""
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


class Marks(NamedTuple):
    """Every gap of the shutter, and those that were left out, in order of time, (marks,)."""

    time: Floats  # of their middle, s
    minute: NDArray[np.uint8]  # 1: second gap of a full minute
    missing: NDArray[np.uint8]  # 1: left out
    spurious: NDArray[np.uint8]  # 1: no mark at all


class Light(NamedTuple):
    """Stretches of constant light, in order and apart: begin, end, s, and factor of the lamp, (stretches,) each."""

    begin: Floats
    end: Floats
    factor: Floats


def set_marks(film: Film, begin: float, end: float, seed: int) -> Marks:
    """The chronometer's marks at multiples of the interval, and what chance makes of them."""
    if not film.gap:
        empty = np.zeros(0, np.uint8)
        return Marks(np.zeros(0), empty, empty, empty)
    index = np.arange(np.ceil(begin / film.mark_interval - 1e-9), np.floor(end / film.mark_interval + 1e-9) + 1)
    mark = (index + 0.0) * film.mark_interval  # no negative zero
    absent = generator(seed, "film missing marks").random(mark.size) < film.missing_marks
    within = np.abs(mark - _MINUTE * np.round(mark / _MINUTE))
    full = within < 0.25 * min(film.mark_interval, _MINUTE) if film.minute_code else np.zeros(mark.size, bool)
    second = mark[full] + film.minute_code
    false = generator(seed, "film spurious marks").uniform(begin, end, film.spurious_marks)
    time = np.concatenate([mark, second, false])
    kind = np.repeat([0, 1, 2], [mark.size, second.size, false.size])
    missing = np.concatenate([absent, absent[full], np.zeros(false.size, bool)])
    order = np.argsort(time, kind="stable")
    return Marks(time[order], *(each[order].astype(np.uint8) for each in (kind == 1, missing, kind == 2)))


def light_of(film: Film, marks: Marks, begin: float, end: float, dark: Floats) -> Light:
    """Light of one trace on the film from begin to end, s; none in `dark`, stretches without a record, (n, 2) s."""
    shut = marks.time[marks.missing == 0]
    gaps = np.column_stack([shut - 0.5 * film.gap, shut + 0.5 * film.gap])
    blackouts = np.array([(each.start, each.stop) for each in film.blackouts]).reshape(-1, 2)
    closed = np.concatenate([gaps, blackouts, np.reshape(dark, (-1, 2))])
    weak = [edge for each in film.dimmings for edge in (each.start, each.stop)]
    # the light changes at these moments only
    edges = np.unique(np.clip(np.concatenate([[begin, end], closed.ravel(), weak]), begin, end))
    middle = 0.5 * (edges[1:] + edges[:-1])
    starts, stops = np.sort(closed, axis=0).T
    is_open = np.searchsorted(starts, middle) == np.searchsorted(stops, middle)
    factor = np.full(middle.size, film.lamp)
    for each in film.dimmings:
        factor[(middle > each.start) & (middle < each.stop)] *= each.factor
    lit = is_open & (factor > 0.0)
    return Light(edges[:-1][lit], edges[1:][lit], factor[lit])


class Transport:
    """Travel of the film from the begin of the record, mm; x = t - begin, and beyond the record the speed stays:

    speed = v (1 + drift x / (end - begin) + wow sin(2 pi x / period + phase) + walk(x)). The walk is a stationary
    Markov sequence, straight between its knots, so that the travel is exact.
    """

    def __init__(self, film: Film, begin: float, end: float, seed: int) -> None:
        self._film, self._begin, self._length = film, begin, end - begin
        self._phase = float(generator(seed, "film wow").uniform(0.0, 2 * np.pi)) if film.wow else 0.0
        if film.walk:
            from scipy.interpolate import make_interp_spline
            from scipy.signal import lfilter

            count = int(np.ceil(self._length / (film.walk_time / _KNOTS))) + 1
            keep = np.exp(-1.0 / _KNOTS)
            draws = generator(seed, "film walk").standard_normal(count)
            draws[1:] *= np.sqrt(1.0 - keep**2)
            walk = film.walk * np.clip(lfilter([1.0], [1.0, -keep], draws), -_MOST_WALK, _MOST_WALK)
            self._walk = make_interp_spline(np.arange(count) * (film.walk_time / _KNOTS), walk, k=1)
            self._walked = self._walk.antiderivative()
        self.length = float(self.travel(np.array([end]))[0])
        """Travel at the end, mm."""

    def travel(self, time: Floats) -> Floats:
        """Travel at a time, mm."""
        film = self._film
        since = np.clip(time - self._begin, 0.0, self._length)
        run = since + 0.5 * film.drift * since**2 / self._length
        if film.wow:
            turn = 2 * np.pi / film.wow_period
            run += film.wow / turn * (np.cos(self._phase) - np.cos(turn * since + self._phase))
        if film.walk:
            run += self._walked(since)
        beyond = (time - self._begin) - since
        return film.speed * run + beyond * self.speed(time)

    def speed(self, time: Floats) -> Floats:
        """Speed at a time, mm/s."""
        film = self._film
        since = np.clip(time - self._begin, 0.0, self._length)
        rate = 1.0 + film.drift * since / self._length
        if film.wow:
            rate += film.wow * np.sin(2 * np.pi / film.wow_period * since + self._phase)
        if film.walk:
            rate += self._walk(since)
        return film.speed * rate

    def time_at(self, travel: Floats) -> Floats:
        """Time at a travel, s; to 1e-12 of the record's length, by Newton's steps kept in a shrinking bracket."""
        end, slowest = self._begin + self._length, 0.1 * self._film.speed
        low = np.full(travel.shape, self._begin + float(np.min(travel, initial=0.0)) / slowest - 1.0)
        most = end + (float(np.max(travel, initial=0.0)) - self.length) / slowest
        high = np.full(travel.shape, max(most, end) + 1.0)
        time = np.clip(self._begin + travel / self._film.speed, low, high)
        for _ in range(80):
            error = self.travel(time) - travel
            low, high = np.where(error <= 0, time, low), np.where(error >= 0, time, high)
            step = time - error / self.speed(time)
            step = np.where((step > low) & (step < high), step, 0.5 * (low + high))
            if np.max(np.abs(step - time), initial=0.0) <= 1e-12 * (1.0 + self._length):
                return step
            time = step
        return time


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
    """Lay a film out; `UsageError`: a trace is not in the record, the swing does not fit, or the film is crooked."""
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
