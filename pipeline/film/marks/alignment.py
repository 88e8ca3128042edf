"""What traces show together: gaps as closings of the shutter, and bars where the paper stood.

A gap shows on all traces at once: at row `r + offset + shear column`. Offsets may exceed the marks' spacing; the true
offset and shear bring most gaps together, as missing marks, false gaps and minute codes are the same on every trace.

Where the paper stood, the light wrote the whole swing of every trace across a few rows: a bar, whose light gives for
how long, to a third.
"""

import itertools
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.film.parts import Emulsion, Floats, Tracks

LEAST_DEPTH, DEEPEST, UNCERTAIN = 0.5, 1.5, 0.25  # share of the light that a gap takes, and its 1 sigma, at most
CERTAIN = 4.0  # sigmas
FARTHEST = 45.0  # px along the film between two traces
SHEARS = np.arange(-0.035, 0.035 + 1e-9, 0.00125)  # tangents that are tried, up to 2 degrees
BIN = 0.4  # px
ENOUGH = 24  # gaps that agree, from which shear and offset are fitted
UNEVEN = 0.15  # of the marks' spacing
CHANCE = 2.0  # roots of what another lag has
LEAD_ODD, LEAD, SHARE = 3, 8, 0.08  # odd gaps, gaps, and share of them, by which the best lag must lead
TOGETHER = 0.6  # of a gap's width, or one pixel
INNER, LEAST_COLUMNS = 0.8, 12.0  # of the swing, that a bar fills; px, of the least that can show one
QUANTILE = 0.25  # of the columns, which other traces and their gaps leave alone
SWEPT, FAINT = 0.4, 0.5  # of the light of one stroke, from which rows are a bar; of that, where another trace has one
BARE = 6.0  # sigmas of the grain
STROKES = 3.0  # of a line, that a bar on which all depends has at least
ALONE = 0.5  # of the swing: across less, a stroke near its turn fills as much as a bar
DENSE = 0.7  # of a line at rest, light from which a bar may be blacker than it shows
APART = 20.0  # rows within which bars of several traces are one
CLEAR = 10.0  # spots beside a swing
FOLLOWED = 0.7  # of two swings, that tells where they lie
THICK, MARGIN = 24.0, 4  # spots, of a bar; rows on either side that have some of its light
Whole = NDArray[np.int64]


@dataclass(frozen=True)
class Gaps:
    """Gaps on single traces, in order of their rows; an array each, in px, with 1 sigma."""

    trace: Whole
    row: Floats  # of the middle of the gap on the trace
    row_sigma: Floats
    column: Floats  # of the trace there, by the edges of the gap
    column_sigma: Floats
    slope: Floats
    width: Floats  # rows for which the shutter was closed
    width_sigma: Floats
    depth: Floats  # share of the light that the shutter held off: 1
    depth_sigma: Floats
    light: Floats  # of the line around the gap, over that of its slope
    misfit: Floats  # mean square of the pixels' residuals over that of their grain

    @staticmethod
    def of(trace: Whole, fitted: Floats) -> "Gaps":
        """From what `gap_kernels.fit_gaps` returns, (gaps, RESULTS)."""
        return Gaps(trace, *fitted.T.copy())

    def pick(self, which: NDArray[np.bool_] | Whole) -> "Gaps":
        """Some of them."""
        return Gaps(*(each[which] for each in vars(self).values()))

    def joined_by(self, more: "Gaps") -> "Gaps":
        """Both, in order of their rows."""
        both = Gaps(*(np.concatenate(each) for each in zip(vars(self).values(), vars(more).values(), strict=True)))
        return both.pick(np.argsort(both.row, kind="stable"))

    @property
    def certain(self) -> NDArray[np.bool_]:
        """Where a gap could be fitted, and it is known how much of the light is gone."""
        return np.asarray(np.isfinite(self.row) & (self.depth_sigma < UNCERTAIN))

    @property
    def closed(self) -> NDArray[np.bool_]:
        """Where that is all of it."""
        full = (self.depth > LEAST_DEPTH) & (self.depth < DEEPEST)
        return np.asarray(self.certain & full & (np.abs(self.depth - 1.0) < CERTAIN * self.depth_sigma + 0.1))

    @property
    def size(self) -> int:
        """Number of gaps."""
        return self.row.size


