"""A film as light makes it: spots that move over paper, a characteristic curve, grain, damage, and a scanner.

Light is summed over steps in which no spot moves by more than .7 of its sigma. Density is
`D_max (1 - exp(-E^gamma))`, unlike the curve of the product's own films. Rendered in blocks of rows, so that memory
does not grow with the film; of coarse scans at a multiple of the resolution.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, gaussian_filter1d

from . import paper
from .kinds import Case
from .pendulums import World, swing

Floats = NDArray[np.float64]
Grey = NDArray[np.float32]
Random = np.random.Generator

BLOCK = 1024
_BASE = 0.06  # density of unexposed paper
_STEEP = 12.0
"""Slope of the line for which the lamp is set."""
_SLIT = 0.12  # mm, 1 sigma along the film, of stray light
_LINE = 0.9
"""Exposure of a dark line, of the mark's whole length at nominal speed."""
_BLUR = 0.4  # px, 1 sigma, of the scanner
_READOUT = 0.4  # grey levels of 255
_AHEAD = 4096
"""Steps of light that are summed at once."""


class Trace(NamedTuple):
    """Light of one lamp, step by step."""

    rows: Floats
    columns: Floats
    weight: Floats
    """Exposure that a step leaves on the spot's axis."""


class Stroke(NamedTuple):
    """Damage: points of a path."""

    rows: Floats
    columns: Floats
    weight: float
    sigma: float
    loss: bool
    """Of emulsion; else something dark lies on it."""


@dataclass(frozen=True)
class Film:
    """All of a film but its pixels."""

    case: Case
    world: World
    combinations: Floats
    """(traces, pendulums)."""
    duration: float
    offset: float
    """s from the full minute of the chronometer to the first row."""
    drive: paper.Drive
    marks: list[paper.Mark]
    geometry: paper.Geometry
    factor: int
    """Rendered pixels to one of the scan."""
    positions: Floats
    """mm across of each trace at rest."""
    dark: list[list[tuple[float, float]]]
    """Of each trace, when its lamp failed."""
    flicker: Floats
    """Period s and phase of the lamp."""
    strokes: list[Stroke]
    events: list[dict[str, Any]]
    seed: int


def combinations_of(traces: tuple[str, ...]) -> Floats:
    """Factors of the pendulums, of traces called "1" or "1-2"."""
    count = max(int(label) for name in traces for label in name.split("-"))
    out = np.zeros((len(traces), count))
    for row, name in zip(out, traces, strict=True):
        for sign, label in zip((1.0, -1.0), name.split("-"), strict=False):
            row[int(label) - 1] = sign
    return out


def expose(case: Case, random: Random) -> Film:
    """Draw what the case leaves open, swing the pendulums and run the paper."""
    duration = random.uniform(*case.duration)
    combinations = combinations_of(case.traces)
    world = swing(case, combinations, -paper.AHEAD, duration + paper.AHEAD, random)
    drive = paper.run(case, duration, random)
    offset = random.uniform(3.0, 57.0)
    marks = paper.marks(case, duration, offset, random)
    factor = max(1, math.ceil(300 / case.dpi))
    length = float(np.interp(duration, drive.times, drive.along))
    geometry, creases = paper.lay(case, length, case.dpi * factor, random)
    count = len(case.traces)
    positions = 0.5 * paper.WIDTH + case.spacing * (np.arange(count) - 0.5 * (count - 1)) + random.uniform(-2.0, 2.0)
    dark: list[list[tuple[float, float]]] = [[] for _ in range(count)]
    for begin in random.uniform(0.05, 0.9, case.blackouts) * duration:
        for lamp in range(count) if random.random() < 0.5 else [int(random.integers(count))]:
            dark[lamp].append((begin, begin + random.uniform(0.5, 4.0)))
    flicker = np.array([random.uniform(5.0, 30.0), random.uniform(0.0, 2.0 * np.pi)])
    strokes = _damage(case, geometry, random)
    return Film(
        case, world, combinations, duration, offset, drive, marks, geometry, factor, positions, dark, flicker,
        strokes, drive.events + creases, int(random.integers(2**62)),
    )  # fmt: skip


def deflection(film: Film, trace: int, times: Floats) -> Floats:
    """Place of a trace across the film, mm."""
    lever = film.case.levers_of(len(film.combinations))[trace]
    angle = film.world.angles(times) @ film.combinations[trace]
    return film.positions[trace] + (lever * np.tan(2.0 * angle) / 2.0 if film.case.tangent else lever * angle)


