"""Search for gaps along every trace of a film, in one pass over its pixels.

Where the line's brightness, taken along the curve, falls for as long as the shutter closes and comes back on both
sides, a gap is fitted to the pixels; the fit decides whether it is one: all of the light gone, for the right time, and
nothing else visible (dust, scratches and other traces' lines leave a misfit).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RefusedError
from pipeline.film.marks.gap_kernels import Known, brightness_along, fit_gaps
from pipeline.film.marks.pieces import MARGIN, Spans, exposed, grain, over_pieces
from pipeline.film.marks.stands import Bars, bars, light_across, swept
from pipeline.film.parts import Emulsion, Floats, Marking, Tracks
from pipeline.film.scan.opening import OpenScan

if TYPE_CHECKING:
    from pipeline.film.marks.lines import Lines

LATERAL = 0.1  # px, 1 sigma of the tracker's course across the line
WIDTH_PRIOR = 0.12  # of the width, 1 sigma: wow, drift and shear change it
DARK = 0.55  # share of a gap's expected darkness from which it is fitted
BACK = 0.35  # of the line's light, on both sides of a gap
VISIBLE = 0.3  # darkness expected in the middle of a gap, from which one is looked for
LEAST_LIGHT = 0.06  # of a line's nominal light, below which there is none
DEEPEST, LEAST_DEPTH, MOST_MISFIT = 1.5, 0.5, 2.5
CERTAIN = 4.0  # sigmas
DIM = 0.5  # of the line's light, at the ends of a gap
STEEP = 2.0  # slope from which the spot does not lengthen a gap along the rows
BLACK, BRIGHT = 0.25, 0.75  # of the line's light, within and beside a gap from which the width is learned
SHORTEST, LONGEST = 0.004, 0.15  # of a swing, how long the shutter may close
SAMPLES, SAMPLE_ROWS = 8, 640  # pieces in which the width is learned
LEAST_RUNS = 12
Exposure = NDArray[np.float32]


@dataclass(frozen=True)
class Gaps:
    """Gaps on single traces, in order of their rows; an array each, in px, with 1 sigma."""

    trace: NDArray[np.int64]
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
    def of(trace: NDArray[np.int64], fitted: Floats) -> Gaps:
        """From what `gap_kernels.fit_gaps` returns, (gaps, RESULTS)."""
        return Gaps(trace, *fitted.T.copy())

    def pick(self, which: NDArray[np.bool_] | NDArray[np.int64]) -> Gaps:
        """Some of them."""
        return Gaps(*(each[which] for each in vars(self).values()))

    def joined_by(self, more: Gaps) -> Gaps:
        """Both, in order of their rows."""
        both = Gaps(*(np.concatenate(each) for each in zip(vars(self).values(), vars(more).values(), strict=True)))
        return both.pick(np.argsort(both.row, kind="stable"))

    @property
    def size(self) -> int:
        """Number of gaps."""
        return self.row.size


class GapSearch(NamedTuple):
    """What marks the time on a film."""

    gaps: Gaps
    bars: Bars  # where the paper stood
    width: float  # of a gap, px
    across: Lines | None = None  # the marks beside the traces of which `gaps` were made


def search_gaps(scan: OpenScan, emulsion: Emulsion, tracks: Tracks, marking: Marking, jobs: int = 1) -> GapSearch:
    """Look for gaps on the traces of a film; raises as `learned_width`."""
    if marking.gap is not None and marking.speed is not None:
        width = marking.gap * marking.speed
    else:
        width = learned_width(scan, emulsion, tracks)
    return GapSearch(*find_gaps(scan, emulsion, tracks, width, jobs), width)


def find_gaps(
    scan: OpenScan, emulsion: Emulsion, tracks: Tracks, width: float, jobs: int = 1, spans: Spans | None = None
) -> tuple[Gaps, Bars]:
    """All gaps of about `width` rows on all traces, fitted and selected; and where each shows that the paper stood.

    `spans` as of `over_pieces`.
    """
    across, steps = swept(tracks, scan.columns), _steps(tracks)

    def of_piece(begin: int, stop: int, first: int, exposure: Exposure) -> tuple[NDArray[np.int64], Floats, Floats]:
        every = range(len(tracks.course))
        rows = [_candidates(exposure, first, begin, stop, tracks, trace, width, steps) for trace in every]
        traces = np.repeat(np.arange(len(rows)), [each.size for each in rows])
        gaps = fitted(exposure, first, emulsion, tracks, traces, np.concatenate(rows), width)
        return traces, gaps, light_across(exposure[begin - first : stop - first], across)

    traces, results, light = zip(*over_pieces(scan, emulsion, of_piece, jobs, spans), strict=True)
    gaps = _selected(Gaps.of(np.concatenate(traces), np.concatenate(results)), width)
    return gaps, bars(np.concatenate(light, axis=2), across, tracks, emulsion)


def fitted(
    exposure: Exposure, first: int, emulsion: Emulsion, tracks: Tracks, traces: NDArray[np.int64],
    guesses: Floats, width: float | Floats, prior: float = WIDTH_PRIOR, lateral: float = LATERAL,
) -> Floats:  # fmt: skip
    """Gaps fitted near some rows of some traces of a piece of film, (gaps, RESULTS)."""
    widths = np.broadcast_to(np.asarray(width, dtype=np.float64), guesses.shape).copy()
    known = Known(tracks.spot, tracks.shear, *grain(emulsion), lateral, prior, 0.5 * tracks.rows_per_swing)
    traces = np.ascontiguousarray(traces)  # else all is compiled a second time
    return fit_gaps(exposure, first, tracks.course, tracks.slope, traces, guesses, widths, known)


def _steps(tracks: Tracks) -> int:
    """Places a row at which brightness is taken: 1.3 spots apart on the steeper strokes."""
    lean = np.abs(tracks.slope[:, :: max(tracks.slope.shape[1] // 20000, 1)])
    steep = float(np.nanpercentile(lean, 90)) if np.isfinite(lean).any() else 1.0
    return int(np.clip(np.ceil(steep / (1.3 * tracks.spot)), 4, 40))


def _relative_light(
    exposure: Exposure, first: int, begin: int, stop: int, tracks: Tracks, trace: int, width: float, steps: int
) -> tuple[Floats, Floats, Floats]:
    """Brightness along a trace over that of its surroundings, how dark the middle of a gap would be, and the rows."""
    rows = begin + (np.arange((stop - begin) * steps) + 0.5) / steps
    light, dark = np.empty((2, rows.size))
    brightness_along(
        exposure, first, tracks.course[trace], tracks.slope[trace], tracks.curvature[trace],
        begin, steps, tracks.spot, tracks.shear, width, light, dark,
    )  # fmt: skip
    edges = np.linspace(0, rows.size, max(rows.size // max(int(0.5 * tracks.rows_per_swing * steps), 8), 1) + 1)
    parts = [np.sort(light[low:high]) for low, high in itertools.pairwise(edges.astype(int))]  # NaN behind the rest
    known = np.array([np.count_nonzero(np.isfinite(each)) for each in parts])
    shown = known > 0.3 * np.diff(edges)
    level = [each[count // 2] for each, count, told in zip(parts, known, shown, strict=True) if told]
    middle = 0.5 * (edges.astype(int)[:-1] + edges.astype(int)[1:])[shown]
    usual = np.interp(np.arange(rows.size), middle, level) if level else np.zeros(rows.size)
    return np.where(usual > LEAST_LIGHT, light / np.maximum(usual, LEAST_LIGHT), np.nan), dark, rows


def _candidates(
    exposure: Exposure, first: int, begin: int, stop: int, tracks: Tracks, trace: int, width: float, steps: int
) -> Floats:
    """Rows in `begin` to `stop` at which a gap may lie on a trace."""
    from scipy.ndimage import maximum_filter1d, uniform_filter1d

    low, high = max(begin - MARGIN // 2, 0), min(stop + MARGIN // 2, first + exposure.shape[0])
    light, dark, rows = _relative_light(exposure, first, low, high, tracks, trace, width, steps)
    known = np.isfinite(light)
    light = np.where(known, np.minimum(light, 1.5), 0.0)
    span = max(round(width * rows.size / (high - low)), 1)
    score = np.where(dark > VISIBLE, uniform_filter1d(1.0 - light, span) / np.maximum(dark, VISIBLE), 0.0)
    half, away = max(round(0.5 * span), 1), round(0.85 * span)
    beside = uniform_filter1d(light, half)
    top = (score == maximum_filter1d(score, 2 * half + 1)) & (score > DARK) & known
    top &= (np.roll(beside, away) > BACK) & (np.roll(beside, -away) > BACK)
    top[:away], top[-away:] = False, False
    return np.asarray(rows[top & (rows >= begin) & (rows < stop)])


def _selected(gaps: Gaps, width: float) -> Gaps:
    """Those that are gaps, each once, by rows."""
    good = np.isfinite(gaps.row) & (gaps.depth_sigma < 0.25)
    good &= (gaps.depth > LEAST_DEPTH) & (gaps.depth < DEEPEST)
    good &= np.abs(gaps.depth - 1.0) < CERTAIN * gaps.depth_sigma + 0.1
    good &= (gaps.misfit < MOST_MISFIT) & (np.abs(gaps.width - width) < 0.35 * width)
    good &= (gaps.row_sigma < 0.5 * width) & (gaps.light > 0.1)
    gaps = gaps.pick(good)
    gaps = gaps.pick(np.lexsort((gaps.row, gaps.trace)))
    pairs = np.flatnonzero((np.diff(gaps.row) < 0.8 * width) & (np.diff(gaps.trace) == 0))
    worse = np.where(gaps.row_sigma[pairs] > gaps.row_sigma[pairs + 1], pairs, pairs + 1)
    gaps = gaps.pick(np.setdiff1d(np.arange(gaps.size), worse))
    return gaps.pick(np.argsort(gaps.row, kind="stable"))


def learned_width(scan: OpenScan, emulsion: Emulsion, tracks: Tracks) -> float:
    """Rows for which the shutter closes, by the dark runs on steep strokes of some pieces of the film.

    `RefusedError`: too few of them.
    """
    length, steps = min(scan.rows, SAMPLE_ROWS), _steps(tracks)
    runs: list[float] = []
    for begin in np.unique(np.linspace(0, scan.rows - length, SAMPLES).astype(int)).tolist():
        exposure = exposed(scan, emulsion, begin, begin + length)
        for trace in range(len(tracks.course)):
            light, _, rows = _relative_light(exposure, begin, begin, begin + length, tracks, trace, 1.0, steps)
            lean = np.abs(tracks.slope[trace][np.minimum(rows.astype(int), scan.rows - 1)])
            runs.extend(_dark_runs(light, lean) * length / rows.size)
    inside = np.array([run for run in runs if SHORTEST < run / tracks.rows_per_swing < LONGEST])
    if inside.size < LEAST_RUNS:
        raise RefusedError(
            f"film: {inside.size} gaps in the traces, too few to tell how long the shutter closed; "
            "state the gap and the rows per second, or check that the film bears time marks"
        )
    return float(np.median(commonest(inside, 1.25)))


def commonest(values: Floats, ratio: float) -> Floats:
    """The most values that lie within a ratio of each other, in order."""
    values = np.sort(values)
    within = np.searchsorted(values, values * ratio) - np.arange(values.size)
    start = int(np.argmax(within))
    return values[start : start + within[start]]


def _dark_runs(light: Floats, lean: Floats) -> Floats:
    """Lengths, in samples, of whole runs of darkness on steep strokes; ends interpolated."""
    dark = light < DIM
    edge = np.flatnonzero(dark[1:] != dark[:-1])
    cross = edge + (DIM - light[edge]) / (light[edge + 1] - light[edge])
    lengths = []
    for which in np.flatnonzero(dark[edge + 1])[:-1]:
        low, high = edge[which] + 1, edge[which + 1] + 1
        beside = np.concatenate([light[max(low - (high - low), 0) : low], light[high : 2 * high - low]])
        if lean[low:high].min() > STEEP and light[low:high].mean() < BLACK and beside.mean() > BRIGHT:
            lengths.append(cross[which + 1] - cross[which])
    return np.array(lengths)