class Alignment(NamedTuple):
    """How the traces lie to each other."""

    offset: Floats  # (traces,), rows by which each lies later than the first
    shear: float  # rows by which the image lags per column
    sure: bool  # whether no other offset comes near


class Events(NamedTuple):
    """Closings of the shutter, in order."""

    row: Floats  # at column 0 of the first trace
    row_sigma: Floats
    width: Floats  # rows
    width_sigma: Floats
    member: Whole  # (traces, events), which gap shows it on each trace; -1 where none does


def aligned(gaps: Gaps, traces: int, spacing: float) -> Alignment:
    """Offsets and shear under which most gaps agree; `spacing` is about the rows between marks."""
    offset, sure, shear = np.zeros(traces), True, 0.0
    first = gaps.pick(gaps.trace == 0)
    reach = FARTHEST + SHEARS[-1] * float(np.ptp(gaps.column))
    for trace in range(1, traces):
        other = gaps.pick(gaps.trace == trace)
        low, high = (np.searchsorted(first.row, other.row + side * reach) for side in (-1.0, 1.0))
        j = np.repeat(np.arange(other.row.size), high - low)
        if j.size == 0:
            sure = False
            continue
        i = np.arange(j.size) - np.repeat(np.cumsum(high - low) - high, high - low)
        tried = SHEARS if trace == 1 else np.array([shear])
        along, across = other.row[j] - first.row[i], other.column[j] - first.column[i]
        odd = _odd(first.row, spacing)[i] & _odd(other.row, spacing)[j]
        table, odd_table = (
            np.array([_tally((along - step * across)[which]) for step in tried]) for which in (slice(None), odd)
        )
        which, at, certain = _chosen(table, odd_table, spacing)
        sure &= certain
        offset[trace], slant = (at + 1) * BIN - FARTHEST, float(tried[which])
        for within in (1.0, 0.5):
            near = np.abs(along - slant * across - offset[trace]) < within
            if near.sum() >= ENOUGH and trace == 1:
                slant, offset[trace] = np.polyfit(across[near], along[near], 1)
            elif near.sum() >= ENOUGH:
                offset[trace] = np.median(along[near] - slant * across[near])
        shear = float(slant)
    return Alignment(offset, shear, sure)


def _odd(rows: Floats, spacing: float) -> NDArray[np.bool_]:
    """Gaps not whole numbers of marks from their neighbours: codes and false gaps tell one mark from another."""
    apart = np.diff(rows) / spacing
    uneven = (np.abs(apart - np.round(apart)) > UNEVEN) & (apart < 3.0)
    return np.asarray(np.append(False, uneven) | np.append(uneven, False))


def _tally(lag: Floats) -> Whole:
    """How many lags lie in each two neighbouring bins."""
    lag = lag[np.abs(lag) <= FARTHEST]
    bins = np.bincount(((lag + FARTHEST) / BIN).astype(int), minlength=int(2 * FARTHEST / BIN) + 2)
    return np.asarray(bins[:-1] + bins[1:])