def path(film: Film, trace: int, times: Floats) -> tuple[Floats, Floats]:
    """Row and column of a trace at given times, px as rendered."""
    along = np.interp(times, film.drive.times, film.drive.along) + film.case.offset * trace
    return film.geometry.place(deflection(film, trace, times), along)


def _light(film: Film, trace: int) -> Trace:
    case = film.case
    fast = case.amplitudes_of(len(film.combinations))[trace] * 2.0 * np.pi / film.world.periods.min() * 1.3
    step = 0.7 * case.spot / (fast + 4.0 * case.speed)
    edges = np.arange(-paper.AHEAD, film.duration + paper.AHEAD, step)
    times = edges[:-1] + 0.5 * step
    rows, columns = path(film, trace, times)
    spans = list(film.dark[trace])
    if case.style in ("gaps", "wire"):
        spans += _shut(film)
    on = 1.0 - np.diff(paper.closed(spans, edges)) / step
    lamp = case.lamp * (case.faint if trace == len(film.combinations) - 1 else 1.0)
    lamp *= 1.0 + case.lamp_varies * np.sin(2.0 * np.pi * times / film.flicker[0] + film.flicker[1])
    dwell = case.spot * math.sqrt(2.0 * math.pi) / (_STEEP * case.speed)
    return Trace(rows, columns, lamp * on * step / dwell)


def _shut(film: Film) -> list[tuple[float, float]]:
    return [(mark.begin, mark.end) for mark in film.marks if mark.kind not in ("missing", "omitted")]


def _line(film: Film) -> Trace:
    """A lamp that does not move, beside the traces."""
    step = 0.5 * film.case.spot / film.case.speed
    times = np.arange(-paper.AHEAD, film.duration + paper.AHEAD, step)
    along = np.interp(times, film.drive.times, film.drive.along)
    rows, columns = film.geometry.place(np.full(times.size, paper.WIDTH - 8.0), along)
    dwell = film.case.spot * math.sqrt(2.0 * math.pi) / film.case.speed
    return Trace(rows, columns, np.full(times.size, step / dwell))


def _stray(film: Film) -> tuple[Grey, Grey]:
    """Exposure of each row of the film by stray light, and by the light of the marks."""
    case, rows = film.case, film.drive.along * film.geometry.ratio
    step = film.drive.times[1] - film.drive.times[0]
    gone = paper.closed(_shut(film), np.append(film.drive.times, film.drive.times[-1] + step) - 0.5 * step)
    shut = np.diff(gone) / step
    on = 1.0 - shut if case.style in ("bright lines", "wire") else np.ones_like(shut)
    out = []
    for light in (on, shut):
        whole = np.floor(rows).astype(int)
        inside = (whole >= -BLOCK) & (whole < film.geometry.height + BLOCK)
        total = np.zeros(film.geometry.height + 2 * BLOCK + 1)
        for shift, share in ((0, 1.0 - (rows - whole)), (1, rows - whole)):
            total += np.bincount(whole[inside] + BLOCK + shift, (light * share)[inside], total.size)
        # a row's centre is half a row on
        out.append(gaussian_filter1d(0.5 * (total[1:] + total[:-1]), _SLIT * film.geometry.ratio) * step)
    nominal = 1.0 / (case.speed * film.geometry.ratio)
    length = case.gap / math.hypot(case.gap, 2.5 * _SLIT / case.speed)  # of a line, blurred by the slit
    fog, line = out[0] / nominal * case.fog, out[1] / nominal / length * _LINE
    return fog.astype(np.float32), line.astype(np.float32)


def deposit(shape: tuple[int, int], rows: Floats, columns: Floats, weight: Floats, sigma: float) -> Grey:
    """Sum of Gaussian spots of given weights on their axes; pixel i has its centre at i + .5."""
    reach = math.ceil(3.6 * sigma + 0.5)
    span = np.arange(-reach, reach + 1)
    tall, wide = shape[0] + 4 * reach, shape[1] + 4 * reach
    kept = (rows >= -reach) & (rows < shape[0] + reach) & (columns >= -reach) & (columns < shape[1] + reach)
    kept &= weight != 0.0
    rows, columns, weight = rows[kept], columns[kept], weight[kept]
    out = np.zeros(tall * wide)
    for cut in range(0, rows.size, _AHEAD):
        piece = slice(cut, cut + _AHEAD)
        row, column = np.floor(rows[piece]).astype(np.int32), np.floor(columns[piece]).astype(np.int32)
        along = np.exp(-0.5 * ((row + 0.5 - rows[piece])[:, None] + span) ** 2 / sigma**2) * weight[piece, None]
        across = np.exp(-0.5 * ((column + 0.5 - columns[piece])[:, None] + span) ** 2 / sigma**2)
        first = int(row.min()) + reach
        last = int(row.max()) + 3 * reach + 1
        index = ((row[:, None] + 2 * reach - first + span) * wide)[:, :, None] + (column[:, None] + 2 * reach + span)[
            :, None
        ]
        value = along[:, :, None] * across[:, None]
        out[first * wide : last * wide] += np.bincount(index.ravel(), value.ravel(), (last - first) * wide)
    inner = slice(2 * reach, -2 * reach)
    return out.reshape(tall, wide)[inner, inner].astype(np.float32)


