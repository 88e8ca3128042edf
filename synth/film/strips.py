"""The image strip by strip, the same bits however it is cut: light drawn along the traces, then what light becomes.

A trace is a cubic in time between nodes. Silver (characteristic curve, grain) and the scanner's light follow.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from data_schemas.scene_recording import Film
from synth.film.dirt import Dirt
from synth.film.layout import STRIP, FilmPlan, Light, Pixels
from synth.film.source import Curves
from synth.kernels.compiled import kernel, making_kernel
from synth.phase import Floats, Integers
from synth.seeds import generator

NODE = 1.0 / 128  # s: a cubic then errs by 1e-9 of a swing of 1 s
REACH = 5.0  # sigmas: 3e-7 of the light falls further away on each side
STEP = 1.0  # sigmas of a step along the line: in each, the spot is put down at two places
FINE = 256  # entries of the table to the sigma: straight lines between them err by 5e-7
_EARLY = 0.5 - 0.5 / math.sqrt(3.0)  # the two places of Gauss in a step
_NEWTON = 6
_SCANNER_RANGE = 2.2  # the scanner shows a density as the value 10^(-density / 2.2) of its full scale


class Line(NamedTuple):
    """A trace on the image by its nodes, (nodes,) each: s, px, px/s, px, px/s, rad, rad/s."""

    time: Floats
    row: Floats
    row_rate: Floats
    column: Floats
    column_rate: Floats
    swing: Floats
    swing_rate: Floats


class Crossings(NamedTuple):
    """Where the traces cross the centre lines of a strip's rows, (traces, rows) each: s, rad, px, px/px."""

    time: Floats
    elongation: Floats
    column: Floats
    slope: Floats


class Exposure:
    """The latent image of a film, strip by strip in order."""

    def __init__(self, plan: FilmPlan) -> None:
        film, geometry, source = plan.film, plan.geometry, plan.source
        self._plan = plan
        self._node = min(NODE, source.step)
        self._curves = Curves(source, self._node)
        self._last_node = math.ceil((source.end - source.begin) / self._node)
        self._sigma = film.spot * geometry.pixels
        self._weight = film.speed * geometry.pixels * math.sqrt(2 * math.pi) * self._sigma
        self._table = spot_table(self._sigma)
        corners = [(u, o) for u in (0.0, film.paper_width) for o in plan.layout.offset]
        reaches = [geometry.row[2] * u + geometry.row[1] * o for u, o in corners]
        self._lead, self._lag = min(reaches), max(reaches)

    def strip(self, number: int) -> tuple[Pixels, Crossings]:
        """Exposure of the strip's rows, (rows, columns), and the crossings of its centre lines."""
        geometry, layout, transport = self._plan.geometry, self._plan.layout, self._plan.transport
        first = number * STRIP
        rows = min(STRIP, geometry.rows - first)
        image = np.zeros((rows, geometry.columns), np.float32)
        crossings = Crossings(*np.full((4, layout.position.size, rows), np.nan))
        nodes = self._nodes(first, first + rows)
        if nodes.size < 2:
            return image, crossings
        swing, swing_rate = self._curves.at(nodes)
        travel, speed = transport.travel(nodes), transport.speed(nodes)
        for k, light in enumerate(self._plan.light):
            along, across = travel + layout.offset[k], layout.position[k] + layout.lever[k] * swing[k]
            across_rate = layout.lever[k] * swing_rate[k]
            row_rate = geometry.row[1] * speed + geometry.row[2] * across_rate
            column_rate = geometry.column[1] * speed + geometry.column[2] * across_rate
            row, column = geometry.rows_of(along, across), geometry.columns_of(along, across)
            line = Line(nodes, row, row_rate, column, column_rate, swing[k], swing_rate[k])
            draw_line(image, first, line, light, self._sigma, self._weight, self._table)
            cross_rows(first, line, *(values[k] for values in crossings))
        return image, crossings

    def _nodes(self, first: int, stop: int) -> Floats:
        """Times of the nodes between which any light falls on some rows."""
        source, (constant, along, _) = self._plan.source, self._plan.geometry.row
        reach = REACH * self._sigma + 2.0
        ends = np.array([first - reach - self._lag, stop + reach - self._lead])
        earliest, latest = (self._plan.transport.time_at((ends - constant) / along) - source.begin) / self._node
        begin, end = max(math.floor(earliest) - 1, 0), min(math.ceil(latest) + 1, self._last_node)
        return np.minimum(source.begin + np.arange(begin, end + 1) * self._node, source.end)


