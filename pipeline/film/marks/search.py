"""Search for gaps along every trace of a film, in one pass over its pixels, piece by piece: none holds the image.

Where the line's brightness falls for as long as the shutter closes and comes back on both sides, a gap is fitted to the
pixels; it is one if all of the light is gone, for the right time, and nothing else leaves a misfit (dust, other lines).
"""

import itertools
import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RefusedError
from pipeline.film.marks.alignment import Bars, Gaps, bars, light_across, swept
from pipeline.film.marks.gap_kernels import REACH, Known, fit_gaps, look, pace, place
from pipeline.film.marks.lines import Lines
from pipeline.film.parts import Emulsion, Floats, Marking, Tracks
from pipeline.film.scan.opening import OpenScan
from synth.kernels.compiled import kernel, making_kernel

ROWS = 1024  # of a piece
MARGIN = 24  # rows read on either side, so that a gap at a seam is seen whole
LIGHTEST, GRAIN_STEPS = 2.5, 320  # exposure up to which the grain is tabulated
STRAIGHT = 4.0  # length of line a row, from which its bend within a spot is negligible
LATERAL = 0.1  # px, 1 sigma of the tracker's course across the line
WIDTH_PRIOR = 0.12  # of the width, 1 sigma: wow, drift and shear change it
DARK = 0.55  # share of a gap's expected darkness from which it is fitted
BACK = 0.35  # of the line's light, on both sides of a gap
VISIBLE = 0.3  # darkness expected in the middle of a gap, from which one is looked for
LEAST_LIGHT = 0.06  # of a line's nominal light, below which there is none
MOST_MISFIT = 2.5
DIM = 0.5  # of the line's light, at the ends of a gap
STEEP, HALF = 2.0, 0.5  # slope from which the spot does not lengthen a gap along the rows; of the steepest, at most
BLACK, BRIGHT = 0.25, 0.75  # of the line's light, within and beside a gap from which the width is learned
SHORTEST, LONGEST = 0.004, 0.15  # of a swing, how long the shutter may close
SAMPLES, SAMPLE_ROWS = 8, 640  # pieces in which the width is learned
LEAST_RUNS = 12
Item = TypeVar("Item")
Result = TypeVar("Result")
Exposure = NDArray[np.float32]
Spans = Sequence[tuple[int, int]]  # First and last rows of stretches of film


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
    """All gaps of about `width` rows on all traces, and bars where the paper stood; `spans` as of `over_pieces`."""
    across, steps = swept(tracks, scan.columns), _steps(tracks)

    def of_piece(begin: int, stop: int, first: int, exposure: Exposure) -> tuple[NDArray[np.int64], Floats, Floats]:
        every = range(len(tracks.course))
        rows = [_candidates(exposure, first, begin, stop, tracks, trace, width, steps) for trace in every]
        traces = np.repeat(np.arange(len(rows)), [each.size for each in rows])
        gaps = fitted(exposure, first, emulsion, tracks, traces, np.concatenate(rows), width)
        return traces, gaps, light_across(exposure[begin - first : stop - first], begin, across)

    traces, results, light = zip(*over_pieces(scan, emulsion, of_piece, jobs, spans), strict=True)
    gaps = _selected(Gaps.of(np.concatenate(traces), np.concatenate(results)), width)
    return gaps, bars(np.concatenate(light, axis=2), across, tracks, emulsion)


def fitted(
    exposure: Exposure, first: int, emulsion: Emulsion, tracks: Tracks, traces: NDArray[np.int64],
    guesses: Floats, width: float | Floats, prior: float = WIDTH_PRIOR, lateral: float = LATERAL,
) -> Floats:  # fmt: skip
    """Gaps fitted near some rows of some traces of a piece of film, (gaps, RESULTS)."""
    widths = np.full(guesses.shape, width)
    known = Known(tracks.spot, tracks.shear, *grain(emulsion), lateral, prior, 0.5 * tracks.rows_per_swing)
    traces = np.ascontiguousarray(traces)  # else all is compiled a second time
    return fit_gaps(exposure, first, tracks.course, tracks.slope, traces, guesses, widths, known)


def _steps(tracks: Tracks) -> int:
    """Places a row at which brightness is taken: 1.3 spots apart on the steeper strokes."""
    return int(np.clip(np.ceil(_steepest(tracks) / (1.3 * tracks.spot)), 4, 40))


