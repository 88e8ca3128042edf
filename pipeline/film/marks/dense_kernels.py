"""Dense bands of slow films: a few swings of a trace fitted to the film as one curve.

Over two swings or so a trace is `P(x) + C(x) cos wr + S(x) sin wr`, with polynomials P, C, S of the place x in the
block. The whole block is drawn and compared with the film; residuals along the curve give the line's distance to one
side, and least squares a better curve (Gauss-Newton), beginning from the mean places of the rows' light.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.marks.gap_kernels import look, place
from pipeline.film.tracking.motion import solve
from synth.kernels.compiled import making_kernel

CUBIC, QUADRATIC = 4, 3
SIZE = CUBIC + 2 * QUADRATIC
POINT, COARSE = 2.0, 4.0  # spots between points measured, at last and as long as the curve still moves
NEAR, SETTLED = 0.3, 0.02  # px, of the shape's last step, from which points lie close, and from which it stays
PRIOR = 0.2  # weight of a shape's first guess, against points px from it
DRAW, REACH = 1.4, 3.0  # spots between spots drawn: their sum is even to 1e-4; spots, beyond which there is no light
FITS = 3  # of a block, each with a curve drawn anew
ROOM = np.array([15.0, 15.0, 10.0, 5.0, 12.0, 8.0, 3.0, 12.0, 8.0, 3.0])  # px, of a shape about its first guess
NODES = 40  # a swing, between which the curve is cubic: to 2e-6 of the amplitude
EDGE = 6.0  # spots of a block's line that are drawn beyond its ends
ACROSS, APART = 3, 0.6  # places to either side of the line, and spots between them
DIMMEST, BRIGHTEST = 0.5, 1.7  # of the block's light, of a point that counts: gaps and dust do not
FARTHEST = 2.0  # spots that a point may lie beside the line
NOISE = 4.0  # px, 1 sigma of a row's mean place
FREEDOM = np.array([1e3, 90.0, 45.0, 20.0, 1e3, 20.0, 5.0, 1e3, 20.0, 5.0])  # px: swell as large as the swing
ROUNDS, FARTHEST_LIGHT = 4, 2.0  # NOISE or usual residuals, of a row that counts in full
DARK = 0.3  # of the usual light of a row, below which it shows nothing


def values(shape: Floats, away: NDArray[np.floating[Any]], half: float) -> Floats:
    """Column, slope and curvature of curves (..., SIZE) at `away` rows from their blocks' middles, (3, ...)."""
    x, turn = away / half, 2.0 * np.pi / half
    rotation = np.exp(1j * turn * away)
    p0, p1, p2, p3 = (shape[..., k] for k in range(CUBIC))
    z0, z1, z2 = (shape[..., CUBIC + k] - 1j * shape[..., CUBIC + 3 + k] for k in range(3))
    z, dz, ddz = z0 + x * (z1 + x * z2), (z1 + 2.0 * x * z2) / half, 2.0 * z2 / half**2
    return np.stack(
        [
            p0 + x * (p1 + x * (p2 + x * p3)) + (z * rotation).real,
            (p1 + x * (2.0 * p2 + 3.0 * x * p3)) / half + ((dz + 1j * turn * z) * rotation).real,
            (2.0 * p2 + 6.0 * x * p3) / half**2 + ((ddz + 2j * turn * dz - turn**2 * z) * rotation).real,
        ]
    )


def first_shapes(light: Floats, column: Floats, first: int, middles: Floats, period: float, spot: float) -> Floats:
    """Curves (blocks, SIZE) about the rows `middles`, by `light_of` the rows from `first` on; NaN with too few lit."""
    turn, count = 2.0 * np.pi / period, int(np.ceil(2.0 * period))
    at = np.round(middles - period).astype(np.int64)[:, None] - first + np.arange(count)
    inside = (at >= 0) & (at < light.size)
    at = np.clip(at, 0, light.size - 1)
    shown = np.where(inside & np.isfinite(column[at]), light[at], 0.0)
    usual = np.median(shown, axis=1, keepdims=True)
    trust = np.where((shown > DARK * usual) & (usual > 0.0), 1.0, 0.0)
    value = np.nan_to_num(column[at])
    level = np.sum(trust * value, axis=1) / np.maximum(trust.sum(axis=1), 1.0)
    design = np.moveaxis(values(np.eye(SIZE)[:, None, None], at + first + 0.5 - middles[:, None], period)[0], 0, -1)
    shapes, weight = np.empty(0), trust
    for _ in range(ROUNDS):
        weighed = np.swapaxes(design * weight[:, :, None], 1, 2)
        normal = weighed @ design + np.diag((NOISE / FREEDOM) ** 2)
        shapes = np.linalg.solve(normal, weighed @ (value - level[:, None])[:, :, None])
        distance = np.abs((design @ shapes)[:, :, 0] - value + level[:, None])
        limit = FARTHEST_LIGHT * np.maximum(1.4826 * np.median(distance, axis=1), NOISE)[:, None]
        weight = trust * np.minimum(1.0, limit / np.maximum(distance, 1e-9)) ** 2
    shapes = shapes[:, :, 0]
    shapes[:, 0] += level
    shapes[:, CUBIC:] *= np.exp(0.5 * (turn * spot) ** 2)  # the spot blurs the swing
    shapes[trust.sum(axis=1) < 0.7 * count] = np.nan
    return shapes


