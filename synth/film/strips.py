"""The image strip by strip: each from the curves of the traces around it; the same bits however it is cut."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from synth.film.dirt import Dirt
from synth.film.layout import STRIP, FilmPlan, Pixels
from synth.film.source import Curves
from synth.film.spot_kernels import REACH, SCANNER_RANGE, Line, cross_rows, develop, draw_line, scan, spot_table
from synth.phase import Floats
from synth.seeds import generator

NODE = 1.0 / 128  # s: a cubic then errs by 1e-9 of a swing of 1 s


@dataclass(frozen=True)
class Crossings:
    """Where the traces cross the centre lines of a strip's rows, (traces, rows) each: s, rad, px, px/px."""

    time: Floats
    elongation: Floats
    column: Floats
    slope: Floats


class Exposure:
    """The latent image of a film, strip by strip in order."""

    def __init__(self, plan: FilmPlan) -> None:
        film, geometry, layout, source = plan.film, plan.geometry, plan.layout, plan.source
        self._geometry, self._transport, self._layout = geometry, plan.transport, layout
        self._light, self._begin, self._end = plan.light, source.begin, source.end
        self._node = min(NODE, source.step)
        self._curves = Curves(source, self._node)
        self._last_node = math.ceil((source.end - source.begin) / self._node)
        self._sigma = film.spot * geometry.pixels
        self._weight = film.speed * geometry.pixels * math.sqrt(2 * math.pi) * self._sigma
        span = int(2 * REACH * self._sigma) + 4
        self._table, self._across = spot_table(self._sigma), np.empty(span)
        corners = [(u, o) for u in (0.0, film.paper_width) for o in layout.offset]
        reaches = [geometry.row[2] * u + geometry.row[1] * o for u, o in corners]
        self._lead, self._lag = min(reaches), max(reaches)

    def strip(self, number: int) -> tuple[Pixels, Crossings]:
        """Exposure of the strip's rows, (rows, columns), and the crossings of its centre lines."""
        first = number * STRIP
        rows = min(STRIP, self._geometry.rows - first)
        image = np.zeros((rows, self._geometry.columns), np.float32)
        traces = self._layout.position.size
        found = Crossings(*(np.full((traces, rows), np.nan) for _ in range(4)))
        nodes = self._nodes(first, first + rows)
        if nodes.size < 2:
            return image, found
        swing, swing_rate = self._curves.at(nodes)
        travel, speed = self._transport.travel(nodes), self._transport.speed(nodes)
        place, map_ = self._layout, self._geometry
        for k in range(traces):
            along, across = travel + place.offset[k], place.position[k] + place.lever[k] * swing[k]
            across_rate = place.lever[k] * swing_rate[k]
            row, column = map_.rows_of(along, across), map_.columns_of(along, across)
            row_rate = map_.row[1] * speed + map_.row[2] * across_rate
            column_rate = map_.column[1] * speed + map_.column[2] * across_rate
            line = Line(nodes, row, row_rate, column, column_rate, swing[k], swing_rate[k])
            light = self._light[k].between(float(nodes[0]), float(nodes[-1]))
            draw_line(image, first, line, light, self._sigma, self._weight, self._table, self._across)
            cross_rows(first, line, found.time[k], found.column[k], found.slope[k], found.elongation[k])
        return image, found

    def _nodes(self, first: int, stop: int) -> Floats:
        """Times of the nodes between which any light falls on some rows."""
        reach = REACH * self._sigma + 2.0
        constant, along, _ = self._geometry.row
        ends = np.array([first - reach - self._lag, stop + reach - self._lead])
        earliest, latest = self._transport.time_at((ends - constant) / along)
        begin = max(math.floor((earliest - self._begin) / self._node) - 1, 0)
        end = min(math.ceil((latest - self._begin) / self._node) + 1, self._last_node)
        return np.minimum(self._begin + np.arange(begin, end + 1) * self._node, self._end)


class Development:
    """What a latent image becomes, strip by strip: silver, dirt, grain, the scanner's light; before its blur."""

    def __init__(self, plan: FilmPlan) -> None:
        film, geometry, self._seed = plan.film, plan.geometry, plan.seed
        self._film, self._geometry, self._dirt = film, geometry, Dirt(film, geometry, plan.seed)
        middle = (np.arange(geometry.columns) + 0.5) / geometry.columns * 2.0 - 1.0
        self._brightness = (1.0 - film.vignette * middle**2).astype(np.float32)
        self._noise = np.zeros((min(STRIP, geometry.rows), geometry.columns), np.float32)

    def strip(self, number: int, image: Pixels) -> Pixels:
        """Light from the strip, 0 to 1, in the place of its exposure."""
        film, map_, rows = self._film, self._geometry, len(image)
        first = number * STRIP
        left, right = map_.paper_edges(first, first + rows)
        rise = film.fog_gradient / map_.width * math.cos(map_.turn)
        down = np.arange(first, first + rows) + 0.5 - map_.corner[0]
        at_left = (0.5 - map_.corner[1]) * math.cos(map_.turn) - down * math.sin(map_.turn)
        fog = film.fog + film.fog_gradient * (at_left / map_.width - 0.5)
        develop(
            image, np.round(left).astype(np.int64), np.round(right).astype(np.int64), np.maximum(fog, 0.0), rise,
            film.density_max, film.half_exposure, film.gamma,
        )  # fmt: skip
        self._dirt.soil(image, first)
        noise = self._noise[:rows]
        if film.grain:
            generator(self._seed, f"film grain {number}").standard_normal(out=noise, dtype=np.float32)
        grain = np.float32(film.grain * film.dpi / 300.0)
        scan(image, noise, grain, np.float32(-math.log(10.0) / SCANNER_RANGE), self._brightness)
        if film.polarity == "positive":
            np.subtract(np.float32(1.0), image, out=image)
        return image


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
    image *= top
    np.rint(image, out=image)
    np.clip(image, np.float32(0.0), top, out=image)
    return image.astype(np.uint8) if bits == 8 else image.astype(np.uint16)
