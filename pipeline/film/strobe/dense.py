"""Traces and emulsion of a slow film, whose swings lie so close that rows do not show lines one by one.

Such films are read at the marks alone; the traces say where their gaps are searched. The film is cut into blocks of two
swings, each half over the next. The mean place of each row's light gives a block's first curve, independent of the
other blocks; the curve is then fitted to the film, and neighbouring blocks are blended. Blocks that do not lie on a
line, or not where their neighbours lead, are left out.

The curves also give the light of each pixel, and the pixels' darkness against it is the characteristic curve. It is
fitted to some blocks, twice: the first time with a curve guessed from the darkest pixels.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats
from pipeline.film.emulsion import FilmEmulsion, ToneCurve, bounded_growth, plain_emulsion, shown_darkness
from pipeline.film.marks.pieces import exposed
from pipeline.film.parts import Emulsion, Tracks
from pipeline.film.scan.opening import OpenScan
from pipeline.film.strobe.dense_kernels import CUBIC, NODES, SIZE, Known, draw_curve, fit_block, node_table, values
from pipeline.film.strobe.dense_survey import Survey, faintest, first_shapes, light_of, saturation, survey

APART = 1.0  # spots across the line, by which two blocks may differ in the middle between them
BETWEEN = 9  # places at which they are compared
GAP, LOST = 1, 32  # of the record's flags
PIECE = 1024  # rows read at once
BESIDE = 0.5  # of a band's width on either side, in which its light is searched
ROOM = np.array([15.0, 15.0, 10.0, 5.0, 12.0, 8.0, 3.0, 12.0, 8.0, 3.0])  # px, of a shape about its first guess
ROUNDS = 3
LIT, DIM = 0.5, 0.06  # share of points lit, and light over the rows', from which a block is believed
SMALLEST = 6.0  # spots, of the swing's amplitude
ALIKE = 0.15  # of the swing, by which it may change from block to block
RETRIES = 3  # from the neighbours' swing
AROUND = 10  # blocks on either side that give the usual swing
LEAST_READ = 0.5  # of the blocks
USUAL_SPOT = 1.2  # px: 0.1 mm at 300 dpi
PLACES, RUN = 10, 3  # runs of blocks to which the curve is fitted, spread over the film, and blocks in each
TURNS, UNIT_TURNS = 2, 4
PIECES, ROWS = 4, 256  # pieces, and rows in each, in which the darkest pixels are searched
DARKEST, SHARE = 1.08, 2e-4  # of the film's darkest pixels, that endless light makes; share of them
STEPS, FAINTEST = 24, 0.01  # of light, over the brightest, at which darkness is compared
LEAST_PIXELS, LEAST_STEPS = 30, 8
PRIOR = np.array([0.1, 3.0, 0.15])  # 1 sigma of the guessed curve's darkest, middle and contrast, relative
SURE = 0.02  # of darkness, and of the darkest, 1 sigma of a step's
SHADES = np.linspace(0.3, 1.0, 8)  # of the darkest pixel, between which grain is estimated


@dataclass(frozen=True)
class Blocks:
    """Curves of all traces, block by block."""

    middle: Floats  # (blocks,), rows
    shape: Floats  # (traces, blocks, SIZE)
    light: Floats  # (traces, blocks), of the line; 0 where the block is not believed
    period: float  # rows in a swing, by which blocks reach to either side of their middles

    @staticmethod
    def empty(traces: int, rows: int, period: float) -> Blocks:
        """Blocks over a film of which nothing is known yet."""
        middle: Floats = np.asarray((np.arange(int(rows / period - 0.4)) + 0.7) * period, dtype=np.float64)
        return Blocks(middle, np.zeros((traces, middle.size, SIZE)), np.zeros((traces, middle.size)), period)


def dense_tracks(scan: OpenScan, emulsion: Emulsion, count: int | None) -> Tracks:
    """Courses of all traces, `count` if known, of a slow film whose bands lie side by side; no readings by rows.

    Raises
    ------
    RefusedError
        No swinging band was found, fewer than were expected, or most of one cannot be followed.
    """
    spot = spot_of(scan)
    bands = survey(scan, emulsion, count)
    blocks = Blocks.empty(len(bands.bands), scan.rows, bands.period)
    follow(scan, emulsion, bands, spot, blocks)
    for band, light in zip(bands.bands, blocks.light, strict=True):
        share = float((light > 0.0).mean())
        if share < LEAST_READ:
            raise RefusedError(
                f"film: the swings in columns {band.left} to {band.right} can be followed over {100.0 * share:.0f} % "
                f"of the film, {100.0 * LEAST_READ:.0f} % are needed; give the traces' number, or cut the film"
            )
    tracks = Tracks.empty(len(blocks.shape), scan.rows, blocks.period, spot)
    for k, shape in enumerate(blocks.shape):
        kept = joined(shape, blocks.light[k], blocks.period, spot)
        tracks.course[k], tracks.slope[k], tracks.curvature[k], tracks.brightness[k] = blended(
            blocks.middle, shape, kept, blocks.period, scan.rows
        )
    tracks.qc[:] = np.where(np.isfinite(tracks.course), GAP, LOST)
    return tracks


def spot_of(scan: OpenScan) -> float:
    """1 sigma of the usual spot, px."""
    return USUAL_SPOT if scan.scale is None else 0.1 / scan.scale


def windows(bands: Survey, columns: int) -> list[tuple[int, int]]:
    """Columns in which the light of each band is searched: half way to the next band at most."""
    half_way = [0, *((a.right + b.left) // 2 for a, b in pairwise(bands.bands)), columns]
    room = [int(BESIDE * (band.right - band.left)) for band in bands.bands]
    return [
        (max(left, band.left - beside), min(right, band.right + beside))
        for band, beside, (left, right) in zip(bands.bands, room, pairwise(half_way), strict=True)
    ]


def follow(scan: OpenScan, emulsion: Emulsion, bands: Survey, spot: float, blocks: Blocks) -> None:
    """Fit every block, piece by piece of the film, and overwrite its shape and light."""
    period = bands.period
    canvas = np.empty((int(2.0 * period + 12.0 * spot) + 8, scan.columns))
    brightest, table, least = saturation(emulsion), node_table(period, spot), faintest(emulsion)
    margin = int(period + 8.0 * spot) + 2
    for begin in range(0, scan.rows, PIECE):
        here = np.flatnonzero((blocks.middle >= begin) & (blocks.middle < begin + PIECE))
        if here.size == 0:
            continue
        first = max(begin - margin, 0)
        piece = exposed(scan, emulsion, first, min(begin + PIECE + margin, scan.rows))
        for trace, (left, right) in enumerate(windows(bands, scan.columns)):
            light, column = light_of(piece, left, right, least)
            shapes, residual = first_shapes(light, column, first, blocks.middle[here], period, spot)
            at = here[np.isfinite(residual)]
            if at.size:
                blocks.shape[trace, at] = shapes[np.isfinite(residual)]
                known = Known(period, spot, line_light(light, spot), brightest, ROOM, table, canvas)
                _fit(piece, first, blocks, trace, at, known)


def line_light(light: Floats, spot: float) -> float:
    """Exposure on the axis of a line at rest that leaves such light in each row."""
    lit = light[light > 0.0]
    return float(np.median(lit) / (np.sqrt(2.0 * np.pi) * spot)) if lit.size else 1.0


def _fit(
    piece: NDArray[np.float32], first: int, blocks: Blocks, trace: int, at: NDArray[np.int64], known: Known
) -> None:
    """Fit blocks of one trace to a piece of film; those that do not swing as their neighbours do a second time."""
    shapes, light = blocks.shape[trace], blocks.light[trace]

    def fit(block: int) -> None:
        tried = shapes[block].copy()
        lit, share = fit_block(piece, first, tried, blocks.middle[block], known, ROUNDS)
        swing = np.hypot(tried[CUBIC], tried[CUBIC + 3])
        light[block] = 0.0
        if share > LIT and lit > DIM * known.gain and swing > SMALLEST * known.spot:
            shapes[block], light[block] = tried, lit

    start = shapes[at].copy()
    for block in at:
        fit(int(block))
    for turn in range(RETRIES + 1):
        usual = usual_swing(shapes[at], light[at] > 0.0)
        odd = unlike(shapes[at], usual) | (light[at] <= 0.0)
        for k in np.flatnonzero(odd & np.isfinite(usual[:, 0])):
            light[at[k]] = 0.0
            if turn < RETRIES:
                shapes[at[k]] = start[k]
                shapes[at[k], CUBIC:] = 0.0
                shapes[at[k], [CUBIC, CUBIC + 3]] = usual[k]
                fit(int(at[k]))


def usual_swing(shapes: Floats, good: NDArray[np.bool_]) -> Floats:
    """The swing of the good blocks around each, the middle one of them, (blocks, 2): cosine and sine, px."""
    pair = np.where(good[:, None], shapes[:, [CUBIC, CUBIC + 3]], np.nan)
    padded = np.pad(pair, ((AROUND, AROUND), (0, 0)), constant_values=np.nan)
    around = np.lib.stride_tricks.sliding_window_view(padded, 2 * AROUND + 1, axis=0)
    some = np.isfinite(around[:, 0]).sum(axis=1) >= 3
    out = np.full_like(pair, np.nan)
    out[some] = np.nanmedian(around[some], axis=2)
    return out


def unlike(shapes: Floats, usual: Floats) -> NDArray[np.bool_]:
    """Which blocks swing otherwise than their neighbours."""
    apart = np.hypot(*(shapes[:, [CUBIC, CUBIC + 3]] - usual).T)
    return np.asarray(apart > ALIKE * np.hypot(*usual.T))


def joined(shape: Floats, light: Floats, period: float, spot: float) -> Floats:
    """Light of the blocks, 0 also for those that lie beside both their neighbours, or beside one and have no other."""
    away = np.linspace(0.25, 0.75, BETWEEN) * period
    good = light > 0.0
    before, after = values(shape[:-1, None], away, period), values(shape[1:, None], away - period, period)
    across = np.median(np.abs(before[0] - after[0]) / np.sqrt(1.0 + before[1] ** 2), axis=1)
    agree = np.concatenate([[False], good[:-1] & good[1:] & (across < APART * spot), [False]])
    return np.where(good & (agree[:-1] | agree[1:]), light, 0.0)


def blended(middle: Floats, shape: Floats, light: Floats, period: float, rows: int) -> Floats:
    """Course, slope, curvature and light by rows, (4, rows); NaN where no block is good."""
    at = np.arange(rows) + 0.5
    before = np.floor((at - middle[0]) / period).astype(np.int64)  # the block whose middle is the last one passed
    first, second = np.clip(before, 0, middle.size - 1), np.clip(before + 1, 0, middle.size - 1)
    x = (at - middle[0]) / period - before
    known, next_known = (light[first] > 0.0) & (before >= 0), (light[second] > 0.0) & (before + 1 < middle.size)
    # alone, a block counts in full
    both = known & next_known
    weight = np.where(both, x * x * (3.0 - 2.0 * x), np.where(known, 0.0, 1.0))
    lean = np.where(both, 6.0 * x * (1.0 - x) / period, 0.0)
    bend = np.where(both, (6.0 - 12.0 * x) / period**2, 0.0)
    here, there = values(shape[first], at - middle[first], period), values(shape[second], at - middle[second], period)
    apart = there - here
    lit = light[first] + weight * (light[second] - light[first])
    out = np.stack([*(here + weight * apart), lit])
    out[1] += lean * apart[0]
    out[2] += 2.0 * lean * apart[1] + bend * apart[0]
    near = (known & (x <= 1.0)) | (next_known & (np.abs(at - middle[second]) <= period))
    out[:, ~near] = np.nan
    return out


def dense_emulsion(scan: OpenScan, count: int | None) -> FilmEmulsion:
    """Blank film, grain and characteristic curve of a slow film with `count` traces, if known.

    Raises
    ------
    RefusedError
        It shows no swinging bands, or others than were expected.
    """
    spot = spot_of(scan)
    emulsion = _guessed(scan)
    bands = survey(scan, emulsion, count)
    emulsion = _in_unit(scan, emulsion, bands, spot)
    for _ in range(TURNS):
        light, dark = lights(scan, emulsion, bands, spot)
        curve = fitted_curve(light, dark, emulsion.curve)
        if curve is None:
            break
        blank = float(emulsion.grain[0])
        growth = grain_growth(dark, curve.darkness(light), blank)
        emulsion = replace(emulsion, curve=curve, grain=np.array([blank, growth]))
    return emulsion


def _guessed(scan: OpenScan) -> FilmEmulsion:
    """The emulsion as the darkest pixels of some sections suggest it: turning points of slow films are saturated."""
    plain = plain_emulsion(scan)
    darkest = [float(np.quantile(shown_darkness(plain, scan, *each), 1.0 - SHARE)) for each in _pieces(scan)]
    least = 3.0 * float(np.sqrt(plain.grain[0]))
    return replace(plain, curve=replace(plain.curve, darkest=max(DARKEST * float(np.median(darkest)), least)))


def _pieces(scan: OpenScan) -> list[tuple[int, int]]:
    """First rows, and those behind the last, of some pieces."""
    height = min(ROWS, scan.rows)
    firsts = np.linspace(0, scan.rows - height, PIECES + 2).astype(int)[1:-1]
    return [(int(first), int(first) + height) for first in firsts]


def _in_unit(scan: OpenScan, emulsion: FilmEmulsion, bands: Survey, spot: float) -> FilmEmulsion:
    """The same, with about 1 as the exposure on the axis of a line at rest: every row of a trace has the same light."""
    for _ in range(UNIT_TURNS):
        gain = [
            line_light(light_of(exposure, left, right, faintest(emulsion))[0], spot)
            for exposure in (exposed(scan, emulsion, *piece) for piece in _pieces(scan))
            for left, right in windows(bands, scan.columns)
        ]
        curve = emulsion.curve
        emulsion = replace(emulsion, curve=replace(curve, middle=curve.middle / float(np.median(gain))))
    return emulsion


def lights(scan: OpenScan, emulsion: FilmEmulsion, bands: Survey, spot: float) -> tuple[Floats, Floats]:
    """Light that pixels of blocks here and there had, 1 on the axis of a line at rest, and their darkness."""
    whole = Blocks.empty(len(bands.bands), scan.rows, bands.period)
    firsts = np.linspace(0, max(whole.middle.size - RUN, 0), PLACES).astype(int)
    at = np.unique((firsts[:, None] + np.arange(RUN)).clip(max=whole.middle.size - 1))
    blocks = Blocks(whole.middle[at], whole.shape[:, at], whole.light[:, at], bands.period)
    follow(scan, emulsion, bands, spot, blocks)
    table, node, rows = node_table(bands.period, spot), bands.period / NODES, int(bands.period)
    canvas, pixels = np.empty((rows, scan.columns)), [np.empty((2, 0))]
    for trace, (left, right) in enumerate(windows(bands, scan.columns)):
        good = np.flatnonzero(blocks.light[trace] > 0.0)
        usual = float(np.median(blocks.light[trace, good])) if good.size else 1.0
        for block in good:
            top = round(blocks.middle[block] - 0.5 * rows)
            course, slope = table @ blocks.shape[trace, block]
            begin = blocks.middle[block] - 0.5 * (course.size - 1) * node - top
            draw_curve(canvas, rows, scan.columns, begin, 0.0, node, course, slope, spot)
            drawn = blocks.light[trace, block] / usual * canvas[:, left:right]
            lit = drawn > FAINTEST * drawn.max()
            dark = shown_darkness(emulsion, scan, top, top + rows)[:, left:right]
            pixels.append(np.stack([drawn[lit], dark[lit]]))
    light, dark = np.concatenate(pixels, axis=1)
    return light, dark


def fitted_curve(light: Floats, dark: Floats, guess: ToneCurve) -> ToneCurve | None:
    """The curve that pixels' darkness follows, by the medians of steps of light; None if these are too few."""
    if light.size < LEAST_PIXELS * LEAST_STEPS:
        return None
    top = float(np.quantile(light, 1.0 - SHARE))
    place = np.floor(np.log(light / (FAINTEST * top)) / -np.log(FAINTEST) * STEPS).astype(np.int64)
    full = [step for step in range(STEPS) if np.count_nonzero(place == step) >= LEAST_PIXELS]
    if len(full) < LEAST_STEPS:
        return None
    lit, shade = (np.array([np.median(each[place == step]) for step in full]) for each in (light, dark))
    # the unit of the light is another one than the guess had: where darkness is half of the darkest
    half = float(np.interp(0.5 * guess.darkest, shade, lit))
    start = np.log([guess.darkest, half, guess.contrast])

    def pulls(at: Floats) -> Floats:
        away = (shade - ToneCurve(*np.exp(at)).darkness(lit)) / (SURE * (shade + guess.darkest))
        return np.concatenate([away, (at - start) / PRIOR])

    return ToneCurve(*(float(each) for each in np.exp(least_squares(pulls, start).x)))


def grain_growth(dark: Floats, shade: Floats, blank: float) -> float:
    """Growth of a pixel's variance with its darkness; `shade` is what the curve says, `blank` that of blank film.

    Errors of the blocks' curves add to the grain, least where the film is saturated: the least growth counts.
    """
    growth = []
    for low, high in pairwise(SHADES * shade.max()):
        inside = (shade >= low) & (shade < high)
        if np.count_nonzero(inside) >= LEAST_PIXELS:
            residual = dark[inside] - shade[inside]
            spread = 1.4826 * float(np.median(np.abs(residual - np.median(residual))))
            growth.append((spread**2 - blank) / float(shade[inside].mean()))
    return bounded_growth(min(growth, default=10.0 * blank), blank)
