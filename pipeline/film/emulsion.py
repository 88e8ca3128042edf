"""The emulsion of one film: from pixels to darkness above blank, and from there to exposure; all measured on the film.

Blank film shows fog, vignette and an uneven lamp, place by place. Lines would draw a median up or down, so a mean is
taken of what lies about the middle, clipped again and again.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter, median_filter

from pipeline.arrays import Floats, median_present
from pipeline.film.marks.lines import BLIND, Lines, lines_across
from pipeline.film.scan.opening import OpenScan
from synth.kernels.compiled import making_kernel

HIGHEST_EXPOSURE = 4.0
TABLE_SIZE = 4097
STEP = HIGHEST_EXPOSURE / (TABLE_SIZE - 1)  # of the exposure in tables of the curve
STRIP_ROWS, TALLER = 16, 4  # of a strip; times that, to show film between marks across it
MOST_STRIPS = 48
BLOCK_COLUMNS = 64
CLIP = 2.0  # sigma; a normal distribution cut there has this much smaller a sigma:
CLIPPED_SIGMA = 0.8796
BLANK, BESIDE = 3.5, (5, 17)  # sigmas, within which a pixel is one of blank film; px that are left out about others
CLUMPS, PLATEAU = 12, 8  # px over which grain may be alike; and over which background is
FAINT = 0.02  # correlation of none
BED = 0.3  # of darkness above the film's, from which a block lies beside it
ROUNDS = 4
TURNS, LEAST_PIXELS = 3, 64  # of what lies between marks and what marks are; of a block, that lie between marks
UNMARKED = 1e-3  # darkness that marks across the film add at most, where film lies between them
LEAST_SIGMA = 2.5e-3  # of a pixel of blank film: without grain it is rounded, and no background is known better
LEAST_GROWTH = 5e-5  # the model of a line leaves a hundredth or so of its darkness, whatever the grain
STEEPEST_GRAIN = 100.0  # growth of the variance over that on blank film, per unit of darkness
Floats32 = NDArray[np.float32]
Unlit = Callable[[int, int, int], NDArray[np.bool_]]  # from its first row, rows and columns: film that no line lit


class Lens(NamedTuple):
    """Optics as the kernels take them; `table` (2, m) holds darkness and its derivative at every `STEP` of exposure."""

    spot: float
    shear: float
    grain: Floats
    table: Floats


@dataclass(frozen=True)
class Optics:
    """Spot, slit, characteristic curve and grain."""

    spot: float  # px, 1 sigma of the spot as the scan shows it
    shear: float  # rows by which the image lags per column
    curve: "ToneCurve"  # darkness above blank against exposure
    grain: Floats  # (2,) variance of a pixel's darkness on blank film, and its growth per unit of darkness above it

    @cached_property
    def lens(self) -> Lens:
        """For the kernels."""
        return Lens(self.spot, self.shear, self.grain, self.curve.table())


@dataclass(frozen=True)
class FilmEmulsion(Optics):
    """How light became pixels: blank film, grain, characteristic curve; spot and shear are 0 where not known."""

    full_scale: int  # value of the lightest pixel
    blank: "Blank"  # darkness of blank film, place by place
    clumps: Floats = field(default_factory=lambda: np.ones(1))  # correlation of grain by the distance across, px
    swing: float = 0.0  # rows in a swing of the traces by which all this was measured; 0 where it is not known
    blur: float = 0.0  # px2, half the variance of the scanner's blur, which is taken out of the pixels

    @cached_property
    def _exposures(self) -> Floats32:
        return self.curve.exposure(np.linspace(0.0, self.curve.darkest, 4096)).astype(np.float32)

    @property
    def blackest(self) -> float:
        """Darkness above blank film from which a pixel can be no darker."""
        blank = self.blank.darkness
        return float(np.log10(self.full_scale / 0.75) - blank.max(where=blank < np.median(blank) + BED, initial=0.0))

    def darkness(self, pixels: NDArray[Any], first: int, blind: float = 0.0) -> Floats32:
        """Darkness above blank film of rows from `first` on, (rows, columns), log10 units; `blind` on dark marks."""
        knots, (rows, columns) = self.blank.rows, pixels.shape
        at = first + np.arange(rows) + 0.5
        strip = np.clip(np.searchsorted(knots, at) - 1, 0, max(0, knots.size - 2))
        below = np.minimum(strip + 1, knots.size - 1)
        weight = np.clip((at - knots[strip]) / np.maximum(knots[below] - knots[strip], 1.0), 0.0, 1.0)
        centres, top = np.arange(columns) + 0.5, strip[0]
        shown = self.blank.darkness[top : below[-1] + 1]
        levels = np.stack([np.interp(centres, self.blank.columns, level) for level in shown]).astype(np.float32)
        table, blur = darkness_table(self.full_scale), np.float32(self.blur)
        out = darkness_above(pixels, table, levels, strip - top, weight.astype(np.float32), blur)
        if self.blank.across is None:
            return out
        added = self.blank.across.over(first, rows, columns)
        return np.where(added > BLIND, np.float32(blind), out - added)

    def exposure(self, pixels: NDArray[Any], first: int) -> Floats32:
        """Relative exposure of rows from `first` on, 0 on blank film, 1 on the axis of a line at rest."""
        return self.lit(self.darkness(pixels, first))

    def lit(self, darkness: Floats32) -> Floats32:
        """Relative exposure of what is so dark above blank film."""
        return look_up(darkness, self._exposures, np.float32((self._exposures.size - 1) / self.curve.darkest))

    def clumped(self, slope: Floats) -> Floats:
        """Factor in the variance of a line's column on a row, by its slope, where grain is alike on pixels near by.

        Errors at the distance d with correlation r add `r (1 - d^2 / 2 s^2) exp(-d^2 / 4 s^2)`, s the line's 1 sigma.
        """
        squares = np.square(np.arange(1, self.clumps.size)) / (self.spot**2 * (1.0 + slope[..., None] ** 2))
        added = self.clumps[1:] * (1.0 - 0.5 * squares) * np.exp(-0.25 * squares)
        return np.asarray(np.maximum(1.0 + 2.0 * added.sum(axis=-1), 1.0))

    def noise(self, exposure: Floats32) -> Floats32:
        """1 sigma of the grain in units of exposure; on blank film that of the faintest exposure that stands out."""
        faint = float(self.curve.exposure(np.sqrt(self.grain[0])))
        value = np.clip(np.asarray(exposure, dtype=np.float64), faint, HIGHEST_EXPOSURE)
        sigma = np.sqrt(self.grain[0] + self.grain[1] * self.curve.darkness(value))
        return np.asarray(sigma / np.maximum(self.curve.rate(value), 1e-6), dtype=np.float32)


@dataclass(frozen=True)
class ToneCurve:
    """Darkness above blank film, `darkest (1 - (1 + (E/middle)^contrast/shoulder)^-shoulder)`: toe to shoulder.

    Darkness is log10 of the blank pixel over the pixel, `darkest` that of endless exposure. With a shoulder of 1,
    `middle` gives half of it, and the straight part rises by `darkest*contrast/4` per e-fold of exposure.
    """

    darkest: float
    middle: float
    contrast: float
    shoulder: float = 1.0

    def darkness(self, exposure: ArrayLike) -> Floats:
        """Darkness at a relative exposure, 0 for none."""
        ratio = (np.maximum(np.asarray(exposure, dtype=np.float64), 0.0) / self.middle) ** self.contrast
        share = -np.expm1(-self.shoulder * np.log1p(ratio / self.shoulder))
        return np.asarray(self.darkest * share, dtype=np.float64)

    def exposure(self, darkness: ArrayLike) -> Floats:
        """Exposure that gives a darkness; the highest of the table where the film is saturated."""
        share = np.clip(np.asarray(darkness, dtype=np.float64) / self.darkest, 0.0, 1.0 - 1e-9)
        ratio = self.shoulder * np.expm1(-np.log1p(-share) / self.shoulder)
        value = self.middle * ratio ** (1.0 / self.contrast)
        return np.asarray(np.minimum(value, HIGHEST_EXPOSURE), dtype=np.float64)

    def rate(self, exposure: ArrayLike) -> Floats:
        """Derivative of the darkness by the exposure."""
        value = np.maximum(np.asarray(exposure, dtype=np.float64), 1e-9)
        ratio = (value / self.middle) ** self.contrast
        fall = (1.0 + ratio / self.shoulder) ** (-self.shoulder - 1.0)
        return np.asarray(self.darkest * self.contrast * ratio / value * fall, dtype=np.float64)

    def table(self) -> Floats:
        """Darkness and its derivative at even steps from 0 to the highest exposure, (2, size)."""
        grid = np.linspace(0.0, HIGHEST_EXPOSURE, TABLE_SIZE)
        return np.stack([self.darkness(grid), self.rate(np.maximum(grid, 0.25 * grid[1]))])


UNTOLD = ToneCurve(0.6, 0.2, 1.5)  # Where nothing swings on the film, from which its curve could be told


def plain_emulsion(scan: OpenScan) -> FilmEmulsion:
    """Blank film and its grain; the rest is untold."""
    across = None
    for turn in range(TURNS + 1):  # marks across the film mislead what lies between them
        blank = measure_blank(scan, across)
        grain = max(blank.sigma, LEAST_SIGMA) ** 2 * np.array([1.0, 10.0])
        plain = FilmEmulsion(0.0, 0.0, UNTOLD, grain, scan.full_scale, blank)
        if turn < TURNS:
            across = lines_across(partial(shown_darkness, plain, scan), scan.rows, scan.columns)
        if across is None:
            return plain
    return replace(plain, blank=blank._replace(across=across))


def shown_darkness(emulsion: FilmEmulsion, scan: OpenScan, first: int, stop: int, blind: float = 0.0) -> Floats32:
    """Darkness above blank film of the rows `first` to `stop` of a scan; `blind` on dark marks."""
    top, bottom = max(first - 1, 0), min(stop + 1, scan.rows)  # the rows beside take part in the blur
    return emulsion.darkness(scan.read(top, bottom), top, blind)[first - top :][: stop - first]


class Blank(NamedTuple):
    """Blank film; time marks that run across all of it are blank film, too."""

    rows: Floats  # (m,) px, of blocks' centres
    columns: Floats  # (n,) px
    darkness: Floats  # (m, n), log10 units below full scale
    sigma: float  # of one pixel
    across: Lines | None = None


def bounded_growth(growth: float, blank: float) -> float:
    """Growth of the variance of a pixel's darkness with it within what films show; `blank` is that on blank film."""
    return float(np.clip(growth, LEAST_GROWTH, max(STEEPEST_GRAIN * blank, LEAST_GROWTH)))


