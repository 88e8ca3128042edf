"""Traces read at the marks, the historic way: where each line breaks off and begins again.

The place is the middle of the gap on the curve, by its two ends; no row enters, nor the paper's motion. On steep
strokes it is good to a tenth of a pixel; in turning points it is that of the remainder around the gap.
"""

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import median_present
from pipeline.film.marks.alignment import CERTAIN, Gaps
from pipeline.film.marks.search import LATERAL, MOST_MISFIT, fitted, learned_width, over_pieces
from pipeline.film.normal_points import between_rows
from pipeline.film.parts import Emulsion, Floats, Strobe, TimeAxis, Tracks
from pipeline.film.scan.opening import OpenScan

GAP, AMBIGUOUS, LOST, OVERLAP = 1, 16, 32, 64  # of the record's flags
WIDTH_PRIOR = 0.06  # of the gap's width, 1 sigma
BEND = 0.07  # px, 1 sigma of the course's error across the line that is no shift: it matters where the line is flat
DENSE_LATERAL = 1.0  # px, 1 sigma of the course of a dense band across the line: a gap in a turning point shortens it
UNKNOWN_BEND = 3.0  # px, the same of a dense band that has too few steep strokes
STEEP, LEAST_STEEP = 10.0, 12  # slope of the strokes from which the error of a dense band is estimated; gaps on them
AT_TURNS = 1.0  # times the error of a dense band on steep strokes is that in its turning points
CROSSING = 6.0  # spots across the lines, within which another trace may hide a gap
FLOOR = 0.06  # px along the film, of courses that are a little wrong
Integers = NDArray[np.int64]


def read_at_marks(
    scan: OpenScan, emulsion: Emulsion, tracks: Tracks, axis: TimeAxis, closed: float | None = None, jobs: int = 1
) -> Strobe:
    """Place of every trace at every mark from the first to the last, also where the search had missed it.

    Places do not depend on the `axis`, which says where to look. `closed`, rows, is the gap's length where too few gaps
    tell it; `RefusedError`: nothing does.
    """
    if axis.kind != "gaps":
        nothing = np.empty((len(tracks.course), 0))
        return Strobe(axis.index[:0], nothing, nothing, nothing.astype(np.uint16))
    # all numbers from the first mark to the last, and their rows at column 0 of the first trace
    index = np.arange(axis.index[0], axis.index[-1] + 1)
    known = np.flatnonzero(np.isfinite(axis.seconds))
    row = np.interp(index * axis.interval, axis.seconds[known], known + 0.5)
    row[axis.index - index[0]] = axis.row
    usual = learned_width(scan, emulsion, tracks, closed)
    pace = np.gradient(row, index * axis.interval)
    pace /= np.median(pace)
    met = [_on_trace(tracks, k, row + late, axis.shear) for k, late in enumerate(axis.offset)]
    where, lean = np.array(met).transpose(1, 0, 2)
    width = usual * pace * (1.0 + axis.shear * np.nan_to_num(lean))
    lateral = LATERAL if read_by_rows(tracks) else DENSE_LATERAL

    def of_piece(begin: int, stop: int, first: int, exposure: NDArray[np.float32]) -> tuple[Integers, Integers, Floats]:
        trace, mark = np.nonzero((where >= begin) & (where < stop))
        near = where[trace, mark], width[trace, mark]
        return trace, mark, fitted(exposure, first, emulsion, tracks, trace, *near, WIDTH_PRIOR, lateral)

    trace, mark, fits = map(np.concatenate, zip(*over_pieces(scan, emulsion, of_piece, jobs), strict=True))
    gaps, (position, sigma) = Gaps.of(trace, fits), np.full((2, *where.shape), np.nan)
    qc = np.where(np.isfinite(where), GAP, LOST).astype(np.uint16)
    # a false gap beside a mark that was never made is no mark
    near = np.abs(gaps.row - where[trace, mark]) < CERTAIN * np.hypot(gaps.row_sigma, FLOOR) + FLOOR
    good = gaps.closed & (gaps.misfit < MOST_MISFIT) & near
    hidden = ~gaps.certain & _crossed(tracks, trace, where[trace, mark])
    qc[trace, mark] = np.select([good, hidden, gaps.closed], [0, OVERLAP, AMBIGUOUS], GAP)
    position[trace[good], mark[good]] = gaps.column[good]
    bend = bends(tracks, gaps.pick(good))[trace[good]] / np.sqrt(1.0 + gaps.slope[good] ** 2)
    sigma[trace[good], mark[good]] = np.hypot(gaps.column_sigma[good], bend)
    return Strobe(index=index, position=position, sigma=sigma, qc=qc)


def _on_trace(tracks: Tracks, trace: int, row: Floats, shear: float) -> tuple[Floats, Floats]:
    """Rows and slopes of a trace where it meets oblique lines through `row` at column 0."""
    course, slope = tracks.course[trace], tracks.slope[trace]
    centres = np.arange(course.size) + 0.5
    at = row + shear * float(np.nanmedian(course)) if np.isfinite(course).any() else row.copy()
    for _ in range(8):
        column = np.interp(at, centres, course)
        at = at + (row + shear * column - at) / (1.0 - shear * np.interp(at, centres, slope))
    inside = (at > 0.5) & (at < course.size - 0.5) & np.isfinite(at)
    return np.where(inside, at, np.nan), np.where(inside, np.interp(at, centres, slope), np.nan)


def read_by_rows(tracks: Tracks) -> bool:
    """Whether traces were read in rows, too, and not as dense bands."""
    return bool(np.isfinite(tracks.position).any())


def bends(tracks: Tracks, gaps: Gaps) -> Floats:
    """Error of each course that is no shift, px where it is flat, (traces,); of dense bands by gaps on strokes."""
    if read_by_rows(tracks):
        return np.full(len(tracks.course), BEND)
    out = np.full(len(tracks.course), UNKNOWN_BEND)
    for trace in range(len(out)):
        steep = gaps.pick((gaps.trace == trace) & (np.abs(gaps.slope) > STEEP))
        if steep.size < LEAST_STEEP:
            continue
        away = steep.column - between_rows(tracks, trace, steep.row)
        out[trace] = max(BEND, AT_TURNS * 1.4826 * median_present(np.abs(away)))
    return out


def _crossed(tracks: Tracks, trace: Integers, row: Floats) -> NDArray[np.bool_]:
    """Whether another trace's line passes near a place of a trace."""
    near, each = np.clip(np.nan_to_num(row).astype(np.int64), 0, tracks.course.shape[1] - 1), np.arange(trace.size)
    course, lean = tracks.course[:, near], np.abs(tracks.slope[:, near])
    steep = np.sqrt(1.0 + np.maximum(lean, lean[trace, each]) ** 2)
    beside = np.abs(course - course[trace, each]) < CROSSING * tracks.spot * steep
    beside[trace, each] = False
    return np.asarray(beside.any(axis=0))