def _damage(case: Case, geometry: paper.Geometry, random: Random) -> list[Stroke]:
    scale = geometry.ratio * paper.INCH / 300.0
    height, width = geometry.height, geometry.width

    def curve(length: float, bend: float, heading: float) -> tuple[Floats, Floats]:
        """A path of half pixels whose heading drifts."""
        turns = np.cumsum(random.normal(0.0, bend / math.sqrt(scale), int(2.0 * length * scale)))
        turns = heading + gaussian_filter1d(turns, 10.0 * scale)
        row, column = random.uniform(0.0, height), random.uniform(0.05, 0.95) * width
        return row + 0.5 * np.cumsum(np.cos(turns)), column + 0.5 * np.cumsum(np.sin(turns))

    hairs = [curve(random.uniform(80.0, 600.0), 0.03, random.uniform(0.0, 7.0)) for _ in range(case.hairs)]
    out = [Stroke(*hair, 0.4, 0.9 * scale, False) for hair in hairs]
    for _ in range(case.scratches):
        rows, columns = curve(random.uniform(200.0, 2500.0), 0.0005, random.normal(0.0, 0.02))
        out.append(Stroke(rows, columns, 0.5, 0.7 * scale, True))
    for _ in range(case.writing):
        row, column = random.uniform(0.02, 0.9) * height, random.uniform(0.1, 0.6) * width
        phase = np.arange(0.0, 6.0 * random.integers(3, 9), 0.01)
        letters = gaussian_filter1d(random.normal(0.0, 1.0, phase.size), 40.0)
        tall = 25.0 * (np.sin(phase) + 6.0 * letters) * scale
        wide = (9.0 * phase + 14.0 * np.cos(phase)) * scale
        out.append(Stroke(row + tall, column + wide, 0.6, 1.8 * scale, False))
    for dark in (True, False):
        count = case.dust // 2
        spots = random.uniform(0.0, height, count), random.uniform(0.0, width, count)
        for sigma in (0.6, 1.0, 1.8):
            chosen = slice(int(count * (sigma - 0.6) / 1.8), int(count * min(sigma * 0.6, 1.0)))
            out.append(Stroke(spots[0][chosen], spots[1][chosen], 1.5, sigma * scale, not dark))
    return [stroke for stroke in out if stroke.rows.size]