def _chosen(table: Whole, odd: Whole, spacing: float) -> tuple[int, int, bool]:
    """Shear and lag of most agreement, and whether no lag a mark or more away comes near."""
    lags = (np.arange(table.shape[1]) + 1) * BIN - FARTHEST
    best_at, turns = int(np.argmax(table.max(axis=0))), int(2 * FARTHEST / spacing) + 1
    peaks: list[tuple[int, int, int, int]] = []  # odd gaps, gaps, shear and lag of each
    for turn in range(-turns, turns + 1):
        near = np.flatnonzero(np.abs(lags - lags[best_at] - turn * spacing) < 0.3 * spacing)
        if near.size:
            which, place = divmod(int(np.argmax(table[:, near])), near.size)
            at = int(near[place])
            peaks.append((int(odd[which, max(at - 1, 0) : at + 2].max()), int(table[which, at]), which, at))
    by_odd, *others = sorted(peaks, key=lambda peak: -peak[0])
    # false gaps come with the swing, and so at the lags of its halves: of many the lead must be more than chance
    if not others or by_odd[0] - others[0][0] >= max(LEAD_ODD, CHANCE * math.sqrt(others[0][0])):
        return by_odd[2], by_odd[3], by_odd[0] >= LEAD_ODD
    most = max(peak[1] for peak in peaks)
    near_best = [peak for peak in peaks if most - peak[1] < max(LEAD, SHARE * most)]
    _, _, which, at = min(near_best, key=lambda peak: abs(lags[peak[3]]))
    return which, at, len(near_best) == 1


def gathered(gaps: Gaps, alignment: Alignment, traces: int, width: float) -> Events:
    """Gaps that lie together on different traces taken for one event."""
    rows = gaps.row - alignment.offset[gaps.trace] - alignment.shear * gaps.column
    groups: list[list[int]] = []
    for at in np.argsort(rows, kind="stable").tolist():
        last = groups[-1] if groups else []
        if last and rows[at] - rows[last[0]] < max(TOGETHER * width, 1.0) and gaps.trace[at] not in gaps.trace[last]:
            last.append(at)
        else:
            groups.append([at])
    member, event = np.full((traces, len(groups)), -1, dtype=np.int64), np.empty(gaps.size, dtype=np.int64)
    for k, group in enumerate(groups):
        member[gaps.trace[group], k], event[group] = group, k
    values: list[Floats] = []
    for each, sigma in ((rows, gaps.row_sigma), (gaps.width, gaps.width_sigma)):
        total = np.bincount(event, sigma**-2.0)
        values += [np.bincount(event, sigma**-2.0 * each) / total, np.power(total, -0.5)]
    order = np.argsort(values[0], kind="stable")
    row, row_sigma, wide, wide_sigma = (each[order] for each in values)
    return Events(row, row_sigma, wide, wide_sigma, member[:, order])


class Stand(NamedTuple):
    """A place where the paper stood, on one trace or, brought together, at column 0 of the first."""

    row: float
    length: float  # of time, by the bar's light, in rows of the film at its usual speed
    saturated: bool  # whether it may have been longer
    sure: bool = True  # whether the bar would be believed by itself


Bars = list[list[Stand] | None]


class Swept(NamedTuple):
    """What of a trace's columns the light writes in one stroke across."""

    aside: Floats  # px, of the columns from the middle of most swings
    centre: Floats  # px, middle of the swing about a row, (rows,)
    half: Floats  # of that swing, over that of most, (rows,)
    beside: Whole  # some that no trace sweeps, the same of all traces
    speed: Floats  # across the columns, over that in the middle
    stroke: float  # light along the rows of one stroke in the middle column, in rows of a line at rest
    peak: float  # light on the stroke's axis


def _ends(tracks: Tracks) -> list[Floats]:
    """Columns between which each trace swings nearly always, (2,)."""
    return [np.nanpercentile(each, (2.0, 98.0)) if np.isfinite(each).any() else np.zeros(2) for each in tracks.course]


def free_columns(tracks: Tracks, columns: int, margin: int = 0) -> Whole:
    """Of so many columns, those that no trace sweeps, but for a `margin` at either edge."""
    free = np.arange(margin, columns - margin)
    for low, high in _ends(tracks):
        free = free[(free < low - CLEAR * tracks.spot) | (free > high + CLEAR * tracks.spot)]
    return free


