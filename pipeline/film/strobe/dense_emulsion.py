"""The emulsion of a slow film, told from its dense bands.

Rows of dense bands do not show their lines one by one. But a few swings fitted to the film as one curve tell how much
light each pixel had, and the pixels' darkness against it is the characteristic curve. That is told from blocks here and
there, twice: the first time with a curve guessed of the darkest pixels.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from pipeline.arrays import Floats
from pipeline.film.emulsion import FilmEmulsion, ToneCurve, plain_emulsion
from pipeline.film.marks.pieces import exposed
from pipeline.film.scan.opening import OpenScan
from pipeline.film.strobe.dense import Blocks, follow, line_light, spot_of, windows
from pipeline.film.strobe.dense_kernels import NODES, draw_curve, node_table
from pipeline.film.strobe.dense_survey import SHADE, Survey, light_of, survey
from pipeline.film.tracking.calibrate import LEAST_GROWTH, STEEPEST_GRAIN

PLACES, RUN = 10, 3  # runs of blocks, spread over the film, and blocks in each
ROUNDS = 2
PIECES, ROWS = 4, 256  # pieces, and rows in each, in which the darkest pixels are looked for
DARKEST, SHARE = 1.08, 2e-4  # of the film's darkest pixels, that endless light makes; share of them
STEPS, FAINTEST = 24, 0.01  # of light, over the brightest, at which darkness is told
LEAST_PIXELS, LEAST_STEPS = 30, 8
PRIOR = np.array([0.1, 3.0, 0.15])  # 1 sigma of the guessed curve's darkest, middle and contrast, relative
SURE = 0.02  # of darkness, and of the darkest, 1 sigma of a step's
UNIT_TURNS = 4
SHADES = np.linspace(0.3, 1.0, 8)  # of the darkest pixel, between which grain is told


def dense_emulsion(scan: OpenScan, count: int | None) -> FilmEmulsion:
    """Blank film, grain and characteristic curve of a slow film with `count` traces, if known.

    Raises
    ------
    RefusedError
        It shows no swinging bands, or others than were expected.
    """
    spot = spot_of(scan)
    emulsion = _guessed(scan)
    found = survey(scan, emulsion, count)
    emulsion = _in_unit(scan, emulsion, found, spot)
    for _ in range(ROUNDS):
        light, dark = lights(scan, emulsion, found, spot)
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
    darkest = [
        float(np.quantile(plain.darkness(scan.read(first, stop), first), 1.0 - SHARE)) for first, stop in _pieces(scan)
    ]
    least = 3.0 * float(np.sqrt(plain.grain[0]))
    return replace(plain, curve=replace(plain.curve, darkest=max(DARKEST * float(np.median(darkest)), least)))


def _pieces(scan: OpenScan) -> list[tuple[int, int]]:
    """First rows, and those behind the last, of some pieces."""
    height = min(ROWS, scan.rows)
    firsts = np.linspace(0, scan.rows - height, PIECES + 2).astype(int)[1:-1]
    return [(int(first), int(first) + height) for first in firsts]


def _in_unit(scan: OpenScan, emulsion: FilmEmulsion, found: Survey, spot: float) -> FilmEmulsion:
    """The same, with about 1 as the exposure on the axis of a line at rest: every row of a trace has the same light."""
    for _ in range(UNIT_TURNS):
        least = SHADE * float(emulsion.noise(np.zeros(1, dtype=np.float32))[0])
        gain = [
            line_light(light_of(exposure, left, right, least)[0], spot)
            for exposure in (exposed(scan, emulsion, *piece) for piece in _pieces(scan))
            for left, right in windows(found, scan.columns)
        ]
        curve = emulsion.curve
        emulsion = replace(emulsion, curve=replace(curve, middle=curve.middle / float(np.median(gain))))
    return emulsion


def lights(scan: OpenScan, emulsion: FilmEmulsion, found: Survey, spot: float) -> tuple[Floats, Floats]:
    """Light that pixels of blocks here and there had, 1 on the axis of a line at rest, and their darkness."""
    whole = Blocks.empty(len(found.bands), scan.rows, found.period)
    firsts = np.linspace(0, max(whole.middle.size - RUN, 0), PLACES).astype(int)
    at = np.unique((firsts[:, None] + np.arange(RUN)).clip(max=whole.middle.size - 1))
    blocks = Blocks(whole.middle[at], whole.shape[:, at], whole.light[:, at], found.period)
    follow(scan, emulsion, found, spot, blocks)
    table, node = node_table(found.period, spot), found.period / NODES
    rows = int(found.period)
    canvas = np.empty((rows, scan.columns))
    light: list[Floats] = [np.empty(0)]
    dark: list[Floats] = [np.empty(0)]
    for trace, (left, right) in enumerate(windows(found, scan.columns)):
        good = np.flatnonzero(blocks.light[trace] > 0.0)
        usual = float(np.median(blocks.light[trace, good])) if good.size else 1.0
        for block in good:
            top = round(blocks.middle[block] - 0.5 * rows)
            course, slope = table @ blocks.shape[trace, block]
            begin = blocks.middle[block] - 0.5 * (course.size - 1) * node - top
            draw_curve(canvas, rows, scan.columns, begin, 0.0, node, course, slope, spot)
            drawn = blocks.light[trace, block] / usual * canvas[:, left:right]
            lit = drawn > FAINTEST * drawn.max()
            light.append(drawn[lit])
            dark.append(emulsion.darkness(scan.read(top, top + rows), top)[:, left:right][lit].astype(np.float64))
    return np.concatenate(light), np.concatenate(dark)


def fitted_curve(light: Floats, dark: Floats, guess: ToneCurve) -> ToneCurve | None:
    """The curve that pixels' darkness follows, by the medians of steps of light; None if these are too few."""
    from scipy.optimize import least_squares

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
    found = []
    for low, high in pairwise(SHADES * shade.max()):
        inside = (shade >= low) & (shade < high)
        if np.count_nonzero(inside) >= LEAST_PIXELS:
            left = dark[inside] - shade[inside]
            spread = 1.4826 * float(np.median(np.abs(left - np.median(left))))
            found.append((spread**2 - blank) / float(shade[inside].mean()))
    least = min(found, default=10.0 * blank)
    return float(np.clip(least, LEAST_GROWTH, max(STEEPEST_GRAIN * blank, LEAST_GROWTH)))
