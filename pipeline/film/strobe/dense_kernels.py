"""Dense bands of slow films: a few swings of a trace fitted to the film as one curve.

Over two swings or so a trace is `P(x) + C(x) cos wr + S(x) sin wr` with polynomials P, C, S of the place x in the
block: drift and swell, amplitude and phase with what the paper's speed does to it. The whole block is drawn, strokes
beside each other and all, and compared with the film; at points along the curve what is left tells how far the line
lies to one side, and least squares make of it a better curve (Gauss-Newton with the strokes' overlap left out of the
Hessian).
"""

from __future__ import annotations

import math

import numpy as np

from pipeline.arrays import Floats
from pipeline.film.marks.curve_kernels import draw, look
from pipeline.film.marks.shading_kernels import solve
from synth.kernels.compiled import kernel

CUBIC, QUADRATIC = 4, 3
SIZE = CUBIC + 2 * QUADRATIC
DRAW, POINT = 1.0, 2.0  # spots between spots drawn, and between points measured
ACROSS = 3  # places to either side of the line
DIMMEST, BRIGHTEST = 0.5, 1.7  # of the block's light, of a point that counts: gaps and dust do not
FARTHEST = 2.0  # spots that a point may lie beside the line


@kernel
def swing(shape: Floats, middle: float, half: float, turn: float, row: float) -> tuple[float, float]:
    """Column and slope of a block's curve."""
    x = (row - middle) / half
    cos, sin = math.cos(turn * (row - middle)), math.sin(turn * (row - middle))
    p = shape[0] + x * (shape[1] + x * (shape[2] + x * shape[3]))
    dp = shape[1] + x * (2.0 * shape[2] + x * 3.0 * shape[3])
    c, dc = shape[4] + x * (shape[5] + x * shape[6]), shape[5] + x * 2.0 * shape[6]
    s, ds = shape[7] + x * (shape[8] + x * shape[9]), shape[8] + x * 2.0 * shape[9]
    slope = (dp + dc * cos + ds * sin) / half + turn * (s * cos - c * sin)
    return p + c * cos + s * sin, slope


@kernel
def fit_block(
    exposure: Floats,
    first: int,
    shape: Floats,
    middle: float,
    half: float,
    turn: float,
    spot: float,
    brightest: float,
    room: Floats,
    rounds: int,
    canvas: Floats,
    quality: Floats,
) -> None:
    """Better a block's curve.

    Parameters
    ----------
    exposure : (rows, columns) float32 array
        A piece of film that begins with row `first`.
    shape : (SIZE,) array
        P, C and S by powers of x; overwritten.
    middle, half, turn : float
        Row of the block's middle, half its rows, circular frequency of the swing by rows.
    brightest : float
        Exposure from which the film is saturated: what is brighter, there or drawn, counts as just as bright.
    room : (SIZE,) array
        1 sigma of what the shape may differ from where it began, px.
    canvas : (rows, columns) array
        To draw on, at least as large as the block's surroundings.
    quality : (3,) array
        Overwritten: light of the line over that of its slope, mean square of the points' distances, px2, share of
        points that count.
    """
    start = shape.copy()
    normal, right, basis = np.empty((SIZE, SIZE)), np.empty(SIZE), np.empty(SIZE)
    light, reach = 1.0, 4.0 * spot
    quality[:] = 0.0
    for _ in range(rounds):
        low, high = 1e9, -1e9
        row = middle - half
        while row <= middle + half:
            column, _slope = swing(shape, middle, half, turn, row)
            low, high = min(low, column), max(high, column)
            row += 0.5
        top = max(math.floor(middle - half - reach), first)
        left = max(math.floor(low - reach), 0)
        rows = min(math.ceil(middle + half + reach), first + exposure.shape[0]) - top
        columns = min(math.ceil(high + reach), exposure.shape[1]) - left
        if rows < 8 or columns < 8 or rows > canvas.shape[0] or columns > canvas.shape[1]:
            quality[:] = 0.0
            return
        line = canvas[:rows, :columns]
        line[:] = 0.0
        row = middle - half - reach
        while row < middle + half + reach:
            column, slope = swing(shape, middle, half, turn, row)
            step = DRAW * spot / math.sqrt(1.0 + slope * slope)
            column, ahead = swing(shape, middle, half, turn, row + step)
            if abs(ahead) > abs(slope):  # out of a turning point the line steepens within a step
                step = DRAW * spot / math.sqrt(1.0 + ahead * ahead)
            column, slope = swing(shape, middle, half, turn, row + 0.5 * step)
            draw(line, line, line, top, left, row + 0.5 * step, column, 0.0, step, spot, False)
            row += step
        normal[:], right[:] = 0.0, 0.0
        seen_light = drawn_light = away2 = 0.0
        used = count = 0
        row = middle - half
        while row < middle + half:
            column, slope = swing(shape, middle, half, turn, row)
            steep = math.sqrt(1.0 + slope * slope)
            dr, dc = -slope / steep, 1.0 / steep
            seen = drawn = odd = gram = 0.0
            for k in range(-ACROSS, ACROSS + 1):
                n = 0.6 * spot * k
                y, x = row + n * dr, column + n * dc
                value, expected = look(exposure, first, y, x), light * look(line, top, y, x - left)
                if math.isnan(value) or math.isnan(expected):
                    continue
                profile = math.exp(-0.5 * (n / spot) ** 2) / steep
                saturated = expected > brightest
                value, expected = min(value, brightest), min(expected, brightest)
                seen += value * profile
                drawn += expected * profile / light
                lean = light * profile * n / spot**2
                odd += (value - expected) * lean
                if not saturated:
                    gram += lean * lean
            count += 1
            if drawn > 0.0 and gram > 0.0:
                share = seen / drawn
                away = odd / gram
                # while the curve is far from its line there is little light on it: its side still tells
                if count > 0 and share < BRIGHTEST * light and abs(away) < FARTHEST * spot:
                    if share > DIMMEST * light:
                        seen_light += seen * drawn
                        drawn_light += drawn * drawn
                        away2 += away * away
                        used += 1
                    weight = min(max(share / light, 0.05), 1.0)
                    x = (row - middle) / half
                    cos, sin = math.cos(turn * (row - middle)), math.sin(turn * (row - middle))
                    basis[0], basis[1], basis[2], basis[3] = 1.0, x, x * x, x * x * x
                    basis[4], basis[5], basis[6] = cos, x * cos, x * x * cos
                    basis[7], basis[8], basis[9] = sin, x * sin, x * x * sin
                    for i in range(SIZE):
                        right[i] += weight * basis[i] * away / steep
                        for j in range(i + 1):
                            normal[i, j] += weight * basis[i] * basis[j] / steep**2
            row += POINT * spot / steep
        if used < SIZE:
            quality[0], quality[2] = 0.0, 0.0
            return
        for i in range(SIZE):
            for j in range(i):
                normal[j, i] = normal[i, j]
            normal[i, i] += 0.2 / room[i] ** 2
            right[i] -= 0.2 * (shape[i] - start[i]) / room[i] ** 2
        if not solve(normal, right, SIZE):
            quality[0], quality[2] = 0.0, 0.0
            return
        for i in range(SIZE):
            shape[i] += right[i]
        light = max(seen_light / drawn_light, 0.05)
        quality[0], quality[1], quality[2] = light, away2 / used, used / count
