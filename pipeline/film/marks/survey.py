"""How dense bands lie on a slow film and how fast they swing: sections here and there, and what most of them say.

A trace leaves the same light in every row: the mean place of a row's light is the trace's own, blurred by the spot.
Where the slit stands askew, light of other times comes in, and that place swings with overtones no pendulum has.
"""

from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import find_objects, label, uniform_filter1d

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats, median_present, row_means_present
from pipeline.film.emulsion import FilmEmulsion, plain_emulsion, shown_darkness
from pipeline.film.marks.dense_kernels import first_shapes, values
from pipeline.film.marks.search import commonest, exposed, spread_over
from pipeline.film.parts import Emulsion
from pipeline.film.scan.opening import OpenScan

SHADE = 3.0  # sigmas of the grain, from which a pixel is light
BRIGHTEST = 0.1  # exposure that counts: turning points are saturated, and the curve does not give their light
KNOWN, GUESSED = 0.3, 1.0  # of an exposure, 1 sigma of a pixel's grain up to which it is known, and at all believed
HIDDEN = 1e3  # 1 sigma of what is not known
SWINGS = 24  # of a section, about
USUAL_SWING = 18.0  # rows
USUAL_SPOT = 1.2  # px: 0.1 mm at 300 dpi
PLACES = 9  # sections
AGREE = 0.04  # of the rows in a swing, by which sections may differ: the paper's speed, and the section's length
MOST = 0.5  # of the sections that show bands, at least, that must agree
LEAST_LIGHT = 0.25  # of the share of lit pixels in the midst of bands, at their edges
NARROWEST = 12  # columns
BESIDE = 0.5  # of a band's width on either side, in which its light is searched
SHORTEST, LONGEST = 6.0, 120.0  # rows in a swing
PIECES, ROWS = 4, 256  # pieces, and rows in each, in which the darkest pixels are searched
DARKEST, SHARE = 1.08, 2e-4  # of the film's darkest pixels, that endless light makes; share of them
ASIDE = 2.0  # px by which bands may run aside over the film
STEEPEST, SHEARS = 0.035, 15  # tangent of the slit's slant, and how many are tried
AROUND = np.linspace(-0.0125, 0.0125, 11)  # the best of them, by a parabola
LEAST = 2.5e-3  # that matters
SLANT_PIECES, SLANT_SWINGS = 5, 12  # of the film, that show it, and swings in each
LESS = 0.8  # of what is left of the rows' mean places with a slit that stands askew the other way
Columns = tuple[int, int]  # First column, and the one behind the last


def light_of(exposure: NDArray[np.float32], left: int, right: int, least: float) -> tuple[Floats, Floats]:
    """Light of each row from `left` to before `right`, exposures from `least` on, and its mean column, px, or NaN."""
    part = exposure[:, left:right]
    lit = np.where(part > least, np.minimum(part, np.float32(BRIGHTEST)), np.float32(0.0))
    light = lit.sum(axis=1, dtype=np.float64)
    columns = (np.arange(left, right) + 0.5).astype(np.float32)
    with np.errstate(divide="ignore", invalid="ignore"):
        return light, np.where(light > 0.0, (lit @ columns) / light, np.nan)


def faintest(emulsion: Emulsion) -> float:
    """Exposure from which a pixel is light."""
    return SHADE * float(emulsion.noise(np.zeros(1, dtype=np.float32))[0])


def saturation(emulsion: Emulsion, unsure: float = KNOWN) -> float:
    """Exposure from which the grain of a pixel exceeds a share of it: how bright it was is no longer known."""
    light = np.linspace(0.02, 2.0, 100, dtype=np.float32)
    known = np.asarray(emulsion.noise(light), dtype=np.float64) < unsure * light
    return float(light[known].max()) if known.any() else float(light[-1])


class Saturated:
    """An emulsion whose pixels have no weight beyond the exposure `known`, and give at most `brightest`."""

    def __init__(self, emulsion: Emulsion) -> None:
        self.emulsion, self.known, self.brightest = emulsion, saturation(emulsion), saturation(emulsion, GUESSED)

    def exposure(self, pixels: NDArray[Any], first: int) -> NDArray[np.float32]:
        """Relative exposure of rows from `first` on, up to the highest that is believed."""
        return np.minimum(self.emulsion.exposure(pixels, first), np.float32(self.brightest))

    def noise(self, exposure: NDArray[np.float32]) -> NDArray[np.float32]:
        """1 sigma of the grain in units of exposure; without end where the film is saturated."""
        sigma = np.asarray(self.emulsion.noise(exposure), dtype=np.float32)
        return np.where(np.asarray(exposure) > self.known, np.float32(HIDDEN), sigma)


