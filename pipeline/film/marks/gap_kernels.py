"""The trace as a curve on the film and its light; a gap of the shutter fitted to where that went out.

The light of a piece of film is `a L - b T`: L the whole line as its course draws it, T what would have been drawn while
the shutter was closed, between `m - w/2` and `m + w/2` on the curve. Gauss-Newton over m, a, b, w, a shift d of the
course across the film and a lead h along it, each pixel weighed by its grain, is as good as the grain allows (the
Cramer-Rao bound of the model), on steep strokes and in turning points alike.

Where the slit stands askew, by `shear` rows a column, a line of slope v runs 1 - shear v of the slit's time a row: so
bright it is, and the middle of the closed time is not that of the gap's rows.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.tracking.motion import solve
from synth.kernels.compiled import kernel, making_kernel

REACH = 3.5  # spots, beyond which there is no light
FLANK = 9.0  # spots of line on either side of the gap
RESULTS = 11  # of a gap, as `search.Gaps` has them
ROW, ROW_SIGMA, COLUMN, COLUMN_SIGMA, SLOPE, WIDTH, WIDTH_SIGMA, DEPTH, DEPTH_SIGMA, LIGHT, MISFIT = range(RESULTS)
PARAMETERS = 6
STEEPEST = 60.0  # slope of strokes whose gaps fit on a piece of film
MOST_SLOPE = 1000.0  # of any line
LAYERS = 9
ROUNDS = 6
FAINT = 0.02  # of the line's light: pixels with less of another line are used
MODEL = 0.04  # of the line's light, 1 sigma of what spot and curve are not exactly
LEAD = 0.2  # rows, 1 sigma, by which a course may lie early or late
LEAST_PACE = 0.1  # a slant that is taken for larger than it is would make light negative
CLIP = 4.0  # sigmas, of a pixel's residual


class Patch(NamedTuple):
    """Light on film from row `top`, column `left`; derivatives by a shift `across` the film and a lead `along` it."""

    image: Floats
    across: Floats
    along: Floats
    top: int
    left: int


@kernel
def place(course: Floats, slope: Floats, row: float) -> tuple[float, float]:
    """Column and slope of a curve at a row (cubic between rows' centres); NaN beyond its ends, or too steep."""
    at = row - 0.5
    i = math.floor(at)
    if i < 0 or i + 1 >= course.size:
        return math.nan, math.nan
    x = at - i
    a, b, u, v = course[i], course[i + 1], slope[i], slope[i + 1]
    rise = b - a
    p, q = 3.0 * rise - 2.0 * u - v, u + v - 2.0 * rise
    lean = u + x * (2.0 * p + 3.0 * x * q)
    if not abs(lean) < MOST_SLOPE:
        return math.nan, math.nan
    return a + x * (u + x * (p + x * q)), lean


@kernel
def pace(shear: float, slope: float) -> float:
    """Of the slit's time that a line of such a slope runs through in a row; no course runs back in time."""
    return max(1.0 - shear * slope, LEAST_PACE)


@kernel
def draw(patch: Patch, row: float, column: float, slope: float, weight: float, spot: float, sloped: bool) -> None:
    """Add a Gaussian spot of a `weight` to a piece of film and, if `sloped`, its derivatives."""
    image, across, along, top, left = patch
    rows, columns = image.shape
    reach = REACH * spot
    first, last = max(0, math.ceil(row - reach - 0.5) - top), min(rows - 1, math.floor(row + reach - 0.5) - top)
    low = max(0, math.ceil(column - reach - 0.5) - left)
    high = min(columns - 1, math.floor(column + reach - 0.5) - left)
    if first > last or low > high:
        return
    scale = -0.5 / (spot * spot)
    # Gaussians on a grid by recurrence: two exponentials a line instead of one a pixel
    turn = math.exp(2.0 * scale)
    away = low + left + 0.5 - column
    start, growth = math.exp(scale * away * away), math.exp(scale * (2.0 * away + 1.0))
    down = first + top + 0.5 - row
    line = weight * math.exp(scale * down * down) / (2.5066282746310002 * spot)
    fall = math.exp(scale * (2.0 * down + 1.0))
    for y in range(first, last + 1):
        value, ratio, lean = line * start, growth, -2.0 * scale * away
        for x in range(low, high + 1):
            image[y, x] += value
            if sloped:
                across[y, x] += lean * value
                along[y, x] += slope * lean * value
                lean -= 2.0 * scale
            value *= ratio
            ratio *= turn
        line *= fall
        fall *= turn


@kernel
def shade(
    patch: Patch, course: Floats, slope: Floats, begin: float, end: float, shift: float, lead: float, spot: float,
    shear: float, sloped: bool,
) -> None:  # fmt: skip
    """Draw a curve from row `begin` to `end`, moved `shift` across and `lead` rows earlier, in spots one spot apart."""
    left, right = patch.left - REACH * spot, patch.left + patch.image.shape[1] + REACH * spot
    row = begin
    while row < end:
        _, lean = place(course, slope, row)
        if math.isnan(lean):
            row += 0.5
            continue
        step = spot / math.sqrt(1.0 + lean * lean)
        _, ahead = place(course, slope, row + step)
        if abs(ahead) > abs(lean):  # out of a turning point the line steepens within a step
            step = spot / math.sqrt(1.0 + ahead * ahead)
        step = min(step, end - row)
        middle = row + 0.5 * step
        column, lean = place(course, slope, middle)
        column += shift + lead * lean
        if left < column < right:
            draw(patch, middle, column, lean, step * pace(shear, lean), spot, sloped)
        row += step


@kernel
def window(course: Floats, slope: Floats, mark: float, width: float, spot: float) -> tuple[float, float, float, float]:
    """First row, last, first column and last of a gap and its flanks; NaN where the curve ends."""
    top, bottom, left, right = math.inf, -math.inf, math.inf, -math.inf
    for side in (-1.0, 1.0):
        row, flank = mark, 0.0
        while flank < FLANK * spot:
            column, lean = place(course, slope, row)
            if math.isnan(column):
                return math.nan, math.nan, math.nan, math.nan
            top, bottom, left, right = min(top, row), max(bottom, row), min(left, column), max(right, column)
            step = spot / math.sqrt(1.0 + lean * lean)
            inside = 0.5 * width - abs(row - mark)
            if inside > 1e-9:
                step = min(step, inside)
            else:
                flank += spot
            row += side * step
    pad = 2.5 * spot
    return top - pad, bottom + pad, left - pad, right + pad


@kernel
def look(exposure: Floats, first: int, row: float, column: float) -> float:
    """Exposure between pixels, bilinear; NaN outside the piece of film."""
    y, x = row - 0.5 - first, column - 0.5
    i, j = math.floor(y), math.floor(x)
    if i < 0 or j < 0 or i + 1 >= exposure.shape[0] or j + 1 >= exposure.shape[1]:
        return math.nan
    a, b = y - i, x - j
    upper = exposure[i, j] + b * (exposure[i, j + 1] - exposure[i, j])
    lower = exposure[i + 1, j] + b * (exposure[i + 1, j + 1] - exposure[i + 1, j])
    return float(upper + a * (lower - upper))


class Known(NamedTuple):
    """What is known of spot, grain and gaps."""

    spot: float  # 1 sigma, px
    shear: float  # rows by which the image lags per column
    grain: Floats  # 1 sigma of the exposure of a pixel at every `grain_step` of exposure from 0 on
    grain_step: float
    lateral: float  # 1 sigma of the course across the line, px
    width_prior: float  # 1 sigma of a gap's width, relative
    spacing: float  # rows between marks


@making_kernel
def fit_gap(
    exposure: Floats, first: int, courses: Floats, slopes: Floats, trace: int, mark: float, width: float, known: Known,
    layers: Floats, out: Floats,
) -> bool:  # fmt: skip
    """Fit one gap; False, with `out` NaN, where it cannot be done."""
    spot, shear, grain = known.spot, known.shear, known.grain
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
    reach = REACH * spot
    whole = Patch(layer[0], layer[1], layer[2], top, left)
    lost = Patch(layer[3], layer[4], layer[5], top, left)
    line, line_d, line_h, _top, _left = whole
    gap, gap_d, gap_h, _top, _left = lost
    start, stop, far = layer[6], layer[7], layer[8]
    near = 0.45 * known.spacing  # rows: what the line draws later than that may lie in another gap
    far[:] = 0.0
    others = Patch(far, far, far, top, left)
    for other in range(courses.shape[0] + 1):  # other traces, and before and after `near` this one
        which = other if other < courses.shape[0] else trace
        begin = mark + near if other == courses.shape[0] else top - reach
        end = mark - near if other == trace else top + rows + reach
        shade(others, courses[which], slopes[which], begin, end, 0.0, 0.0, spot, shear, False)
    here, lean = place(course, slope, mark)
    sideways = known.lateral * math.sqrt(1.0 + lean * lean)
    m, w, d, h, a, b, drawn, led = mark, width, 0.0, 0.0, 1.0, 1.0, math.inf, 0.0
    normal, right, slant = np.empty((PARAMETERS, PARAMETERS)), np.empty(PARAMETERS), np.empty(PARAMETERS)
    misfit, count, bright, per_step = 0.0, 0, 0.0, 1.0 / known.grain_step
    for turn in range(ROUNDS):
        if abs(d - drawn) > 0.02 * math.sqrt(1.0 + lean * lean) or abs(h - led) > 0.02:
            layer[:3] = 0.0
            begin, end = max(top - reach, mark - near), min(top + rows + reach, mark + near)
            shade(whole, course, slope, begin, end, d, h, spot, shear, True)
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
        shade(lost, course, slope, m - 0.5 * w, m + 0.5 * w, d, h, spot, shear, True)
        for side in range(2):
            edge = m + (side - 0.5) * w
            at, steep = place(course, slope, edge)
            if math.isnan(at):
                return False
            end_light = Patch(layer[6 + side], far, far, top, left)
            draw(end_light, edge, at + d + h * steep, 0.0, pace(shear, steep), spot, False)
        right[:] = 0.0
        normal[:] = 0.0
        misfit, count = 0.0, 0
        for y in range(rows):
            for x in range(columns):
                light = line[y, x] + (d - drawn) * line_d[y, x] + (h - led) * line_h[y, x]
                if far[y, x] > FAINT * bright or light < 0.01 * bright:
                    continue
                expected = a * light - b * gap[y, x]
                at_grain = min(max(expected, 0.0) * per_step, grain.size - 1.0)
                g = min(int(at_grain), grain.size - 2)
                noise, model = grain[g] + (at_grain - g) * (grain[g + 1] - grain[g]), MODEL * a * light
                weight = 1.0 / math.sqrt(noise * noise + model * model)
                residual = (exposure[top - first + y, left + x] - expected) * weight
                if math.isnan(residual):
                    continue
                if abs(residual) > CLIP:
                    root = math.sqrt(CLIP / abs(residual))
                    weight *= root
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
        w = min(max(w + right[4], 0.3 * width), 2.0 * width + 2.0 * spot)
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
    before, after = place(course, slope, m - 0.5 * w)[0], place(course, slope, m + 0.5 * w)[0]
    late = shear * (here - 0.5 * (before + after))
    out[ROW], out[ROW_SIGMA] = m + late, math.sqrt(normal[0, 0])
    out[COLUMN], out[COLUMN_SIGMA] = here + d + (h + late) * lean, math.sqrt(max(across, 0.0))
    out[DEPTH], out[DEPTH_SIGMA] = b / a, math.sqrt(max(deep, 0.0)) / a
    out[WIDTH], out[WIDTH_SIGMA] = w, math.sqrt(normal[4, 4])
    out[SLOPE], out[LIGHT], out[MISFIT] = lean, a, misfit / count
    return True


@making_kernel
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
