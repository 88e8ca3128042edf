"""Where the paper stood still: the light went on, and wrote the whole swing of every trace across a few rows.

Marks and pendulums cannot show it where it lasts about a whole number of swings, but the bar does: on other rows a
trace is at one place. Its light tells for how long the paper stood, to a third.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.film.marks.pieces import grain
from pipeline.film.parts import Emulsion, Floats, Tracks

if TYPE_CHECKING:
    from pipeline.film.marks.counting import Count, Swings

INNER, LEAST_COLUMNS = 0.8, 12.0  # of the swing, that a bar fills; px, of the least that can show one
QUANTILE = 0.25  # of the columns, which other traces and their gaps leave alone
SWEPT, FAINT = 0.4, 0.5  # of the light of one stroke, from which rows are a bar; of that, where another trace has one
CERTAIN = 6.0  # sigmas of the grain
STROKES = 3.0  # of a line, that a bar on which all depends has at least
ALONE = 0.5  # of the swing: across less, a stroke near its turn fills as much as a bar
DENSE = 0.7  # of a line at rest, light from which a bar may be blacker than it shows
APART = 20.0  # rows within which bars of several traces are one
BY_LIGHT, WANDER, PHASE_MOST = 0.35, 0.006, 60.0  # 1 sigma of a length's logarithm; rad a root mark; cost
LEAST, MOST, MORE = 4.0, 1.6, 16  # rows of a stand; times its length by light, and marks, that are tried
AROUND, FEWEST, LONGER = 16, 6, 64  # marks on either side that show the phase; how the ship shakes the pendulums
CLEAR = 10.0  # spots beside a swing
THICK, MARGIN = 24.0, 4  # spots, of a bar; rows on either side that have some of its light


class Stand(NamedTuple):
    """A place where the paper stood, on one trace or, brought together, at column 0 of the first."""

    row: float
    length: float  # of time, by the bar's light, in rows of the film at its usual speed
    saturated: bool  # whether it may have been longer
    sure: bool = True  # whether the bar would be believed by itself


Bars = list[list[Stand] | None]


class Swept(NamedTuple):
    """What of a trace's columns the light writes in one stroke across."""

    columns: NDArray[np.int64]
    beside: NDArray[np.int64]  # some that no trace sweeps, the same of all traces
    speed: Floats  # across the columns, over that in the middle
    stroke: float  # light along the rows of one stroke in the middle column, in rows of a line at rest
    peak: float  # light on the stroke's axis


def ends_of(tracks: Tracks) -> list[Floats]:
    """Columns between which each trace swings nearly always, (2,)."""
    return [np.nanpercentile(each, (2.0, 98.0)) if np.isfinite(each).any() else np.zeros(2) for each in tracks.course]


def free_columns(tracks: Tracks, columns: int, margin: int = 0) -> NDArray[np.int64]:
    """Of so many columns, those that no trace sweeps, but for a `margin` at either edge."""
    free = np.arange(margin, columns - margin)
    for low, high in ends_of(tracks):
        free = free[(free < low - CLEAR * tracks.spot) | (free > high + CLEAR * tracks.spot)]
    return free


