"""Traces and emulsion of a slow film, whose swings lie so close that rows do not show lines one by one.

Such films are read at the marks alone; the traces say where. Blocks of two swings, each half over the next, begin with
the mean places of the rows' light, are fitted to the film and blended; those that do not lie on a line, or not where
their neighbours lead, are left out. The pixels' darkness against the curves' light is the characteristic curve.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats, median_present
from pipeline.film.emulsion import FilmEmulsion, ToneCurve, bounded_growth, shown_darkness
from pipeline.film.marks import dense_kernels as kernels
from pipeline.film.marks.search import exposed
from pipeline.film.marks.survey import Survey, faintest, first_emulsion, inner_pieces, light_of, saturation, survey
from pipeline.film.parts import Emulsion, Tracks
from pipeline.film.scan.opening import OpenScan

APART = 1.0  # spots across the line, by which two blocks may differ in the middle between them
BETWEEN = 9  # places at which they are compared
GAP, LOST = 1, 32  # of the record's flags
PIECE = 1024  # rows read at once
LIT, DIM = 0.5, 0.06  # share of points lit, and light over the rows', from which a block is believed
SMALLEST = 6.0  # spots, of the swing's amplitude
ALIKE = 0.15  # of the swing, by which it may change from block to block
RETRIES = 3  # from the neighbours' swing
AROUND = 10  # blocks on either side that give the usual swing
SWING = [kernels.CUBIC, kernels.CUBIC + 3]  # of a shape: cosine and sine in the block's middle
LEAST_READ = 0.5  # of the blocks
PLACES, RUN = 10, 3  # runs of blocks to which the curve is fitted, spread over the film, and blocks in each
TURNS, UNIT_TURNS = 2, 4
SHARE = 2e-4  # of the pixels, that are brighter than the brightest light compared
STEPS, FAINTEST = 24, 0.01  # of light, over the brightest, at which darkness is compared
LEAST_PIXELS, LEAST_STEPS = 30, 8
PRIOR = np.array([0.1, 3.0, 0.15])  # 1 sigma of the guessed curve's darkest, middle and contrast, relative
SURE = 0.02  # of darkness, and of the darkest, 1 sigma of a step's
SHADES = np.linspace(0.3, 1.0, 8)  # of the darkest pixel, between which grain is estimated


def dense_tracks(scan: OpenScan, emulsion: Emulsion, count: int | None) -> Tracks:
    """Courses of all traces, `count` if known, of a slow film; `RefusedError`: no bands, too few, or not followed."""
    found = survey(scan, emulsion, count)
    middle = block_middles(scan.rows, found.period)
    shapes, lights = follow(scan, emulsion, found, middle)
    for (left, right), light in zip(found.bands, lights, strict=True):
        share = float((light > 0.0).mean())
        if share < LEAST_READ:
            raise RefusedError(
                f"film: the swings in columns {left} to {right} can be followed over {100.0 * share:.0f} % "
                f"of the film, {100.0 * LEAST_READ:.0f} % are needed; scan at 300 dpi or more, or cut the film"
            )
    tracks = Tracks.empty(len(shapes), scan.rows, found.period, found.spot)
    for k, (shape, light) in enumerate(zip(shapes, lights, strict=True)):
        tracks.course[k], tracks.slope[k], tracks.curvature[k], tracks.brightness[k] = blended(
            middle, shape, joined(shape, light, found.period, found.spot), found.period, scan.rows
        )
    tracks.qc[:] = np.where(np.isfinite(tracks.course), GAP, LOST)
    return tracks


def block_middles(rows: int, period: float) -> Floats:
    """Middle rows of the blocks of a film, each of which reaches a swing to either side."""
    return np.asarray((np.arange(int(rows / period - 0.4)) + 0.7) * period, dtype=np.float64)


def follow(scan: OpenScan, emulsion: Emulsion, found: Survey, middle: Floats) -> tuple[Floats, Floats]:
    """Curves (traces, blocks, SIZE) of blocks about the rows `middle`, and light of their lines; 0 if not believed."""
    period, spot, windows = found.period, found.spot, found.windows(scan.columns)
    shapes, lights = np.zeros((len(windows), middle.size, kernels.SIZE)), np.zeros((len(windows), middle.size))
    brightest, table, least = saturation(emulsion), kernels.node_table(period, spot), faintest(emulsion)
    margin = int(period + 8.0 * spot) + 2
    for begin in range(0, scan.rows, PIECE):
        here = np.flatnonzero((middle >= begin) & (middle < begin + PIECE))
        if here.size == 0:
            continue
        first = max(begin - margin, 0)
        piece = exposed(scan, emulsion, first, min(begin + PIECE + margin, scan.rows))
        for trace, window in enumerate(windows):
            light, column = light_of(piece, *window, least)
            start = kernels.first_shapes(light, column, first, middle[here], period, spot)
            lit = np.isfinite(start[:, 0])
            if lit.any():
                known = kernels.Known(period, spot, line_light(light, spot), brightest, table)
                at = here[lit]
                shapes[trace, at], lights[trace, at] = fit_blocks(piece, first, start[lit], middle[at], known)
    return shapes, lights


def line_light(light: Floats, spot: float) -> float:
    """Exposure on the axis of a line at rest that leaves such light in each row."""
    lit = light[light > 0.0]
    return float(np.median(lit) / (np.sqrt(2.0 * np.pi) * spot)) if lit.size else 1.0


def fit_blocks(
    piece: NDArray[np.float32], first: int, start: Floats, middle: Floats, known: kernels.Known
) -> tuple[Floats, Floats]:
    """Curves and lights of blocks of one trace; those that do not swing as their neighbours do are fitted again."""
    shapes, light, guess = start.copy(), np.zeros(middle.size), start.copy()
    again = np.arange(middle.size)
    for _ in range(RETRIES + 1):
        for k in again:
            tried = guess[k].copy()
            lit, share = kernels.fit_block(piece, first, tried, middle[k], known)
            if share > LIT and lit > DIM * known.gain and np.hypot(*tried[SWING]) > SMALLEST * known.spot:
                shapes[k], light[k] = tried, lit
        usual = usual_swing(shapes, light > 0.0)
        odd = unlike(shapes, usual) | (light <= 0.0)
        again = np.flatnonzero(odd & np.isfinite(usual[:, 0]))
        light[again], guess[:, kernels.CUBIC :] = 0.0, 0.0
        guess[:, SWING] = usual
    return shapes, light


def usual_swing(shapes: Floats, good: NDArray[np.bool_]) -> Floats:
    """The swing of the good blocks around each, the middle one of them, (blocks, 2): cosine and sine, px."""
    pair = np.where(good[:, None], shapes[:, SWING], np.nan)
    padded = np.pad(pair, ((AROUND, AROUND), (0, 0)), constant_values=np.nan)
    around = np.lib.stride_tricks.sliding_window_view(padded, 2 * AROUND + 1, axis=0)
    some = np.isfinite(around[:, 0]).sum(axis=1) >= 3
    out = np.full_like(pair, np.nan)
    out[some] = np.nanmedian(around[some], axis=2)
    return out


def unlike(shapes: Floats, usual: Floats) -> NDArray[np.bool_]:
    """Which blocks swing otherwise than their neighbours."""
    return np.asarray(np.hypot(*(shapes[:, SWING] - usual).T) > ALIKE * np.hypot(*usual.T))


def joined(shape: Floats, light: Floats, period: float, spot: float) -> Floats:
    """Light of the blocks, 0 also for those that lie beside both their neighbours, or beside one and have no other."""
    away = np.linspace(0.25, 0.75, BETWEEN) * period
    good = light > 0.0
    before = kernels.values(shape[:-1, None], away, period)
    after = kernels.values(shape[1:, None], away - period, period)
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
    here = kernels.values(shape[first], at - middle[first], period)
    apart = kernels.values(shape[second], at - middle[second], period) - here
    out = np.stack([*(here + weight * apart), light[first] + weight * (light[second] - light[first])])
    out[1] += lean * apart[0]
    out[2] += 2.0 * lean * apart[1] + bend * apart[0]
    near = (known & (x <= 1.0)) | (next_known & (np.abs(at - middle[second]) <= period))
    out[:, ~near] = np.nan
    return out


def dense_emulsion(scan: OpenScan, count: int | None) -> FilmEmulsion:
    """Blank film, grain and curve of a slow film with `count` traces, if known; `RefusedError`: it shows others."""
    emulsion = first_emulsion(scan)
    found, blank = survey(scan, emulsion, count), float(emulsion.grain[0])
    for _ in range(UNIT_TURNS):  # exposure about 1 on the axis of a line at rest: a trace lights every row alike
        gain = [
            line_light(light_of(exposure, *window, faintest(emulsion))[0], found.spot)
            for exposure in (exposed(scan, emulsion, *piece) for piece in inner_pieces(scan))
            for window in found.windows(scan.columns)
        ]
        middle = emulsion.curve.middle / float(np.median(gain))
        emulsion = replace(emulsion, curve=replace(emulsion.curve, middle=middle))
    for _ in range(TURNS):
        light, dark = drawn_light(scan, emulsion, found)
        curve = fitted_curve(light, dark, emulsion.curve)
        if curve is None:
            break
        grain = np.array([blank, grain_growth(dark, curve.darkness(light), blank)])
        emulsion = replace(emulsion, curve=curve, grain=grain)
    return emulsion


def drawn_light(scan: OpenScan, emulsion: FilmEmulsion, found: Survey) -> Floats:
    """Light that pixels of blocks here and there had, 1 on the axis of a line at rest, and their darkness, (2, n)."""
    period, spot = found.period, found.spot
    whole = block_middles(scan.rows, period)
    firsts = np.linspace(0, max(whole.size - RUN, 0), PLACES).astype(int)
    middle = whole[np.unique((firsts[:, None] + np.arange(RUN)).clip(max=whole.size - 1))]
    shapes, lights = follow(scan, emulsion, found, middle)
    table, node, rows = kernels.node_table(period, spot), period / kernels.NODES, int(period)
    pixels = [np.empty((2, 0))]
    for trace, (left, right) in enumerate(found.windows(scan.columns)):
        usual = median_present(np.where(lights[trace] > 0.0, lights[trace], np.nan))
        for block in np.flatnonzero(lights[trace] > 0.0):
            top = round(middle[block] - 0.5 * rows)
            course, slope = table @ shapes[trace, block]
            begin = middle[block] - 0.5 * (course.size - 1) * node - top
            drawn = np.zeros((rows, right - left))
            kernels.draw_curve(drawn, begin, left, node, course, slope, spot)
            drawn *= lights[trace, block] / usual
            lit = drawn > FAINTEST * drawn.max()
            dark = shown_darkness(emulsion, scan, top, top + rows)[:, left:right]
            pixels.append(np.stack([drawn[lit], dark[lit]]))
    return np.concatenate(pixels, axis=1)


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
    start = np.log([guess.darkest, np.interp(0.5 * guess.darkest, shade, lit), guess.contrast])

    def pulls(at: Floats) -> Floats:
        away = (shade - ToneCurve(*np.exp(at)).darkness(lit)) / (SURE * (shade + guess.darkest))
        return np.concatenate([away, (at - start) / PRIOR])

    return ToneCurve(*(float(each) for each in np.exp(least_squares(pulls, start).x)))


def grain_growth(dark: Floats, shade: Floats, blank: float) -> float:
    """Growth of a pixel's variance with darkness, the least of all shades: errors of the curves add to the grain."""
    growth = []
    for low, high in pairwise(SHADES * shade.max()):
        inside = (shade >= low) & (shade < high)
        if np.count_nonzero(inside) >= LEAST_PIXELS:
            residual = dark[inside] - shade[inside]
            spread = 1.4826 * float(np.median(np.abs(residual - np.median(residual))))
            growth.append((spread**2 - blank) / float(shade[inside].mean()))
    return bounded_growth(min(growth, default=10.0 * blank), blank)