def swept(tracks: Tracks, columns: int) -> list[Swept | None]:
    """Columns across the swing of each trace, of so many; None where it is too small to show a bar."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d, uniform_filter1d

    found: list[Swept | None] = []
    ends, free = _ends(tracks), free_columns(tracks, columns, columns // 50)
    beside = free[:: max(free.size // 64, 1)]
    swing = max(round(tracks.rows_per_swing), 1)
    for trace, course in enumerate(tracks.course):
        row, known = np.arange(course.size), np.isfinite(course)
        seen = uniform_filter1d(known.astype(np.float64), 2 * swing) > FOLLOWED
        lowest = minimum_filter1d(np.where(known, course, np.inf), 2 * swing)[seen]
        highest = maximum_filter1d(np.where(known, course, -np.inf), 2 * swing)[seen]
        if not seen.any():
            found.append(None)
            continue
        centre = np.interp(row, row[seen], 0.5 * (lowest + highest))
        halves = np.maximum(np.interp(row, row[seen], 0.5 * (highest - lowest)), LEAST_COLUMNS)
        half = float(np.median(halves))
        if half <= LEAST_COLUMNS:
            found.append(None)
            continue
        aside = np.arange(-INNER * half, INNER * half, max(half / 32.0, 1.0))
        column = float(np.median(centre)) + aside
        alone = np.ones(column.size, dtype=bool)
        for a, b in ends[:trace] + ends[trace + 1 :]:
            alone &= (column < a) | (column > b)
        if alone.sum() >= ALONE * alone.size:  # where another trace does not add its light
            aside = aside[alone]
        slope = 2.0 * np.pi * half / tracks.rows_per_swing
        stroke, speed = float(np.sqrt(2.0 * np.pi)) * tracks.spot / slope, np.sqrt(1.0 - (aside / half) ** 2)
        peak = 1.0 / float(np.hypot(1.0, slope))
        found.append(Swept(aside, centre, halves / half, beside, speed, stroke, peak))
    return found


def light_across(exposure: NDArray[np.float32], begin: int, across: list[Swept | None]) -> Floats:
    """Light on each trace's columns, which sway with it, from row `begin`; its mean in strokes, (2, traces, rows)."""
    out = np.zeros((2, len(across), exposure.shape[0]))
    beside = next((own.beside for own in across if own is not None), np.empty(0, np.int64))
    stray = np.median(exposure[:, beside], axis=1) if beside.size else 0.0
    for trace, own in enumerate(across):
        if own is not None:
            rows = slice(begin, begin + exposure.shape[0])
            column = own.centre[rows, None] + own.half[rows, None] * own.aside
            places: Whole = np.clip(column, 0.0, exposure.shape[1] - 1.0).astype(np.int64)
            light = np.take_along_axis(exposure, places, axis=1)
            k = int(QUANTILE * own.aside.size)
            out[0, trace] = np.partition(light, k, axis=1)[:, k]
            strokes = (light @ own.speed - stray * own.speed.sum()) / (own.speed.size * own.stroke)
            out[1, trace] = own.half[rows] * strokes
    return out


def bars(light: Floats, across: list[Swept | None], tracks: Tracks, emulsion: Emulsion) -> Bars:
    """The bars on each trace, None where it is too small or faint to show one, from what `light_across` gives."""
    dim = BARE * float(emulsion.noise(np.zeros(1, dtype=np.float32))[0])
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


def together(found: Bars, late: Floats) -> list[Stand]:
    """Bars that all traces show that can, at one place of the paper; each trace lies `late` by so many rows."""
    able = [(k, shown) for k, shown in enumerate(found) if shown is not None]
    shown = sorted(bar._replace(row=bar.row - late[k]) for k, own in able for bar in own)
    edges = [0, *(1 + np.flatnonzero(np.diff([each.row for each in shown]) >= APART)), len(shown)]
    groups = [shown[first:stop] for first, stop in itertools.pairwise(edges) if stop - first >= max(len(able), 1)]
    return [
        Stand(float(np.mean(row)), float(np.mean(length)), any(saturated))
        for row, length, saturated, sure in (zip(*group, strict=True) for group in groups)
        if any(sure)
    ]