def swept(tracks: Tracks, columns: int) -> list[Swept | None]:
    """Columns across the swing of each trace, of so many; None where it is too small to show a bar."""
    found: list[Swept | None] = []
    ends, free = ends_of(tracks), free_columns(tracks, columns, columns // 50)
    beside = free[:: max(free.size // 64, 1)]
    for trace, (low, high) in enumerate(ends):
        half = 0.5 * float(high - low)
        if half < LEAST_COLUMNS:
            found.append(None)
            continue
        aside = np.arange(-INNER * half, INNER * half, max(half / 32.0, 1.0))
        column = 0.5 * (low + high) + aside
        alone = np.ones(column.size, dtype=bool)
        for a, b in ends[:trace] + ends[trace + 1 :]:
            alone &= (column < a) | (column > b)
        if alone.sum() >= ALONE * alone.size:  # where another trace does not add its light
            column, aside = column[alone], aside[alone]
        slope = 2.0 * np.pi * half / tracks.rows_per_swing
        stroke, speed = float(np.sqrt(2.0 * np.pi)) * tracks.spot / slope, np.sqrt(1.0 - (aside / half) ** 2)
        found.append(Swept(column.astype(np.int64), beside, speed, stroke, 1.0 / float(np.hypot(1.0, slope))))
    return found


def light_across(exposure: NDArray[np.float32], across: list[Swept | None]) -> Floats:
    """What lies on each trace's columns, (2, traces, rows): light of all but a few, and its mean in strokes."""
    out = np.zeros((2, len(across), exposure.shape[0]))
    beside = next((own.beside for own in across if own is not None), np.empty(0, np.int64))
    stray = np.median(exposure[:, beside], axis=1) if beside.size else 0.0
    for trace, own in enumerate(across):
        if own is not None:
            light = exposure[:, np.clip(own.columns, 0, exposure.shape[1] - 1)]
            k = int(QUANTILE * own.columns.size)
            out[0, trace] = np.partition(light, k, axis=1)[:, k]
            out[1, trace] = (light @ own.speed - stray * own.speed.sum()) / (own.speed.size * own.stroke)
    return out


def bars(light: Floats, across: list[Swept | None], tracks: Tracks, emulsion: Emulsion) -> Bars:
    """The bars on each trace, None where it is too small or faint to show one, from what `light_across` gives."""
    dim = CERTAIN * float(grain(emulsion)[0][0])
    found: Bars = []
    for own, least, strokes in zip(across, *light, strict=True):
        if own is None or STROKES * own.peak < dim:
            found.append(None)
            continue
        usual, enough = float(np.median(least)), max(SWEPT * own.peak, dim)
        edges = np.flatnonzero(np.diff(least - usual > FAINT * enough, prepend=False, append=False))
        shown: list[Stand] = []
        for begin, stop in edges.reshape(-1, 2).tolist():
            if stop - begin > THICK * tracks.spot:
                continue
            rows = slice(max(begin - MARGIN, 0), stop + MARGIN)
            row = float(least[rows] @ (np.arange(least.size)[rows] + 0.5) / least[rows].sum())
            length = 0.5 * tracks.rows_per_swing * float((strokes[rows] - np.median(strokes)).sum())
            top = float(least[begin:stop].max())
            shown.append(Stand(row, length, top > DENSE, top - usual > enough))
        found.append(shown)
    return found


def together(found: Bars, offset: Floats, shear: float, across: Floats) -> list[Stand]:
    """Bars that all traces show that can, at one place of the paper; `across`, the traces' middle columns."""
    able = [(k, shown) for k, shown in enumerate(found) if shown is not None]
    shown = sorted(bar._replace(row=bar.row - offset[k] - shear * across[k]) for k, own in able for bar in own)
    edges = [0, *(1 + np.flatnonzero(np.diff([each.row for each in shown]) >= APART)), len(shown)]
    groups = [shown[first:stop] for first, stop in itertools.pairwise(edges)] if shown else []
    columns = [tuple(zip(*group, strict=True)) for group in groups if len(group) >= len(able)]
    return [
        Stand(float(np.mean(row)), float(np.mean(length)), any(saturated))
        for row, length, saturated, sure in columns
        if any(sure)
    ]


def lengths(
    before: Count, after: Count, rows: Floats, swings: Swings, stand: Stand, pace: float
) -> tuple[NDArray[np.int64], Floats]:
    """Numbers of marks from the last one before a stand to the first one after it, and their costs, the best first.

    Pendulums swing on: their phase tells the number but for whole swings, the bar's light those, roughly. `rows` are
    those of all events, `pace` the rows between marks.
    """
    moved = (rows[after.event[0]] - rows[before.event[-1]]) / pace
    length = max(stand.length, LEAST) / pace
    number = np.arange(max(int(np.ceil(moved + LEAST / pace)), 1), int(moved + MOST * length) + MORE)
    stood = (number - moved) / length
    away = np.log(np.maximum(stood, 1e-3)) / BY_LIGHT
    cost = np.where((stood > 1.0) & stand.saturated, 0.0, away**2)
    for phase, advance, sigma in zip(swings.phase, swings.advance, swings.sigma, strict=True):
        one, few, shaken = _extrapolated(before.index - before.index[-1], phase[before.event], advance)
        other, many, shakes = _extrapolated(after.index - after.index[0], phase[after.event], advance)
        if min(few, many) < FEWEST or not np.isfinite(advance):
            continue
        jump = np.angle(np.exp(1j * (other - one - advance * number)))
        variance = sigma**2 * (4.0 / few + 4.0 / many) + WANDER**2 * (number + AROUND) + shaken + shakes
        cost = cost + np.minimum(jump**2 / variance, PHASE_MOST)
    order = np.argsort(cost, kind="stable")
    return number[order], cost[order]


def _extrapolated(away: NDArray[np.int64], phase: Floats, advance: float) -> tuple[float, int, float]:
    """Phase at a mark by those nearest to it, so many marks away, and their number.

    Last: how the ship shakes it, the variance of the phase over a longer time, rad2.
    """
    known = np.isfinite(phase) & (np.abs(away) < LONGER)
    turned = np.exp(1j * (phase[known] - advance * away[known]))
    near = turned[np.abs(away[known]) < AROUND]
    middle = float(np.angle(near.sum()))
    return middle, near.size, float(np.mean(np.angle(turned * np.exp(-1j * middle)) ** 2)) if near.size else 0.0
