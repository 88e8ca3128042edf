"""Compiled: the spot of light drawn over the image, where the line crosses the centre line of every row, and what
light becomes: silver (characteristic curve, grain), and the scanner's light.

Between nodes the line is a cubic in time through places and rates at both.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from synth.film.layout import Pixels
from synth.film.shutter import Light
from synth.kernels.compiled import kernel
from synth.phase import Floats, Integers

REACH = 5.0  # sigmas: 3e-7 of the light falls further away on each side
STEP = 1.0  # sigmas of a step along the line: in each, the spot is put down at two places
FINE = 256  # entries of the table to the sigma: straight lines between them err by 5e-7
_EARLY = 0.5 - 0.5 / math.sqrt(3.0)  # the two places of Gauss in a step
_NEWTON = 6
SCANNER_RANGE = 2.2  # The scanner shows a density as the value 10^(-density / 2.2) of its full scale.


class Line(NamedTuple):
    """A trace on the image by its nodes, (nodes,) each: s, px, px/s, px, px/s, rad, rad/s."""

    time: Floats
    row: Floats
    row_rate: Floats
    column: Floats
    column_rate: Floats
    swing: Floats
    swing_rate: Floats


def spot_table(sigma: float) -> Floats:
    """How much of a Gaussian lies below a distance: entry i is for (i / FINE - half the table) sigmas, sigma in px."""
    from scipy.special import ndtr

    half = int((REACH + 2.0 / sigma) * FINE) + 2  # two pixels beyond the reach
    return ndtr(np.arange(-half, half + 1) / FINE)


@kernel
def below(table: Floats, place: float) -> float:
    """The table between its entries, at a place counted in entries."""
    i = int(place)
    return float(table[i] + (place - i) * (table[i + 1] - table[i]))


@kernel
def cubic(x: float, start: float, rate: float, stop: float, end_rate: float, span: float) -> tuple[float, float]:
    """Cubic of Hermite at x, 0 to 1, of a span of time; and its derivative by time."""
    rise = stop - start
    a, b = span * rate - rise, rise - span * end_rate
    y = 1.0 - x
    value = y * start + x * stop + x * y * (y * a + x * b)
    slope = rise + (y - x) * (y * a + x * b) + x * y * (b - a)
    return value, slope / span


@kernel
def draw_line(
    image: Pixels, first: int, line: Line, lit: Light, sigma: float, weight: float, table: Floats, across: Floats
) -> None:
    """Add the light of one trace to some rows of the image.

    Each pixel gets the mean over its area. Stretches of light are cut into steps short against the spot, and the spot
    is put down at the two places of Gauss in each: exact to 1e-6, and to 3e-4 at the edge of a gap.

    The image is (rows, columns) float32, its first row number `first` of the film; sigma is that of the spot, px; the
    weight exposure per second times the area of a pixel; the table that of `spot_table`; `across` work space of at
    least 2 REACH sigma + 3 places.
    """
    time, row, row_rate, column, column_rate, _, _ = line
    begin, end, light = lit
    rows, columns = image.shape
    reach = REACH * sigma
    grid, middle = FINE / sigma, table.size // 2
    stretch = 0
    for j in range(time.size - 1):
        span = time[j + 1] - time[j]
        while stretch < begin.size and end[stretch] <= time[j]:
            stretch += 1
        bulge = span * max(abs(row_rate[j]), abs(row_rate[j + 1]))
        if min(row[j], row[j + 1]) - bulge - reach > first + rows or max(row[j], row[j + 1]) + bulge + reach < first:
            continue
        fastest = 1.05 * math.hypot(
            max(abs(row_rate[j]), abs(row_rate[j + 1])), max(abs(column_rate[j]), abs(column_rate[j + 1]))
        )
        here = stretch
        while here < begin.size and begin[here] < time[j + 1]:
            since, until = max(begin[here], time[j]), min(end[here], time[j + 1])
            steps = int(fastest * (until - since) / (STEP * sigma)) + 1
            each = (until - since) / steps
            amount = 0.5 * each * weight * light[here]
            for half in range(2 * steps):
                moment = since + each * ((half >> 1) + (1.0 - _EARLY if half & 1 else _EARLY)) - time[j]
                x = moment / span
                r = cubic(x, row[j], row_rate[j], row[j + 1], row_rate[j + 1], span)[0] - first
                c = cubic(x, column[j], column_rate[j], column[j + 1], column_rate[j + 1], span)[0]
                top, bottom = max(0, math.floor(r - reach)), min(rows - 1, math.floor(r + reach))
                left, right = max(0, math.floor(c - reach)), min(columns - 1, math.floor(c + reach))
                if top > bottom or left > right:
                    continue
                last = below(table, (left - c) * grid + middle)
                for i in range(left, right + 1):
                    following = below(table, (i + 1 - c) * grid + middle)
                    across[i - left] = amount * (following - last)
                    last = following
                last = below(table, (top - r) * grid + middle)
                for y in range(top, bottom + 1):
                    following = below(table, (y + 1 - r) * grid + middle)
                    share = following - last
                    last = following
                    for i in range(left, right + 1):
                        image[y, i] += share * across[i - left]
            here += 1


@kernel
def cross_rows(first: int, line: Line, moment: Floats, place: Floats, slope: Floats, elongation: Floats) -> None:
    """Find where a line that runs forwards crosses the centre lines of rows, from number `first` on.

    Filled are moment, place, slope and elongation, (rows,) s, px, px/px, rad, but in rows that the line does not reach.
    """
    time, row, row_rate, column, column_rate, swing, swing_rate = line
    j = 0
    for i in range(moment.size):
        level = first + i + 0.5
        if level < row[0] or level > row[row.size - 1]:
            continue
        while j < row.size - 2 and row[j + 1] < level:
            j += 1
        span = time[j + 1] - time[j]
        x = (level - row[j]) / (row[j + 1] - row[j])
        for _ in range(_NEWTON):
            value, rate = cubic(x, row[j], row_rate[j], row[j + 1], row_rate[j + 1], span)
            x = min(max(x - (value - level) / (rate * span), 0.0), 1.0)
        _, along = cubic(x, row[j], row_rate[j], row[j + 1], row_rate[j + 1], span)
        place[i], across = cubic(x, column[j], column_rate[j], column[j + 1], column_rate[j + 1], span)
        elongation[i], _ = cubic(x, swing[j], swing_rate[j], swing[j + 1], swing_rate[j + 1], span)
        moment[i] = time[j] + x * span
        slope[i] = across / along


@kernel
def develop(
    image: Pixels, left: Integers, right: Integers, fog: Floats, fog_rise: float, density_max: float,
    half_exposure: float, gamma: float,
) -> None:  # fmt: skip
    """Turn exposure (rows, columns) into density, in place, by the characteristic curve; what is not paper gets none.

    `left` and `right` are the first column of the paper in each row and the one after its last; `fog` is that of each
    row at column 0, and rises by `fog_rise` from column to column.
    """
    rows, columns = image.shape
    least = 1e-6 * half_exposure
    for y in range(rows):
        for x in range(columns):
            if x < left[y] or x >= right[y]:
                image[y, x] = 0.0
                continue
            veil = fog[y] + fog_rise * x
            light = image[y, x]
            if light > least:
                veil += (density_max - veil) / (1.0 + math.exp(gamma * math.log(half_exposure / light)))
            image[y, x] = veil


@kernel
def scan(image: Pixels, noise: Pixels, grain: np.float32, scale: np.float32, brightness: Pixels) -> None:
    """Turn density (rows, columns) into the light that the scanner sees, 0 to 1, in place.

    The noise is standard normal, the grain 1 sigma of the density where it is 1; `scale` is the natural logarithm of
    the light per density, negative; the brightness that of the scanner's lamp, (columns,).
    """
    rows, columns = image.shape
    for y in range(rows):
        for x in range(columns):
            density = image[y, x]
            density += grain * np.sqrt(density) * noise[y, x]
            image[y, x] = brightness[x] * np.exp(scale * max(density, np.float32(0.0)))
