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
from pipeline.film.marks.curve_kernels import place
from pipeline.film.tracking.motion import solve
from synth.kernels.compiled import kernel

CUBIC, QUADRATIC = 4, 3
SIZE = CUBIC + 2 * QUADRATIC
DRAW, REACH = 1.4, 3.0  # spots between spots drawn: their sum is even to 1e-4; spots, beyond which there is no light
POINT, COARSE = 2.0, 4.0  # spots between points measured, at last and as long as the curve still moves
NEAR, SETTLED = 0.3, 0.02  # px, of the shape's last step, from which points lie close, and from which it stays
PRIOR = 0.2  # weight of a shape's first guess, against points px from it
NODES = 40  # a swing, between which the curve is cubic: to 2e-6 of the amplitude
EDGE = 6.0  # spots of a block's line that are drawn beyond its ends
ACROSS, APART = 3, 0.6  # places to either side of the line, and spots between them
DIMMEST, BRIGHTEST = 0.5, 1.7  # of the block's light, of a point that counts: gaps and dust do not
FARTHEST = 2.0  # spots that a point may lie beside the line


def nodes(half: float, spot: float) -> int:
    """Number of nodes of a block's curve: from `EDGE` spots before its `half` rows to as far behind them."""
    return 2 * math.ceil(NODES * (1.0 + EDGE * spot / half)) + 1


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
def tabulate(shape: Floats, half: float, turn: float, course: Floats, slope: Floats) -> None:
    """Columns of a block's curve, and their growth from node to node, at nodes evenly about its middle."""
    for k in range(course.size):
        away = (k - 0.5 * (course.size - 1)) * half / NODES
        course[k], lean = swing(shape, 0.0, half, turn, away)
        slope[k] = lean * half / NODES


@kernel
def draw_curve(
    canvas: Floats, rows: int, columns: int, row: float, left: float, scale: float, course: Floats, slope: Floats,
    spot: float, across: Floats,
) -> None:  # fmt: skip
    """Draw the line of a tabulated curve on the first rows and columns of a canvas, which are blanked before.

    Parameters
    ----------
    row, left, scale : float
        Row of the first node and column of the film, on the canvas; rows from node to node.
    across : (columns,) array
        Work.
    """
    for k in range(rows):
        canvas[k, :columns] = 0.0
    far = -0.5 / (spot * spot)
    turn, reach, at, last_node = math.exp(2.0 * far), REACH * spot, 0.5, course.size - 0.5
    while True:
        _column, lean = place(course, slope, at)
        step = DRAW * spot / math.sqrt(scale * scale + lean * lean)
        _column, ahead = place(course, slope, min(at + step, last_node - 1e-9))
        if abs(ahead) > abs(lean):  # out of a turning point the line steepens within a step
            step = DRAW * spot / math.sqrt(scale * scale + ahead * ahead)
        column, lean = place(course, slope, at + 0.5 * step)
        at += step
        if not at < last_node:
            break
        column -= left
        y = row + (at - 0.5 * step - 0.5) * scale
        first, last = max(0, math.ceil(y - reach - 0.5)), min(rows - 1, math.floor(y + reach - 0.5))
        low, high = max(0, math.ceil(column - reach - 0.5)), min(columns - 1, math.floor(column + reach - 0.5))
        if first > last or low > high:
            continue
        away, down = low + 0.5 - column, first + 0.5 - y
        value, ratio = math.exp(far * away * away), math.exp(far * (2.0 * away + 1.0))
        for x in range(high - low + 1):
            across[x] = value
            value *= ratio
            ratio *= turn
        line = step * scale * math.exp(far * down * down) / (2.5066282746310002 * spot)
        fall = math.exp(far * (2.0 * down + 1.0))
        for k in range(first, last + 1):
            part = canvas[k, low : high + 1]
            for x in range(part.size):
                part[x] += line * across[x]
            line *= fall
            fall *= turn