def node_table(half: float, spot: float) -> Floats:
    """Columns by shape, and their growth from node to node, (2, nodes, SIZE), to `EDGE` spots beyond `half` rows."""
    number = math.ceil(NODES * (1.0 + EDGE * spot / half))
    away = np.arange(-number, number + 1) * half / NODES
    column, slope, _ = np.moveaxis(values(np.eye(SIZE)[:, None], away, half), 1, 2)
    return np.ascontiguousarray(np.stack([column, slope * half / NODES]))


class Known(NamedTuple):
    """What is known of the blocks of a piece of film."""

    half: float  # rows of half a block, and of a swing
    spot: float
    gain: float  # exposure on the axis of a line at rest, about
    brightest: float  # exposure from which the film is saturated: what is brighter, there or drawn, counts as much
    nodes: Floats  # of `node_table`


@making_kernel
def draw_curve(
    picture: Floats, row: float, left: int, scale: float, course: Floats, slope: Floats, spot: float
) -> None:
    """Add a tabulated curve's line to a picture from column `left` on; nodes `scale` rows apart, first on `row`."""
    rows, columns = picture.shape
    across, far = np.empty(columns), -0.5 / (spot * spot)
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
            part = picture[k, low : high + 1]
            for x in range(part.size):
                part[x] += line * across[x]
            line *= fall
            fall *= turn


@making_kernel
def fit_block(
    exposure: NDArray[np.float32], first: int, shape: Floats, middle: float, known: Known
) -> tuple[float, float]:
    """Fit a block's `shape` in place: its light over that of its slope, 0 if it fails, and the share of points used."""
    half, spot, gain, brightest, _nodes = known
    turn = 2.0 * math.pi / half
    start = shape.copy()
    normal, right, basis = np.empty((SIZE, SIZE)), np.empty(SIZE), np.empty(SIZE)
    profiles = np.exp(-0.5 * (APART * np.arange(-ACROSS, ACROSS + 1)) ** 2)
    light, share_used, reach, pace = gain, 0.0, 4.0 * spot, COARSE
    node = half / NODES
    begin = middle - 0.5 * (known.nodes.shape[1] - 1) * node
    for turned in range(FITS):
        course, slope = known.nodes[0] @ shape, known.nodes[1] @ shape
        inside = course[(course.size - 1) // 2 - NODES : (course.size + 1) // 2 + NODES]
        top = max(math.floor(middle - half - reach), first)
        left = max(math.floor(inside.min() - reach), 0)
        rows = min(math.ceil(middle + half + reach), first + exposure.shape[0]) - top
        columns = min(math.ceil(inside.max() + reach), exposure.shape[1]) - left
        if rows < 8 or columns < 8:
            return 0.0, 0.0
        picture = np.zeros((rows, columns))
        draw_curve(picture, begin - top, left, node, course, slope, spot)
        normal[:], right[:] = 0.0, 0.0
        seen_light = drawn_light = 0.0
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
                value = look(exposure, first, row + n * dr, column + n * dc)
                expected = light * look(picture, top, row + n * dr, column + n * dc - left)
                if math.isnan(value + expected):
                    continue
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
                # while the curve is far from its line there is little light on it: its side still counts
                if share < BRIGHTEST * light and abs(away) < FARTHEST * spot:
                    if share > DIMMEST * light:
                        seen_light += seen * drawn
                        drawn_light += drawn * drawn
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
            return 0.0, 0.0
        for i in range(SIZE):
            for j in range(i):
                normal[j, i] = normal[i, j]
            normal[i, i] += PRIOR * POINT / pace / ROOM[i] ** 2
            right[i] -= PRIOR * POINT / pace * (shape[i] - start[i]) / ROOM[i] ** 2
        if not solve(normal, right, SIZE):
            return 0.0, 0.0
        moved = 0.0
        for i in range(SIZE):
            shape[i] += right[i]
            moved = max(moved, abs(right[i]))
        light = max(seen_light / drawn_light, 0.05 * gain)
        share_used = used / count
        if pace == POINT and moved < SETTLED:
            break
        if moved < NEAR or turned + 2 >= FITS:
            pace = POINT
    return light, share_used