@lru_cache
def darkness_table(full_scale: int) -> Floats32:
    """Log10 of full scale over pixel, for every value a pixel can have."""
    values = np.arange(full_scale + 1, dtype=np.float64)
    values[0] = 0.5
    return np.log10(full_scale / values).astype(np.float32)


def measure_blank(scan: OpenScan, across: Lines | None = None, unlit: Unlit | None = None) -> Blank:
    """Blank film from strips spread over the whole scan, between the time marks `across` it, and where it is `unlit`.

    Faint lines that sweep over a block are no outliers of it: by what is unlit of others its level is mended.
    """
    strips = int(np.clip(scan.rows // (4 * STRIP_ROWS), 1, MOST_STRIPS))
    height = min(STRIP_ROWS if across is None else TALLER * STRIP_ROWS, scan.rows)
    firsts = np.linspace(0, scan.rows - height, strips).astype(int)
    edges = np.linspace(0, scan.columns, max(1, round(scan.columns / BLOCK_COLUMNS)) + 1).astype(int)
    level, spread, bare = np.full((3, strips, edges.size - 1), np.nan)
    for i, first in enumerate(firsts.tolist()):
        strip = darkness_table(scan.full_scale)[scan.read(first, first + height)]
        open_film = (
            np.full(strip.shape, True) if across is None else np.abs(across.over(first, *strip.shape)) < UNMARKED
        )
        dark = None if unlit is None else open_film & unlit(first, height, scan.columns)
        for j, (low, high) in enumerate(itertools.pairwise(edges)):
            unmarked = strip[:, low:high][open_film[:, low:high]].astype(np.float64)
            shown = unmarked if unmarked.size >= LEAST_PIXELS else strip[:, low:high].ravel()
            level[i, j], spread[i, j] = _clipped_mean(shown)
            if dark is not None and np.count_nonzero(dark[:, low:high]) >= LEAST_PIXELS:
                bare[i, j], _ = _clipped_mean(strip[:, low:high][dark[:, low:high]].astype(np.float64))
    if unlit is not None:
        away = bare - level
        usual = np.array([median_present(each) if np.isfinite(each).any() else 0.0 for each in away.T])
        level = level + np.where(np.isfinite(away), away, usual)
    return Blank(firsts + 0.5 * height, 0.5 * (edges[1:] + edges[:-1]), _smoothed(level), float(np.median(spread)))


def clumps_of(scan: OpenScan, emulsion: FilmEmulsion) -> tuple[Floats, float]:
    """Correlation of grain by pixels' distance from 0 on, px, and its variance, without the background's part."""
    lags, height = np.arange(CLUMPS + PLATEAU), min(STRIP_ROWS, scan.rows)
    products, pairs = np.zeros((2, lags.size))
    for first in np.linspace(0, scan.rows - height, MOST_STRIPS).astype(int).tolist():
        away = emulsion.darkness(scan.read(first, first + height), first)
        away -= np.median(away, axis=0)
        # the wings of lines are not blank
        blank = ~maximum_filter(np.abs(away) > BLANK * np.sqrt(emulsion.grain[0]), BESIDE)
        away = np.where(blank, away, 0.0)
        for lag in lags.tolist():
            products[lag] += np.vdot(away[:, lag:], away[:, : away.shape[1] - lag])
            pairs[lag] += np.count_nonzero(blank[:, lag:] & blank[:, : away.shape[1] - lag])
    alike = products / np.maximum(pairs, 1.0)
    alike -= alike[CLUMPS:].mean()
    faint = np.flatnonzero(alike < FAINT * alike[0])
    variance = max(float(alike[0]), 1e-12)
    return alike[: faint[0] if faint.size else CLUMPS] / variance, variance


def _clipped_mean(values: Floats) -> tuple[float, float]:
    """Mean and sigma of the blank pixels among others that are darker."""
    low, quarter, middle = np.quantile(values, [0.05, 0.25, 0.5])
    sigma = max(1.1 * float(quarter - low), 1e-6)  # (1.645 - 0.674) sigma
    mean = min(float(middle), float(quarter) + 0.674 * sigma)
    for _ in range(ROUNDS):
        kept = values[np.abs(values - mean) <= CLIP * sigma]
        if kept.size < 8:
            break
        mean, sigma = float(kept.mean()), max(float(kept.std()) / CLIPPED_SIGMA, 1e-6)
    return mean, sigma


def _smoothed(level: Floats) -> Floats:
    """Blocks that stand out of their neighbours (handwriting, dirt) take their neighbours' median."""
    # on along the slope at the edges, so that vignette does not stand out
    padded = np.pad(level, 1, mode="reflect", reflect_type="odd")
    median = median_filter(padded, 3)[1:-1, 1:-1]
    away = np.abs(level - median)
    return np.where(away > 4.0 * np.median(away) + 1e-4, median, level)


@making_kernel
def darkness_above(
    pixels: NDArray[np.uint16], table: Floats32, levels: Floats32, strip: NDArray[np.int64], weight: Floats32,
    blur: np.float32,
) -> Floats32:  # fmt: skip
    """Darkness above blank `levels` (strips, columns), the scanner's blur taken out to first order by a Laplacian."""
    rows, columns = pixels.shape
    last, own = table.size - 2, np.float32(1.0) + np.float32(4.0) * blur
    value, out = np.empty(columns, dtype=np.float32), np.empty((rows, columns), dtype=np.float32)
    for i in range(rows):
        upper, lower, share = levels[strip[i]], levels[min(strip[i] + 1, levels.shape[0] - 1)], weight[i]
        above, here, below = pixels[max(i - 1, 0)], pixels[i], pixels[min(i + 1, rows - 1)]
        for j in range(1, columns - 1):
            beside = np.float32(here[j - 1]) + np.float32(here[j + 1]) + np.float32(above[j]) + np.float32(below[j])
            value[j] = own * np.float32(here[j]) - blur * beside
        value[0], value[columns - 1] = here[0], here[columns - 1]
        for j in range(columns):
            index = min(max(int(value[j]), 0), last)
            dark = table[index] + (value[j] - index) * (table[index + 1] - table[index])
            out[i, j] = dark - (upper[j] + share * (lower[j] - upper[j]))
    return out


@making_kernel
def look_up(darkness: Floats32, exposures: Floats32, steps: np.float32) -> Floats32:
    """The `exposures` of darknesses that lie `steps` a unit."""
    out, last = np.empty_like(darkness), np.float32(exposures.size - 1)
    for i in range(darkness.shape[0]):
        for j in range(darkness.shape[1]):
            out[i, j] = exposures[int(min(max(darkness[i, j] * steps, np.float32(0.0)), last))]
    return out