class Development:
    """What a latent image becomes, strip by strip: silver, dirt, grain, the scanner's light; before its blur."""

    def __init__(self, plan: FilmPlan) -> None:
        film, geometry, self._seed = plan.film, plan.geometry, plan.seed
        self._film, self._geometry, self._dirt = film, geometry, Dirt(film, geometry, plan.seed)
        middle = (np.arange(geometry.columns) + 0.5) / geometry.columns * 2.0 - 1.0
        self._brightness = (1.0 - film.vignette * middle**2).astype(np.float32)

    def strip(self, number: int, image: Pixels) -> Pixels:
        """Light from the strip, 0 to 1, in the place of its exposure."""
        film, geometry, rows = self._film, self._geometry, len(image)
        first = number * STRIP
        left, right = (np.round(edge).astype(np.int64) for edge in geometry.paper_edges(first, first + rows))
        rise = film.fog_gradient / geometry.width * math.cos(geometry.turn)
        down = np.arange(first, first + rows) + 0.5 - geometry.corner[0]
        at_left = (0.5 - geometry.corner[1]) * math.cos(geometry.turn) - down * math.sin(geometry.turn)
        fog = np.maximum(film.fog + film.fog_gradient * (at_left / geometry.width - 0.5), 0.0)
        develop(image, left, right, fog, rise, film)
        self._dirt.soil(image, first)
        if film.grain:
            noise = generator(self._seed, f"film grain {number}").standard_normal(image.shape, dtype=np.float32)
            noise *= np.float32(film.grain * film.dpi / 300.0)
            image += noise * np.sqrt(np.maximum(image, np.float32(0.0)))
        scan(image, np.float32(-math.log(10.0) / _SCANNER_RANGE), self._brightness)
        if film.polarity == "positive":
            np.subtract(np.float32(1.0), image, out=image)
        return image


def develop(image: Pixels, left: Integers, right: Integers, fog: Floats, fog_rise: float, film: Film) -> None:
    """Turn exposure (rows, columns) into density, in place; what is not paper, from `left` up to `right`, gets none.

    `fog` is that of each row at column 0, and rises by `fog_rise` from column to column.
    """
    column = np.arange(image.shape[1])
    density = fog[:, None] + fog_rise * column
    lit = image > 1e-6 * film.half_exposure
    ratio = film.half_exposure / image[lit].astype(np.float64)
    density[lit] += (film.density_max - density[lit]) / (1.0 + ratio**film.gamma)
    density[(column < left[:, None]) | (column >= right[:, None])] = 0.0
    image[:] = density


def scan(image: Pixels, scale: np.float32, brightness: Pixels) -> None:
    """Turn density (rows, columns) into scanned light, 0 to 1, in place; `scale` is ln(light) per density, negative."""
    np.maximum(image, np.float32(0.0), out=image)
    image *= scale
    np.exp(image, out=image)
    image *= brightness


def blurred(strips: Iterator[Pixels], sigma: float) -> Iterator[Pixels]:
    """Blur an image that comes strip by strip, px, into strips of the same sizes; its edges go on as they are."""
    if not sigma:
        yield from strips
        return
    from scipy.ndimage import gaussian_filter1d

    radius = math.ceil(4.0 * sigma)

    def along(image: Pixels, axis: int) -> Pixels:
        return gaussian_filter1d(image, sigma, axis=axis, mode="nearest", radius=radius)

    above: Pixels | None = None
    here: Pixels | None = along(next(strips), 1)
    while here is not None:
        coming = next(strips, None)
        below = None if coming is None else along(coming, 1)
        top = np.repeat(here[:1], radius, axis=0) if above is None else above
        under = here[-1:] if below is None else below[:radius]
        under = np.pad(under, ((0, radius - len(under)), (0, 0)), mode="edge")
        yield along(np.concatenate([top, here, under]), 0)[radius : radius + len(here)]
        above, here = here[-radius:], below