@kernel
def fit_block(
    exposure: Floats,
    first: int,
    shape: Floats,
    middle: float,
    half: float,
    turn: float,
    spot: float,
    gain: float,
    brightest: float,
    room: Floats,
    rounds: int,
    canvas: Floats,
    course: Floats,
    slope: Floats,
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
    gain : float
        Exposure on the axis of a line at rest, about.
    brightest : float
        Exposure from which the film is saturated: what is brighter, there or drawn, counts as just as bright.
    room : (SIZE,) array
        1 sigma of what the shape may differ from where it began, px.
    canvas : (rows, columns) array
        To draw on, at least as large as the block's surroundings.
    course, slope : (nodes,) arrays
        Overwritten by the curve (see `tabulate`).
    quality : (3,) array
        Overwritten: light of the line over that of its slope, mean square of the points' distances, px2, share of
        points that count.
    """
    start = shape.copy()
    normal, right, basis = np.empty((SIZE, SIZE)), np.empty(SIZE), np.empty(SIZE)
    across, profiles = np.empty(canvas.shape[1]), np.empty(2 * ACROSS + 1)
    for k in range(profiles.size):
        profiles[k] = math.exp(-0.5 * (APART * (k - ACROSS)) ** 2)
    light, reach, pace = gain, 4.0 * spot, COARSE
    node = half / NODES
    begin = middle - 0.5 * (course.size - 1) * node
    quality[:] = 0.0
    for turned in range(rounds):
        tabulate(shape, half, turn, course, slope)
        low, high = 1e9, -1e9
        for k in range(course.size):
            if abs(begin + k * node - middle) <= half:
                low, high = min(low, course[k]), max(high, course[k])
        top = max(math.floor(middle - half - reach), first)
        left = max(math.floor(low - reach), 0)
        rows = min(math.ceil(middle + half + reach), first + exposure.shape[0]) - top
        columns = min(math.ceil(high + reach), exposure.shape[1]) - left
        if rows < 8 or columns < 8 or rows > canvas.shape[0] or columns > canvas.shape[1]:
            quality[:] = 0.0
            return
        draw_curve(canvas, rows, columns, begin - top, left, node, course, slope, spot, across)
        normal[:], right[:] = 0.0, 0.0
        seen_light = drawn_light = away2 = 0.0
        used = count = 0
        row = middle - half
        while row < middle + half:
            column, lean = place(course, slope, (row - begin) / node + 0.5)
            lean /= node
            steep = math.sqrt(1.0 + lean * lean)
            dr, dc = -lean / steep, 1.0 / steep
            seen = drawn = odd = gram = 0.0
            for k in range(2 * ACROSS + 1):
                n = APART * spot * (k - ACROSS)
                y, x = row + n * dr - 0.5 - top, column + n * dc - 0.5 - left
                i, j = math.floor(y), math.floor(x)
                if i < 0 or j < 0 or i + 1 >= rows or j + 1 >= columns:
                    continue
                a, b, fi, fj = y - i, x - j, i + top - first, j + left
                upper = exposure[fi, fj] + b * (exposure[fi, fj + 1] - exposure[fi, fj])
                lower = exposure[fi + 1, fj] + b * (exposure[fi + 1, fj + 1] - exposure[fi + 1, fj])
                value = upper + a * (lower - upper)
                upper = canvas[i, j] + b * (canvas[i, j + 1] - canvas[i, j])
                lower = canvas[i + 1, j] + b * (canvas[i + 1, j + 1] - canvas[i + 1, j])
                expected = light * (upper + a * (lower - upper))
                profile = profiles[k] / steep
                saturated = expected > brightest
                value, expected = min(value, brightest), min(expected, brightest)
                seen += value * profile
                drawn += expected * profile / light
                side = light * profile * n / spot**2
                odd += (value - expected) * side
                if not saturated:
                    gram += side * side
            count += 1
            if drawn > 0.0 and gram > 0.0:
                share = seen / drawn
                away = odd / gram
                # while the curve is far from its line there is little light on it: its side still tells
                if share < BRIGHTEST * light and abs(away) < FARTHEST * spot:
                    if share > DIMMEST * light:
                        seen_light += seen * drawn
                        drawn_light += drawn * drawn
                        away2 += away * away
                        used += 1
                    weight = min(max(share / light, 0.05), 1.0) / steep
                    x = (row - middle) / half
                    cos, sin = math.cos(turn * (row - middle)), math.sin(turn * (row - middle))
                    basis[0], basis[1], basis[2], basis[3] = 1.0, x, x * x, x * x * x
                    basis[4], basis[5], basis[6] = cos, x * cos, x * x * cos
                    basis[7], basis[8], basis[9] = sin, x * sin, x * x * sin
                    for i in range(SIZE):
                        scaled = weight * basis[i]
                        right[i] += scaled * away
                        for j in range(i + 1):
                            normal[i, j] += scaled * basis[j] / steep
            row += pace * spot / steep
        if used < SIZE:
            quality[0], quality[2] = 0.0, 0.0
            return
        for i in range(SIZE):
            for j in range(i):
                normal[j, i] = normal[i, j]
            normal[i, i] += PRIOR * POINT / pace / room[i] ** 2
            right[i] -= PRIOR * POINT / pace * (shape[i] - start[i]) / room[i] ** 2
        if not solve(normal, right, SIZE):
            quality[0], quality[2] = 0.0, 0.0
            return
        moved = 0.0
        for i in range(SIZE):
            shape[i] += right[i]
            moved = max(moved, abs(right[i]))
        light = max(seen_light / drawn_light, 0.05 * gain)
        quality[0], quality[1], quality[2] = light, away2 / used, used / count
        if pace == POINT and moved < SETTLED:
            break
        if moved < NEAR or turned + 2 >= rounds:
            pace = POINT
