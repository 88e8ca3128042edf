"""Where dense bands lie on a slow film and how fast they swing: sections here and there, and what most of them say.

Light is time: whatever its speed, a trace leaves the same light in every row. So the mean place of a row's light is the
trace's own place, blurred by the spot, though a row may show two strokes and two halves of turning points.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats, row_means_present
from pipeline.film.marks.pieces import exposed
from pipeline.film.parts import Emulsion
from pipeline.film.scan.opening import OpenScan
from pipeline.film.strobe.dense_kernels import CUBIC, SIZE, values

SHADE = 3.0  # sigmas of the grain, from which a pixel is light
ROOM = np.array([1e3, 90.0, 45.0, 20.0, 1e3, 20.0, 5.0, 1e3, 20.0, 5.0])  # px, of a shape: swell as large as the swing
NOISE = 4.0  # px, 1 sigma of a row's mean place
ROUNDS = 4
FARTHEST = 2.0  # NOISE or usual residuals, of a row that counts in full
BRIGHTEST = 0.1  # exposure that counts: turning points are saturated, and the curve does not give their light
DARK = 0.3  # of the usual light of a row, below which it shows nothing
KNOWN, GUESSED = 0.3, 1.0  # of an exposure, 1 sigma of a pixel's grain up to which it is known, and at all believed
HIDDEN = 1e3  # 1 sigma of what is not known
SWINGS = 24  # of a section, about
USUAL_SWING = 18.0  # rows
PLACES = 9  # sections
AGREE = 0.04  # of the rows in a swing, by which sections may differ: the paper's speed, and the section's length
MOST = 0.5  # of the sections that show bands, at least, that must agree
LEAST_LIGHT = 0.25  # of the share of lit pixels in the midst of bands, at their edges
NARROWEST = 12  # columns
SHORTEST, LONGEST = 6.0, 120.0  # rows in a swing


def light_of(exposure: NDArray[np.float32], left: int, right: int, least: float) -> tuple[Floats, Floats]:
    """Light of each row between two columns, (rows,), and its mean column, px; NaN without light.

    A pixel is light from the exposure `least` on; `right` is the column behind the last.
    """
    part = exposure[:, left:right]
    lit = np.where(part > least, np.minimum(part, np.float32(BRIGHTEST)), np.float32(0.0))
    light = lit.sum(axis=1, dtype=np.float64)
    columns = (np.arange(left, right) + 0.5).astype(np.float32)
    with np.errstate(divide="ignore", invalid="ignore"):
        return light, np.where(light > 0.0, (lit @ columns) / light, np.nan)


def first_shapes(
    light: Floats, column: Floats, first: int, middles: Floats, period: float, spot: float
) -> tuple[Floats, Floats]:
    """Curves (blocks, SIZE) around the rows `middles`, by `light_of` the rows from `first` on, and residuals (blocks,).

    The residual is the usual distance of the rows' light from the curve, px; NaN where too few rows show light.
    """
    turn, count = 2.0 * np.pi / period, int(np.ceil(2.0 * period))
    at = np.round(middles - period).astype(np.int64)[:, None] - first + np.arange(count)
    inside = (at >= 0) & (at < light.size)
    at = np.clip(at, 0, light.size - 1)
    shown = np.where(inside & np.isfinite(column[at]), light[at], 0.0)
    usual = np.median(shown, axis=1, keepdims=True)
    trust = np.where((shown > DARK * usual) & (usual > 0.0), 1.0, 0.0)
    value = np.nan_to_num(column[at])
    level = np.sum(trust * value, axis=1) / np.maximum(trust.sum(axis=1), 1.0)
    away = at + first + 0.5 - middles[:, None]
    design = np.moveaxis(values(np.eye(SIZE)[:, None, None], away, period)[0], 0, -1)
    shapes, residual = np.zeros((middles.size, SIZE)), np.zeros(middles.size)
    weight = trust
    for _ in range(ROUNDS):
        weighed = design * weight[:, :, None]
        normal = np.swapaxes(weighed, 1, 2) @ design + np.diag((NOISE / ROOM) ** 2)
        right = np.swapaxes(weighed, 1, 2) @ (value - level[:, None])[:, :, None]
        shapes = np.linalg.solve(normal, right)[:, :, 0]
        distance = np.abs((design @ shapes[:, :, None])[:, :, 0] - value + level[:, None])
        residual = 1.4826 * np.median(distance, axis=1)
        limit = FARTHEST * np.maximum(residual, NOISE)[:, None]
        weight = trust * np.minimum(1.0, limit / np.maximum(distance, 1e-9)) ** 2
    shapes[:, 0] += level
    shapes[:, CUBIC:] *= np.exp(0.5 * (turn * spot) ** 2)  # the spot blurs the swing
    few = trust.sum(axis=1) < 0.7 * count
    return shapes, np.where(few, np.nan, residual)


def faintest(emulsion: Emulsion) -> float:
    """Exposure from which a pixel is light."""
    return SHADE * float(emulsion.noise(np.zeros(1, dtype=np.float32))[0])


def saturation(emulsion: Emulsion, unsure: float = KNOWN) -> float:
    """Exposure from which the grain of a pixel exceeds a share of it: how bright it was is no longer known."""
    light = np.linspace(0.02, 2.0, 100, dtype=np.float32)
    known = np.asarray(emulsion.noise(light), dtype=np.float64) < unsure * light
    return float(light[known].max()) if known.any() else float(light[-1])


@dataclass(frozen=True)
class Saturated:
    """An emulsion whose pixels have no weight beyond the exposure `known`, and give at most `brightest`."""

    emulsion: Emulsion
    known: float
    brightest: float

    @staticmethod
    def of(emulsion: Emulsion) -> Saturated:
        """The same emulsion with an end to what it resolves."""
        return Saturated(emulsion, saturation(emulsion), saturation(emulsion, GUESSED))

    def exposure(self, pixels: NDArray[Any], first: int) -> NDArray[np.float32]:
        """Relative exposure of rows from `first` on, up to the highest that is believed."""
        return np.minimum(self.emulsion.exposure(pixels, first), np.float32(self.brightest))

    def noise(self, exposure: NDArray[np.float32]) -> NDArray[np.float32]:
        """1 sigma of the grain in units of exposure; without end where the film is saturated."""
        sigma = np.asarray(self.emulsion.noise(exposure), dtype=np.float32)
        return np.where(np.asarray(exposure) > self.known, np.float32(HIDDEN), sigma)


class Band(NamedTuple):
    """Columns of a band of swings."""

    left: int
    right: int


class Survey(NamedTuple):
    """Bands of a slow film from left to right, and the rows in a swing."""

    bands: tuple[Band, ...]
    period: float


def survey(scan: OpenScan, emulsion: Emulsion, count: int | None) -> Survey:
    """Bands, `count` if known, and rows per swing of a film, as most of its sections show them.

    Raises
    ------
    RefusedError
        No swinging band was found, fewer than were expected, or the sections contradict each other.
    """
    length = min(scan.rows, int(SWINGS * USUAL_SWING))
    least = faintest(emulsion)
    sections = []
    for begin in np.unique(np.linspace(0, scan.rows - length, PLACES + 2).astype(int)[1:-1]):
        piece = exposed(scan, emulsion, int(begin), int(begin) + length)
        here = bands(piece > least, count)
        if here:
            sections.append((here, rows_per_swing(piece, here, least)))
    count = count or (int(np.median([len(here) for here, _ in sections])) if sections else 1)
    whole = [(here, period) for here, period in sections if len(here) == count]
    if len(whole) < MOST * len(sections) or not whole:
        most = max((len(here) for here, _ in sections), default=0)
        raise RefusedError(
            f"film: {most} swinging bands found, {count} expected; bands that lie over each other "
            "cannot be told apart on a slow film: give the traces' number, or scan them one by one"
        )
    edges = np.array([here for here, _ in whole])
    together = zip(edges[:, :, 0].min(axis=0).tolist(), edges[:, :, 1].max(axis=0).tolist(), strict=True)
    return Survey(tuple(Band(*each) for each in together), voted([period for _, period in sections]))


def voted(periods: list[float]) -> float:
    """The rows in a swing on which most sections agree; raises `RefusedError` where fewer than half of them do."""
    ordered = np.sort(periods)
    within = np.searchsorted(ordered, ordered * (1.0 + AGREE)) - np.arange(ordered.size)
    start = int(np.argmax(within))
    if within[start] < MOST * ordered.size:
        raise RefusedError(
            f"film: sections disagree on the rows in a swing ({ordered[0]:.1f} to {ordered[-1]:.1f}); "
            "cut the film where its speed changes and read the parts one by one"
        )
    return float(np.median(ordered[start : start + within[start]]))


def bands(lit: NDArray[np.bool_], count: int | None) -> list[Band]:
    """Bands of columns in which pixels of a piece of film are lit, the `count` most lit ones, from left to right."""
    # shares, not light: in the midst of a band strokes are faint, but there are as many
    profile = uniform_filter1d(lit.mean(axis=0), 7, mode="constant")
    if not profile.max() > 0.0:
        return []
    inside = profile > LEAST_LIGHT * np.percentile(profile[profile > 0.1 * profile.max()], 50)
    edge = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(np.int8)))
    found: list[Band] = []
    for left, right in zip(edge[::2], edge[1::2], strict=True):
        if found and left - found[-1].right < NARROWEST // 2:
            found[-1] = Band(found[-1].left, int(right))
        else:
            found.append(Band(int(left), int(right)))
    found = [band for band in found if band.right - band.left >= NARROWEST]
    return sorted(sorted(found, key=lambda band: -float(profile[band.left : band.right].sum()))[:count])


def rows_per_swing(exposure: NDArray[np.float32], found: list[Band], least: float) -> float:
    """Rows in one swing, by the strongest line of all bands' mean places; swell, which is slower, weighs less."""
    size = 8 * exposure.shape[0]
    frequency = np.fft.rfftfreq(size)
    power = np.zeros(frequency.size)
    for band in found:
        _, series = light_of(exposure, band.left, band.right, least)
        series = np.where(np.isfinite(series), series, row_means_present(series[None])[0])
        power += np.abs(np.fft.rfft((series - series.mean()) * np.hanning(series.size), size)) ** 2
    inside = (frequency > 1.0 / LONGEST) & (frequency < 1.0 / SHORTEST)
    weighed: Floats = np.where(inside, power * frequency**2, 0.0)
    top = int(np.argmax(weighed))
    a, b, c = np.log(np.maximum(power[top - 1 : top + 2], 1e-300))
    return float(size / (top + 0.5 * (a - c) / (a - 2.0 * b + c)))
