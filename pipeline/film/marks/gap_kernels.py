"""A gap of the shutter fitted to the film: where on the trace the light went out and came back.

The light of a piece of film is `a L - b T`: L the whole line as its course draws it, T what would have been drawn while
the shutter was closed, between `m - w/2` and `m + w/2` on the curve. Gauss-Newton over m, a, b, w, a shift d of the
course across the film and a lead h along it, each pixel weighed by its grain. A course that lies late by more the
further out it is (a tracker that misjudges an oblique image draws such ones) would else take the gap along. Both ends
of the gap are edges of a line of known shape, so the fit is as good as the grain allows (the Cramer-Rao bound of the
model), on steep strokes and in turning points alike.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.marks.curve_kernels import REACH, Patch, draw, place, shade, window
from pipeline.film.tracking.motion import solve
from synth.kernels.compiled import kernel

RESULTS = 11  # of a gap, as `search.Gaps` has them
ROW, ROW_SIGMA, COLUMN, COLUMN_SIGMA, SLOPE, WIDTH, WIDTH_SIGMA, DEPTH, DEPTH_SIGMA, LIGHT, MISFIT = range(RESULTS)
PARAMETERS = 6
STEEPEST = 60.0  # slope of strokes whose gaps fit on a piece of film
LAYERS = 9
ROUNDS = 6
FAINT = 0.02  # of the line's light: pixels with less of another line are used
MODEL = 0.04  # of the line's light, 1 sigma of what spot and curve are not exactly
LEAD = 0.2  # rows, 1 sigma, by which a course may lie early or late
CLIP = 4.0  # sigmas, of a pixel's residual


class Known(NamedTuple):
    """What is known of spot, grain and gaps."""

    spot: float  # 1 sigma, px
    grain: Floats  # 1 sigma of the exposure of a pixel at every `grain_step` of exposure from 0 on
    grain_step: float
    lateral: float  # 1 sigma of the course across the line, px
    width_prior: float  # 1 sigma of a gap's width, relative
    spacing: float  # rows between marks


@kernel
def fit_gap(
    exposure: Floats, first: int, courses: Floats, slopes: Floats, trace: int, mark: float, width: float, known: Known,
    layers: Floats, out: Floats,
) -> bool:  # fmt: skip
    """Fit one gap; False, with `out` NaN, where it cannot be done."""
    spot, grain = known.spot, known.grain
    out[:] = math.nan
    course, slope = courses[trace], slopes[trace]
    first_row, last_row, low, high = window(course, slope, mark, width, spot)
    if math.isnan(first_row):
        return False
    top, left = max(math.floor(first_row), first), max(math.floor(low), 0)
    rows = min(math.ceil(last_row), first + exposure.shape[0]) - top
    columns = min(math.ceil(high), exposure.shape[1]) - left
    if rows < 4 or columns < 4 or rows > layers.shape[1] or columns > layers.shape[2]:
        return False
    layer = layers[:, :rows, :columns]
    # light of the line, of what the shutter took, at its two edges, and of other lines
    whole = Patch(layer[0], layer[1], layer[2], top, left)
    lost = Patch(layer[3], layer[4], layer[5], top, left)
    line, line_d, line_h, gap, gap_d, gap_h = layer[0], layer[1], layer[2], layer[3], layer[4], layer[5]
    start, stop, far = layer[6], layer[7], layer[8]
    reach = REACH * spot
    near = 0.45 * known.spacing  # rows: what the line draws later than that may lie in another gap
    far[:] = 0.0
    others = Patch(far, far, far, top, left)
    for other in range(courses.shape[0] + 1):  # other traces, and before and after `near` this one
        which = other if other < courses.shape[0] else trace
        begin = mark + near if other == courses.shape[0] else top - reach
        end = mark - near if other == trace else top + rows + reach
        shade(others, courses[which], slopes[which], begin, end, 0.0, 0.0, spot, False)
    here, lean = place(course, slope, mark)
    sideways = known.lateral * math.sqrt(1.0 + lean * lean)
    m, w, d, h, a, b, drawn, led = mark, width, 0.0, 0.0, 1.0, 1.0, math.inf, 0.0
    normal, right, slant = np.empty((PARAMETERS, PARAMETERS)), np.empty(PARAMETERS), np.empty(PARAMETERS)
    misfit, count, bright = 0.0, 0, 0.0
    for turn in range(ROUNDS):
        if abs(d - drawn) > 0.02 * math.sqrt(1.0 + lean * lean) or abs(h - led) > 0.02:
            layer[:3] = 0.0
            begin, end = max(top - reach, mark - near), min(top + rows + reach, mark + near)
            shade(whole, course, slope, begin, end, d, h, spot, True)
            drawn, led = d, h
            bright = line.max()
            if turn == 0:
                over = under = 0.0
                for y in range(rows):
                    for x in range(columns):
                        if far[y, x] < FAINT * bright:
                            over += exposure[top - first + y, left + x] * line[y, x]
                            under += line[y, x] ** 2
                a = b = max(over / under if under > 0.0 else 1.0, 0.05)
        layer[3:8] = 0.0
        shade(lost, course, slope, m - 0.5 * w, m + 0.5 * w, d, h, spot, True)
        for side in range(2):
            edge = m + (side - 0.5) * w
            at, steep = place(course, slope, edge)
            if math.isnan(at):
                return False
            draw(Patch(layer[6 + side], far, far, top, left), edge, at + d + h * steep, 0.0, 1.0, spot, False)
        right[:] = 0.0
        normal[:] = 0.0
        misfit, count = 0.0, 0
        for y in range(rows):
            for x in range(columns):
                light = line[y, x] + (d - drawn) * line_d[y, x] + (h - led) * line_h[y, x]
                if far[y, x] > FAINT * bright or light < 0.01 * bright:
                    continue
                expected = a * light - b * gap[y, x]
                at_grain = min(max(expected, 0.0) / known.grain_step, grain.size - 1.0)
                g = min(int(at_grain), grain.size - 2)
                noise = math.hypot(grain[g] + (at_grain - g) * (grain[g + 1] - grain[g]), MODEL * a * light)
                residual = (exposure[top - first + y, left + x] - expected) / noise
                if math.isnan(residual):
                    continue
                root = math.sqrt(min(CLIP / abs(residual), 1.0)) if residual != 0.0 else 1.0
                weight = root / noise
                residual *= root
                slant[0] = -b * (stop[y, x] - start[y, x]) * weight
                slant[1] = light * weight
                slant[2] = -gap[y, x] * weight
                slant[3] = (a * line_d[y, x] - b * gap_d[y, x]) * weight
                slant[4] = -0.5 * b * (stop[y, x] + start[y, x]) * weight
                slant[5] = (a * line_h[y, x] - b * gap_h[y, x]) * weight
                for i in range(PARAMETERS):
                    right[i] += slant[i] * residual
                    for j in range(i + 1):
                        normal[i, j] += slant[i] * slant[j]
                misfit += residual * residual
                count += 1
        if count < 12:
            return False
        for i in range(PARAMETERS):
            for j in range(i):
                normal[j, i] = normal[i, j]
        # priors; that of the depth holds where the gap has no pixels left
        wide = known.width_prior * width
        for i, away, sigma in ((2, b - a, a), (3, d, sideways), (4, w - width, wide), (5, h, LEAD)):
            normal[i, i] += 1.0 / sigma**2
            right[i] -= away / sigma**2
        if not solve(normal, right, PARAMETERS):
            return False
        move = min(max(right[0], -0.4 * width), 0.4 * width)
        m += move
        a += right[1]
        b = max(b + right[2], 0.02 * a)
        d += min(max(right[3], -2.0 * sideways), 2.0 * sideways)
        w = min(max(w + right[4], 0.3 * width), 2.0 * width)
        h += min(max(right[5], -2.0 * LEAD), 2.0 * LEAD)
        if not (a > 0.01) or abs(m - mark) > width + 1.0 or math.isnan(m):
            return False
        if turn > 0 and abs(move) < 0.1 * math.sqrt(normal[0, 0]) + 1e-4:
            break
    here, lean = place(course, slope, m)
    if math.isnan(here):
        return False
    along = normal[0, 0] + 2.0 * normal[0, 5] + normal[5, 5]
    across = lean * lean * along + normal[3, 3] + 2.0 * lean * (normal[0, 3] + normal[3, 5])
    deep = normal[2, 2] - 2.0 * b / a * normal[1, 2] + (b / a) ** 2 * normal[1, 1]
    out[ROW], out[ROW_SIGMA] = m, math.sqrt(normal[0, 0])
    out[COLUMN], out[COLUMN_SIGMA] = here + d + h * lean, math.sqrt(max(across, 0.0))
    out[DEPTH], out[DEPTH_SIGMA] = b / a, math.sqrt(max(deep, 0.0)) / a
    out[WIDTH], out[WIDTH_SIGMA] = w, math.sqrt(normal[4, 4])
    out[SLOPE], out[LIGHT], out[MISFIT] = lean, a, misfit / count
    return True


@kernel
def fit_gaps(
    exposure: Floats, first: int, courses: Floats, slopes: Floats, traces: NDArray[np.int64], guesses: Floats,
    widths: Floats, known: Known,
) -> NDArray[np.float64]:  # fmt: skip
    """Fit gaps near the rows `guesses` of `traces`, of `widths` rows, (gaps, RESULTS)."""
    out, wide = np.empty((guesses.size, RESULTS)), 0.0
    for k in range(widths.size):
        wide = max(wide, widths[k])
    margin = int(28.0 * known.spot) + 8
    layers = np.empty((LAYERS, int(wide) + margin, int(STEEPEST * wide) + margin))
    for k in range(guesses.size):
        fit_gap(exposure, first, courses, slopes, traces[k], guesses[k], widths[k], known, layers, out[k])
    return out