def blocks(film: Film) -> Iterator[Grey]:
    """Grey levels 0 to 1 of the scan, BLOCK rendered rows at a time; dark is little."""
    case, geometry = film.case, film.geometry
    scale = geometry.ratio * paper.INCH / 300.0
    lights = [_light(film, trace) for trace in range(len(film.combinations))]
    if case.reference == "line":
        lights.append(_line(film))
    fog, line = _stray(film)
    halo = case.halo_radius * scale
    margin = 6 + math.ceil(3.0 * halo if case.halo else 3.0 * case.clump)
    height = geometry.height - geometry.height % film.factor

    @lru_cache(3)
    def noise(block: int) -> Grey:
        random = np.random.default_rng([film.seed, block + 1])
        return random.standard_normal((BLOCK, geometry.width), dtype=np.float32)

    for first in range(0, height, BLOCK - BLOCK % film.factor):
        last = min(first + BLOCK - BLOCK % film.factor, height)
        top, shape = first - margin, (last - first + 2 * margin, geometry.width)
        exposure = _across(film, fog, line, top, shape)
        for light in lights:
            exposure += _within(light.rows, light.columns, light.weight, top, shape, case.spot * geometry.ratio)
        if case.halo:
            exposure += case.halo * gaussian_filter(exposure, halo, truncate=2.5)
        density = case.density * -np.expm1(-np.power(np.maximum(exposure, 0.0), np.float32(case.gamma))) + np.float32(
            _BASE
        )
        for stroke in film.strokes:
            covered = _within(
                stroke.rows, stroke.columns, np.full(stroke.rows.size, stroke.weight), top, shape, stroke.sigma
            )
            covered = -np.expm1(-2.0 * covered)
            density = density * (1.0 - 0.9 * covered) if stroke.loss else density + 1.3 * covered
        grain = _grain(noise, top, shape[0], case.clump * scale)
        density += np.float32(case.grain * scale) * np.sqrt(np.maximum(density, 0.0)) * grain
        clear = np.power(np.float32(10.0), -density)
        if case.reference == "edge":
            clear = _bed(geometry, clear, top)
        clear = gaussian_filter(clear, _BLUR * film.factor, truncate=3.0)[margin:-margin]
        if film.factor > 1:
            tall, wide = clear.shape[0] // film.factor, clear.shape[1] // film.factor
            cut = clear[: tall * film.factor, : wide * film.factor]
            clear = cut.reshape(tall, film.factor, wide, film.factor).mean((1, 3))
        chance = np.random.default_rng([film.seed, 0, first])
        readout = np.float32(_READOUT / 255.0) * chance.standard_normal(clear.shape, dtype=np.float32)
        yield (case.span / 255.0 * clear + np.float32(case.black / 255.0)) + readout


def _within(rows: Floats, columns: Floats, weight: Floats, top: int, shape: tuple[int, int], sigma: float) -> Grey:
    """What falls on a block, of light in order of time or of a stroke."""
    near = np.flatnonzero((rows > top - 6.0 * sigma) & (rows < top + shape[0] + 6.0 * sigma))
    if not near.size:
        return np.zeros(shape, np.float32)
    return deposit(shape, rows[near] - top, columns[near], weight[near], sigma)


def _across(film: Film, fog: Grey, line: Grey, top: int, shape: tuple[int, int]) -> Grey:
    """Exposure by what reaches across the film, slanting with it."""
    sine, cosine = math.sin(film.geometry.skew), math.cos(film.geometry.skew)
    columns = np.arange(shape[1]) + 0.5 - 0.5 * film.geometry.width
    lit = np.zeros(shape[1], np.float32)
    if film.case.style == "dark lines":
        lit[:] = 1.0
    elif film.case.style == "edge":
        edge = film.geometry.margin + np.array([2.0, 6.0]) * film.geometry.across
        lit[int(edge[0]) : int(edge[1])] = 1.0
    rows = np.arange(shape[0]) + 0.5 + top + BLOCK - 0.5  # entry BLOCK holds the first row's centre
    if not sine:
        at = rows.astype(int)
        return fog[at][:, None] + line[at][:, None] * lit
    middle = 0.5 * film.geometry.height + BLOCK - 0.5
    slanted = (middle + (rows[:, None] - middle) * cosine + sine * columns).ravel()
    index = np.arange(fog.size)
    both = [np.interp(slanted, index, values).reshape(shape).astype(np.float32) for values in (fog, line)]
    return both[0] + both[1] * lit


def _grain(noise: Any, top: int, count: int, clump: float) -> Grey:
    """Noise of unit variance, the same wherever the blocks are cut."""
    first, last = top // BLOCK, (top + count - 1) // BLOCK
    rows = np.concatenate([noise(block) for block in range(first, last + 1)])
    rows = rows[top - first * BLOCK : top - first * BLOCK + count]
    if not clump:
        return rows
    smooth = gaussian_filter(rows, clump, truncate=3.0)
    impulse = np.zeros(65)
    impulse[32] = 1.0
    return smooth / np.float32(np.sum(gaussian_filter1d(impulse, clump, truncate=3.0) ** 2))


def _bed(geometry: paper.Geometry, clear: Grey, top: int) -> Grey:
    """White beside the paper."""
    rows = np.arange(top, top + clear.shape[0]) + 0.5
    columns = np.arange(clear.shape[1]) + 0.5
    along = np.arange(-geometry.height // 8, geometry.height * 9 // 8) / geometry.ratio
    left, right = (np.interp(rows, *geometry.place(np.full(along.size, x), along)) for x in (0.0, paper.WIDTH))
    outside = np.clip(left[:, None] - columns + 0.5, 0.0, 1.0) + np.clip(columns - right[:, None] + 0.5, 0.0, 1.0)
    return clear + (1.0 - clear) * outside.astype(np.float32)