def quantised(image: Pixels, bits: int) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """Light, 0 to 1, as whole numbers of a number of bits."""
    top = np.float32(2**bits - 1)
    levels: Pixels = np.clip(np.rint(image * top), np.float32(0.0), top)
    return levels.astype(np.uint8) if bits == 8 else levels.astype(np.uint16)


def spot_table(sigma: float) -> Floats:
    """How much of a Gaussian lies below a distance: entry i is for (i / FINE - half the table) sigmas, sigma in px."""
    from scipy.special import ndtr

    half = int((REACH + 2.0 / sigma) * FINE) + 2  # two pixels beyond the reach
    return ndtr(np.arange(-half, half + 1) / FINE)


@kernel
def _below(table: Floats, place: float) -> float:
    """The table between its entries, at a place counted in entries."""
    i = int(place)
    return float(table[i] + (place - i) * (table[i + 1] - table[i]))


@kernel
def _cubic(x: float, start: float, rate: float, stop: float, end_rate: float, span: float) -> tuple[float, float]:
    """Cubic of Hermite at x, 0 to 1, of a span of time; and its derivative by time."""
    rise = stop - start
    a, b = span * rate - rise, rise - span * end_rate
    y = 1.0 - x
    value = y * start + x * stop + x * y * (y * a + x * b)
    slope = rise + (y - x) * (y * a + x * b) + x * y * (b - a)
    return value, slope / span


@making_kernel
def draw_line(image: Pixels, first: int, line: Line, lit: Light, sigma: float, weight: float, table: Floats) -> None:
    """Add the light of one trace to some rows of the image, float32 (rows, columns), its first row number `first`.

    Each pixel gets the mean over its area, by two places of Gauss in steps short against the spot: exact to 1e-6, to
    3e-4 at the edge of a gap. sigma is that of the spot, px; the weight exposure per second times the area of a pixel.
    """
    time, row, row_rate, column, column_rate, _, _ = line
    begin, end, light = lit
    rows, columns = image.shape
    reach = REACH * sigma
    grid, middle, across = FINE / sigma, table.size // 2, np.empty(int(2.0 * reach) + 4)
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
                r = _cubic(x, row[j], row_rate[j], row[j + 1], row_rate[j + 1], span)[0] - first
                c = _cubic(x, column[j], column_rate[j], column[j + 1], column_rate[j + 1], span)[0]
                top, bottom = max(0, math.floor(r - reach)), min(rows - 1, math.floor(r + reach))
                left, right = max(0, math.floor(c - reach)), min(columns - 1, math.floor(c + reach))
                if top > bottom or left > right:
                    continue
                last = _below(table, (left - c) * grid + middle)
                for i in range(left, right + 1):
                    following = _below(table, (i + 1 - c) * grid + middle)
                    across[i - left] = amount * (following - last)
                    last = following
                last = _below(table, (top - r) * grid + middle)
                for y in range(top, bottom + 1):
                    following = _below(table, (y + 1 - r) * grid + middle)
                    share = following - last
                    last = following
                    for i in range(left, right + 1):
                        image[y, i] += share * across[i - left]
            here += 1


@kernel
def cross_rows(first: int, line: Line, moment: Floats, elongation: Floats, place: Floats, slope: Floats) -> None:
    """Fill where a line that runs forwards crosses rows' centres, from row `first` on: (rows,) s, rad, px, px/px."""
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
            value, rate = _cubic(x, row[j], row_rate[j], row[j + 1], row_rate[j + 1], span)
            x = min(max(x - (value - level) / (rate * span), 0.0), 1.0)
        _, along = _cubic(x, row[j], row_rate[j], row[j + 1], row_rate[j + 1], span)
        place[i], across = _cubic(x, column[j], column_rate[j], column[j + 1], column_rate[j + 1], span)
        elongation[i], _ = _cubic(x, swing[j], swing_rate[j], swing[j + 1], swing_rate[j + 1], span)
        moment[i] = time[j] + x * span
        slope[i] = across / along
