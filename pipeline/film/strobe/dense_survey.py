"""Where dense bands lie on a slow film and how fast they swing: sections here and there, and what most of them say."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RefusedError
from pipeline.arrays import row_means_present
from pipeline.film.marks.pieces import exposed
from pipeline.film.parts import Emulsion, Expected, Floats, Scan
from pipeline.film.strobe.dense_start import SHADE, light_of

SWINGS = 24  # of a section, about
USUAL_SWING = 18.0  # rows
PLACES = 9  # sections
AGREE = 0.04  # of the rows in a swing, by which sections may differ: the paper's speed, and the section's length
MOST = 0.5  # of the sections that show bands, at least, that must agree
LEAST_LIGHT = 0.25  # of the share of lit pixels in the midst of bands, at their edges
NARROWEST = 12  # columns
SHORTEST, LONGEST = 6.0, 120.0  # rows in a swing


@dataclass(frozen=True)
class Band:
    """A band of swings: columns from `left` to `right`."""

    left: int
    right: int


@dataclass(frozen=True)
class Survey:
    """What a slow film shows: bands from left to right, and the rows in a swing."""

    bands: tuple[Band, ...]
    period: float


def survey(scan: Scan, emulsion: Emulsion, known: Expected) -> Survey:
    """Bands and rows per swing of a film, as most of its sections show them.

    Raises
    ------
    RefusedError
        No swinging band was found, fewer than were expected, or the sections contradict each other.
    """
    length = min(scan.rows, int(SWINGS * (known.rows_per_swing or USUAL_SWING)))
    least = SHADE * float(emulsion.noise(np.zeros(1, dtype=np.float32))[0])
    sections = []
    for begin in np.unique(np.linspace(0, scan.rows - length, PLACES + 2).astype(int)[1:-1]):
        piece = exposed(scan, emulsion, int(begin), int(begin) + length)
        here = bands(piece > least, known.count)
        if here:
            sections.append((here, rows_per_swing(piece, here, least)))
    count = known.count or (int(np.median([len(here) for here, _ in sections])) if sections else 1)
    whole = [(here, period) for here, period in sections if len(here) == count]
    if len(whole) < MOST * len(sections) or not whole:
        most = max((len(here) for here, _ in sections), default=0)
        raise RefusedError(
            f"film: {most} swinging bands found, {count} expected; bands that lie over each other "
            "cannot be told apart on a slow film: give the traces' number, or scan them one by one"
        )
    edges = np.array([[(band.left, band.right) for band in here] for here, _ in whole])
    left, right = edges[:, :, 0].min(axis=0), edges[:, :, 1].max(axis=0)
    together = tuple(Band(int(a), int(b)) for a, b in zip(left, right, strict=True))
    return Survey(together, known.rows_per_swing or voted([period for _, period in sections]))


def voted(periods: list[float]) -> float:
    """The rows in a swing on which most sections agree.

    Raises
    ------
    RefusedError
        Fewer than half of them do.

    Examples
    --------
    >>> voted([17.9, 18.0, 35.2, 17.8, 17.9])
    17.9
    """
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
    profile = np.convolve(lit.mean(axis=0), np.ones(7) / 7.0, "same")
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
    brightest = sorted(found, key=lambda band: -float(profile[band.left : band.right].sum()))
    kept = brightest if count is None else brightest[:count]
    return sorted(kept, key=lambda band: band.left)


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
