"""The trace as a curve on the film, the light of the spot that draws it, and its brightness along it."""

from __future__ import annotations

import math
from typing import NamedTuple

from pipeline.arrays import Floats
from synth.kernels.compiled import kernel

REACH = 3.5  # spots, beyond which there is no light
STRAIGHT = 4.0  # length of line a row, from which its bend within a spot is negligible
FLANK = 9.0  # spots of line on either side of the gap


class Patch(NamedTuple):
    """Light drawn on a piece of the film whose first pixel lies at row `top` and column `left`.

    `across` and `along` are its derivatives by a shift of the curve across the film and by a lead along it.
    """

    image: Floats
    across: Floats
    along: Floats
    top: int
    left: int


@kernel
def place(course: Floats, slope: Floats, row: float) -> tuple[float, float]:
    """Column of a curve and its slope at a row coordinate (cubic between the rows' centres); NaN beyond its ends."""
    at = row - 0.5
    i = math.floor(at)
    if i < 0 or i + 1 >= course.size:
        return math.nan, math.nan
    x = at - i
    a, b, u, v = course[i], course[i + 1], slope[i], slope[i + 1]
    rise = b - a
    p, q = 3.0 * rise - 2.0 * u - v, u + v - 2.0 * rise
    return a + x * (u + x * (p + x * q)), u + x * (2.0 * p + 3.0 * x * q)


@kernel
def draw(patch: Patch, row: float, column: float, slope: float, weight: float, spot: float, sloped: bool) -> None:
    """Add a Gaussian spot, of density 1/(sqrt(2 pi) spot) at its centre times `weight`, to a piece of the film.

    If `sloped`, its derivatives are added, too: a curve that is moved along the film moves across it by its `slope`.
    """
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
    sloped: bool,
) -> None:  # fmt: skip
    """Draw a curve from row `begin` to `end`, moved by `shift` across and by `lead` rows earlier along the film.

    If `sloped`, the derivatives of its light by `shift` and `lead` are drawn too. Spots lie one spot apart: their sum
    is even to 1e-8.
    """
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
            draw(patch, middle, column, lean, step, spot, sloped)
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


@kernel
def light_at_rest(slope: float, curvature: float, spot: float, half: float) -> float:
    """Exposure on the axis of a curved line drawn from `half` rows before the point to `half` after it."""
    steep = math.sqrt(1.0 + slope * slope)
    if steep > STRAIGHT:
        return math.erf(half * steep / (1.4142135623730951 * spot)) / steep
    reach = min(half, REACH * spot / steep)
    total, count = 0.0, 9
    step = 2.0 * reach / count
    for i in range(count):
        x = (i + 0.5) * step - reach
        c = x * (slope + 0.5 * curvature * x)
        total += math.exp(-0.5 * (x * x + c * c) / (spot * spot))
    return total * step / (2.5066282746310002 * spot)


@kernel
def brightness_along(
    exposure: Floats, first: int, course: Floats, slope: Floats, curvature: Floats, begin: int, steps: int,
    spot: float, width: float, out: Floats, dark: Floats,
) -> None:  # fmt: skip
    """Exposure on the line over that expected of its slope and bend, at `steps` places a row from row `begin` on.

    `out` is NaN where the trace or the piece of film, whose first row is `first`, ends; `dark` is the share of the
    light that a gap of `width` rows centred there would take.
    """
    for k in range(out.size):
        row = begin + (k + 0.5) / steps
        column, lean = place(course, slope, row)
        out[k], dark[k] = math.nan, 0.0
        if math.isnan(column):
            continue
        steep = math.sqrt(1.0 + lean * lean)
        dr, dc = -lean * 0.6 * spot / steep, 0.6 * spot / steep  # across the line
        value = look(exposure, first, row, column)
        value += look(exposure, first, row + dr, column + dc) + look(exposure, first, row - dr, column - dc)
        bend = curvature[min(int(row), course.size - 1)]
        whole = light_at_rest(lean, bend, spot, 1e3)
        out[k] = value / (2.67 * whole)  # 1 + 2 exp(-0.18)
        dark[k] = light_at_rest(lean, bend, spot, 0.5 * width) / whole