def _steepest(tracks: Tracks) -> float:
    """Slope of the steeper strokes."""
    lean = np.abs(tracks.slope[:, :: max(tracks.slope.shape[1] // 20000, 1)])
    return float(np.nanpercentile(lean, 90)) if np.isfinite(lean).any() else 1.0


@kernel
def light_at_rest(slope: float, curvature: float, spot: float, half: float) -> float:
    """Exposure on the axis of a curved line drawn from `half` rows before the point to `half` after it."""
    steep = math.sqrt(1.0 + slope * slope)
    if steep > STRAIGHT:
        return math.erf(half * steep / (1.4142135623730951 * spot)) / steep
    reach = min(half, REACH * spot / steep)
    total, count = 0.0, 9
    step = 2.0 * reach / count
    for i in range(count):
        x = (i + 0.5) * step - reach
        c = x * (slope + 0.5 * curvature * x)
        total += math.exp(-0.5 * (x * x + c * c) / (spot * spot))
    return total * step / (2.5066282746310002 * spot)


@making_kernel
def brightness_along(
    exposure: Exposure, first: int, course: Floats, slope: Floats, curvature: Floats, rows: Floats,
    spot: float, shear: float, width: float,
) -> tuple[Floats, Floats]:  # fmt: skip
    """Exposure on the line over that expected, NaN where film or trace ends, and what a gap of `width` would take."""
    light, dark = np.full(rows.size, math.nan), np.zeros(rows.size)
    for k, row in enumerate(rows):
        column, lean = place(course, slope, row)
        if math.isnan(column):
            continue
        steep = math.sqrt(1.0 + lean * lean)
        dr, dc = -lean * 0.6 * spot / steep, 0.6 * spot / steep  # across the line
        value = look(exposure, first, row, column)
        value += look(exposure, first, row + dr, column + dc) + look(exposure, first, row - dr, column - dc)
        bend = curvature[min(int(row), course.size - 1)]
        whole = light_at_rest(lean, bend, spot, 1e3)
        light[k] = value / (2.67 * whole * pace(shear, lean))  # 1 + 2 exp(-0.18)
        dark[k] = light_at_rest(lean, bend, spot, 0.5 * width) / whole
    return light, dark


def _relative_light(
    exposure: Exposure, first: int, begin: int, stop: int, tracks: Tracks, trace: int, width: float, steps: int
) -> tuple[Floats, Floats, Floats]:
    """Brightness along a trace over that of its surroundings, how dark the middle of a gap would be, and the rows."""
    rows = begin + (np.arange((stop - begin) * steps) + 0.5) / steps
    line = tracks.course[trace], tracks.slope[trace], tracks.curvature[trace]
    light, dark = brightness_along(exposure, first, *line, rows, tracks.spot, tracks.shear, width)
    parts = max(rows.size // max(int(0.5 * tracks.rows_per_swing * steps), 8), 1)
    middle, level = [], []
    for low, high in itertools.pairwise(np.linspace(0, rows.size, parts + 1).astype(int).tolist()):
        known = np.sort(light[low:high])  # NaN behind the rest
        count = np.count_nonzero(np.isfinite(known))
        if count > 0.3 * (high - low):
            middle.append(0.5 * (low + high))
            level.append(known[count // 2])
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
    good = gaps.closed & (gaps.misfit < MOST_MISFIT) & (np.abs(gaps.width - width) < 0.35 * width)
    gaps = gaps.pick(good & (gaps.row_sigma < 0.5 * width) & (gaps.light > 0.1))
    gaps = gaps.pick(np.lexsort((gaps.row, gaps.trace)))
    pairs = np.flatnonzero((np.diff(gaps.row) < 0.8 * width) & (np.diff(gaps.trace) == 0))
    worse = np.where(gaps.row_sigma[pairs] > gaps.row_sigma[pairs + 1], pairs, pairs + 1)
    gaps = gaps.pick(np.setdiff1d(np.arange(gaps.size), worse))
    return gaps.pick(np.argsort(gaps.row, kind="stable"))


def learned_width(scan: OpenScan, emulsion: Emulsion, tracks: Tracks, known: float | None = None) -> float:
    """Rows for which the shutter closes, by dark runs on steep strokes; with too few `known`, or `RefusedError`."""
    length, steps, steep = min(scan.rows, SAMPLE_ROWS), _steps(tracks), min(STEEP, HALF * _steepest(tracks))
    runs: list[float] = []
    for begin in spread_over(scan.rows - length, SAMPLES):
        exposure = exposed(scan, emulsion, begin, begin + length)
        for trace in range(len(tracks.course)):
            light, _, rows = _relative_light(exposure, begin, begin, begin + length, tracks, trace, 1.0, steps)
            lean = np.abs(tracks.slope[trace][np.minimum(rows.astype(int), scan.rows - 1)])
            runs.extend(_dark_runs(light, lean, steep) * length / rows.size)
    inside = np.array([run for run in runs if SHORTEST < run / tracks.rows_per_swing < LONGEST])
    if inside.size < LEAST_RUNS:
        if known is not None:
            return known
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


def _dark_runs(light: Floats, lean: Floats, steep: float) -> Floats:
    """Lengths, in samples, of whole runs of darkness where a stroke leans as much as `steep`; ends interpolated."""
    dark = light < DIM
    edge = np.flatnonzero(dark[1:] != dark[:-1])
    cross = edge + (DIM - light[edge]) / (light[edge + 1] - light[edge])
    lengths = []
    for which in np.flatnonzero(dark[edge + 1])[:-1]:
        low, high = edge[which] + 1, edge[which + 1] + 1
        beside = np.concatenate([light[max(low - (high - low), 0) : low], light[high : 2 * high - low]])
        if lean[low:high].min() > steep and light[low:high].mean() < BLACK and beside.mean() > BRIGHT:
            lengths.append(cross[which + 1] - cross[which])
    return np.array(lengths)


def in_order(work: Callable[[Item], Result], items: Iterable[Item], jobs: int = 1) -> Iterator[Result]:
    """Results of `work` in the items' order; items are asked for in the caller's thread, at most `jobs` ahead."""
    if jobs == 1:
        yield from map(work, items)
        return
    from concurrent.futures import ThreadPoolExecutor

    waiting = iter(items)
    with ThreadPoolExecutor(jobs) as pool:
        coming = deque(pool.submit(work, item) for item in itertools.islice(waiting, jobs + 1))
        try:
            while coming:
                yield coming.popleft().result()
                coming.extend(pool.submit(work, item) for item in itertools.islice(waiting, 1))
        finally:
            pool.shutdown(cancel_futures=True)


def over_pieces(
    scan: OpenScan, emulsion: Emulsion, work: Callable[[int, int, int, Exposure], Result], jobs: int,
    spans: Spans | None = None,
) -> list[Result]:  # fmt: skip
    """What `work` makes of each piece of `spans`: rows `begin` to `stop`, first row of the exposure, exposure."""

    def one(begin_and_stop: tuple[int, int]) -> Result:
        begin, stop = begin_and_stop
        first = max(begin - MARGIN, 0)
        return work(begin, stop, first, exposed(scan, emulsion, first, min(stop + MARGIN, scan.rows)))

    spans = [(0, scan.rows - 1)] if spans is None else spans
    pieces = [(at, min(at + ROWS, last + 1)) for first, last in spans for at in range(first, last + 1, ROWS)]
    return list(in_order(one, pieces, jobs))


def spread_over(rows: int, number: int, *, inside: bool = False) -> list[int]:
    """A number of rows spread evenly, each once, from 0 on or `inside` alone: there pieces begin that show a film."""
    first = np.linspace(0, rows, number + 2 * inside).astype(int)
    return [int(each) for each in np.unique(first[1:-1] if inside else first)]


def exposed(scan: OpenScan, emulsion: Emulsion, first: int, stop: int) -> Exposure:
    """Exposure of some rows, (rows, columns), contiguous."""
    pixels: NDArray[Any] = scan.read(first, stop)
    return np.ascontiguousarray(emulsion.exposure(pixels, first), dtype=np.float32)


def grain(emulsion: Emulsion) -> tuple[Floats, float]:
    """1 sigma of the exposure of a pixel at evenly spaced exposures from 0 on, and their spacing."""
    light = np.linspace(0.0, LIGHTEST, GRAIN_STEPS + 1, dtype=np.float32)
    return np.asarray(emulsion.noise(light), dtype=np.float64), LIGHTEST / GRAIN_STEPS