def inner_pieces(scan: OpenScan) -> list[tuple[int, int]]:
    """First row of some pieces of a film, not at its ends, and that behind the last."""
    height = min(ROWS, scan.rows)
    return [(first, first + height) for first in spread_over(scan.rows - height, PIECES, inside=True)]


def first_emulsion(scan: OpenScan) -> FilmEmulsion:
    """Blank film, and a guess of the curve: turning points of slow films are saturated, and suggest its end."""
    plain = plain_emulsion(scan)
    darkest = [float(np.quantile(shown_darkness(plain, scan, *piece), 1.0 - SHARE)) for piece in inner_pieces(scan)]
    least = max(DARKEST * float(np.median(darkest)), 3.0 * float(np.sqrt(plain.grain[0])))
    return replace(plain, curve=replace(plain.curve, darkest=least))


class Survey(NamedTuple):
    """Bands of a slow film from left to right, the rows in a swing, and how far bands run aside."""

    bands: tuple[Columns, ...]
    period: float
    lean: float = 0.0  # columns per row
    spot: float = USUAL_SPOT  # px, 1 sigma

    def windows(self, columns: int) -> list[Columns]:
        """Columns in which the light of each band is searched: half way to the next band at most."""
        half_way = [0, *((a + b) // 2 for (_, a), (b, _) in pairwise(self.bands)), columns]
        room = [int(BESIDE * (right - left)) for left, right in self.bands]
        return [
            (max(first, left - beside), min(last, right + beside))
            for (left, right), beside, (first, last) in zip(self.bands, room, pairwise(half_way), strict=True)
        ]


def survey(scan: OpenScan, emulsion: Emulsion, count: int | None) -> Survey:
    """Bands, `count` if known, and rows per swing; `RefusedError`: none, fewer, or sections contradict each other."""
    length, least = min(scan.rows, int(SWINGS * USUAL_SWING)), faintest(emulsion)
    shown: list[list[Columns]] = []
    periods: list[float] = []
    places: list[list[float]] = []  # first row, and mean column of each band
    for begin in spread_over(scan.rows - length, PLACES, inside=True):
        piece = exposed(scan, emulsion, begin, begin + length)
        if here := bands(piece > least, count):
            shown.append(here)
            periods.append(rows_per_swing(piece, here, least))
            places.append([begin, *(mean_place(light_of(piece, *band, least)[1]) for band in here)])
    numbers = [len(here) for here in shown]
    count = count or int(np.median(numbers or [1]))
    whole = np.array([here for here in shown if len(here) == count])
    if len(whole) < max(1.0, MOST * len(shown)):
        raise RefusedError(
            f"film: {max(numbers, default=0)} swinging bands found, {count} expected; bands that lie over each other "
            "cannot be told apart on a slow film: give the traces' number, or scan them one by one"
        )
    edges = zip(whole[:, :, 0].min(axis=0).tolist(), whole[:, :, 1].max(axis=0).tolist(), strict=True)
    agreeing = commonest(np.array(periods), 1.0 + AGREE)
    if agreeing.size < MOST * len(periods):
        raise RefusedError(
            f"film: sections disagree on the rows in a swing ({min(periods):.1f} to {max(periods):.1f}); "
            "cut the film where its speed changes and read the parts one by one"
        )
    row, *columns = np.array([each for each in places if len(each) == count + 1]).T
    a, b = np.triu_indices(row.size, 1)
    leans = np.concatenate([(column[b] - column[a]) / (row[b] - row[a]) for column in columns])
    spot = USUAL_SPOT if scan.scale is None else 0.1 / scan.scale
    return Survey(tuple(edges), float(np.median(agreeing)), median_present(leans) if leans.size else 0.0, spot)


def mean_place(column: Floats) -> float:
    """Mean column of a section's light, (rows,), free of its swings: ends fade; NaN without light."""
    weight = np.where(np.isfinite(column), np.hanning(column.size + 2)[1:-1], 0.0)
    return float(np.nansum(weight * column) / weight.sum()) if weight.any() else float("nan")


def bands(lit: NDArray[np.bool_], count: int | None) -> list[Columns]:
    """Bands of columns in which pixels of a piece of film are lit, the `count` most lit ones, from left to right."""
    # shares, not light: in the midst of a band strokes are faint, but there are as many
    profile = uniform_filter1d(lit.mean(axis=0), 7, mode="constant")
    if not profile.max() > 0.0:
        return []
    inside = profile > LEAST_LIGHT * np.percentile(profile[profile > 0.1 * profile.max()], 50)
    for (dark,) in find_objects(label(~inside)[0]):
        inside[dark] = dark.stop - dark.start < NARROWEST // 2 and dark.start > 0 and dark.stop < inside.size
    runs = [(each.start, each.stop) for (each,) in find_objects(label(inside)[0])]
    wide = [(left, right) for left, right in runs if right - left >= NARROWEST]
    return sorted(sorted(wide, key=lambda band: -float(profile[slice(*band)].sum()))[:count])


def rows_per_swing(exposure: NDArray[np.float32], found: list[Columns], least: float) -> float:
    """Rows in one swing, by the strongest line of all bands' mean places; swell, which is slower, weighs less."""
    size = 8 * exposure.shape[0]
    frequency = np.fft.rfftfreq(size)
    power = np.zeros(frequency.size)
    for left, right in found:
        _, series = light_of(exposure, left, right, least)
        series = np.where(np.isfinite(series), series, row_means_present(series[None])[0])
        power += np.abs(np.fft.rfft((series - series.mean()) * np.hanning(series.size), size)) ** 2
    inside = (frequency > 1.0 / LONGEST) & (frequency < 1.0 / SHORTEST)
    top = int(np.argmax(np.where(inside, power * frequency**2, 0.0)))
    a, b, c = np.log(np.maximum(power[top - 1 : top + 2], 1e-300))
    return float(size / (top + 0.5 * (a - c) / (a - 2.0 * b + c)))


class Lie(NamedTuple):
    """How a film lies; see `OpenScan.straightened`."""

    lean: float = 0.0  # columns by which bands run aside per row
    shear: float = 0.0  # rows by which the image lags per column


def lie_of(scan: OpenScan, count: int | None) -> Lie:
    """How a slow film with `count` traces, if known, lies; exactly 0 if not askew. `RefusedError`: other bands."""
    emulsion = first_emulsion(scan)
    found, upright, lie = survey(scan, emulsion, count), scan, Lie()
    if abs(found.lean) * scan.rows > ASIDE:
        lie = Lie(found.lean, -found.lean)  # as of a film that was turned in the scanner
        upright = scan.straightened(*lie)
        found = survey(upright, emulsion, count)
    windows, period, least = found.windows(upright.columns), found.period, faintest(emulsion)

    def overtones(shear: float) -> float:
        shown, away = scan.straightened(lie.lean, lie.shear + shear), []
        length = min(int(SLANT_SWINGS * period), shown.rows)
        for first in spread_over(shown.rows - length, SLANT_PIECES):
            piece = exposed(shown, emulsion, first, first + length)
            for window in windows:
                light, column = light_of(piece, *window, least)
                middle = np.arange(1.5 * period, light.size - 1.5 * period, period)
                shapes = first_shapes(light, column, 0, middle, period, found.spot)
                at = middle[:, None] + np.linspace(-0.5, 0.5, int(period))
                fitted = values(shapes[:, None], at - middle[:, None], period)[0]
                away.append(np.abs(np.interp(at, np.arange(light.size) + 0.5, column) - fitted).ravel())
        return median_present(np.concatenate(away))

    tried = np.linspace(-STEEPEST, STEEPEST, SHEARS)
    near = tried[int(np.nanargmin([overtones(float(shear)) for shear in tried]))] + AROUND
    bend, slope, _ = np.polyfit(near, [overtones(float(shear)) for shear in near], 2)
    askew = float(np.clip(-0.5 * slope / bend, near[0], near[-1])) if bend > 0.0 else 0.0
    if abs(askew) < LEAST or overtones(askew) > LESS * overtones(-askew):
        return lie
    return lie._replace(shear=lie.shear + askew)
