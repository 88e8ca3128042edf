"""Courses of the traces of a slow film, whose swings lie so close that rows do not show lines one by one.

Such films are read at the marks alone; this is where the gaps are looked for. The film is cut into blocks of two
swings, each half over the next. The mean place of each row's light gives a block's first curve, without regard to the
other blocks; the curve is then fitted to the film, and neighbouring blocks are blended. Blocks that do not lie on a
line, or not where their neighbours lead, are left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RefusedError
from pipeline.film.marks.pieces import exposed
from pipeline.film.parts import Emulsion, Floats, Tracks
from pipeline.film.scan.opening import OpenScan
from pipeline.film.strobe.dense_kernels import CUBIC, SIZE, Known, fit_block, node_table, values
from pipeline.film.strobe.dense_survey import SHADE, Survey, first_shapes, light_of, saturation, survey

APART = 1.0  # spots across the line, by which two blocks may differ in the middle between them
BETWEEN = 9  # places at which they are compared
GAP, LOST = 1, 32  # of the record's flags
PIECE = 1024  # rows read at once
BESIDE = 0.5  # of a band's width on either side, in which its light is looked for
ROOM = np.array([15.0, 15.0, 10.0, 5.0, 12.0, 8.0, 3.0, 12.0, 8.0, 3.0])  # px, of a shape about its first guess
ROUNDS = 3
LIT, DIM = 0.5, 0.06  # share of points lit, and light over the rows', from which a block is believed
SMALLEST = 6.0  # spots, of the swing's amplitude
ALIKE = 0.15  # of the swing, by which it may change from block to block
RETRIES = 3  # from the neighbours' swing
AROUND = 10  # blocks on either side that tell the usual swing
LEAST_READ = 0.5  # of the blocks
USUAL_SPOT = 1.2  # px: 0.1 mm at 300 dpi


def joined(shape: Floats, light: Floats, period: float, spot: float) -> Floats:
    """Light of the blocks, 0 also for those that lie beside both their neighbours, or beside one and have no other."""
    away = np.linspace(0.25, 0.75, BETWEEN) * period
    good = light > 0.0
    before, after = values(shape[:-1, None], away, period), values(shape[1:, None], away - period, period)
    across = np.median(np.abs(before[0] - after[0]) / np.sqrt(1.0 + before[1] ** 2), axis=1)
    agree = np.concatenate([[False], good[:-1] & good[1:] & (across < APART * spot), [False]])
    return np.where(good & (agree[:-1] | agree[1:]), light, 0.0)


def blended(middle: Floats, shape: Floats, light: Floats, period: float, rows: int) -> Floats:
    """Course, slope, curvature and light by rows, (4, rows); NaN where no block is good."""
    at = np.arange(rows) + 0.5
    before = np.floor((at - middle[0]) / period).astype(np.int64)  # the block whose middle is the last one passed
    first, second = np.clip(before, 0, middle.size - 1), np.clip(before + 1, 0, middle.size - 1)
    x = (at - middle[0]) / period - before
    known, next_known = (light[first] > 0.0) & (before >= 0), (light[second] > 0.0) & (before + 1 < middle.size)
    # alone, a block counts in full
    both = known & next_known
    weight = np.where(both, x * x * (3.0 - 2.0 * x), np.where(known, 0.0, 1.0))
    lean = np.where(both, 6.0 * x * (1.0 - x) / period, 0.0)
    bend = np.where(both, (6.0 - 12.0 * x) / period**2, 0.0)
    here, there = values(shape[first], at - middle[first], period), values(shape[second], at - middle[second], period)
    apart = there - here
    out = np.stack(
        [
            here[0] + weight * apart[0],
            here[1] + weight * apart[1] + lean * apart[0],
            here[2] + weight * apart[2] + 2.0 * lean * apart[1] + bend * apart[0],
            light[first] + weight * (light[second] - light[first]),
        ]
    )
    near = (known & (x <= 1.0)) | (next_known & (np.abs(at - middle[second]) <= period))
    out[:, ~near] = np.nan
    return out


def dense_tracks(scan: OpenScan, emulsion: Emulsion, count: int | None) -> Tracks:
    """Courses of all traces, `count` if known, of a slow film whose bands lie side by side; no readings by rows.

    Raises
    ------
    RefusedError
        No swinging band was found, fewer than were expected, or most of one cannot be followed.
    """
    spot = spot_of(scan)
    found = survey(scan, emulsion, count)
    blocks = Blocks.empty(len(found.bands), scan.rows, found.period)
    follow(scan, emulsion, found, spot, blocks)
    good = blocks.light > 0.0
    for trace, share in enumerate(good.mean(axis=1)):
        if share < LEAST_READ:
            band = found.bands[trace]
            raise RefusedError(
                f"film: the swings in columns {band.left} to {band.right} can be followed over {100.0 * share:.0f} % "
                f"of the film, {100.0 * LEAST_READ:.0f} % are needed; give the traces' number, or cut the film"
            )
    return _tracks(blocks, scan.rows, spot)


def spot_of(scan: OpenScan) -> float:
    """1 sigma of the usual spot, px."""
    return USUAL_SPOT if scan.scale is None else 0.1 / scan.scale


@dataclass(frozen=True)
class Blocks:
    """Curves of all traces, block by block.

    Attributes
    ----------
    middle : (blocks,) array
        Row of each block's middle; blocks reach `period` rows to either side.
    shape : (traces, blocks, SIZE) array
    light : (traces, blocks) array
        Of the line, 0 where the block is not believed.
    period : float
        Rows in a swing.
    """

    middle: Floats
    shape: Floats
    light: Floats
    period: float

    @staticmethod
    def empty(traces: int, rows: int, period: float) -> Blocks:
        """Blocks over a film of which nothing is known yet."""
        middle: Floats = np.asarray((np.arange(int(rows / period - 0.4)) + 0.7) * period, dtype=np.float64)
        return Blocks(middle, np.zeros((traces, middle.size, SIZE)), np.zeros((traces, middle.size)), period)


def windows(found: Survey, columns: int) -> list[tuple[int, int]]:
    """Columns in which the light of each band is looked for: half way to the next band at most."""
    out = []
    for k, band in enumerate(found.bands):
        room = int(BESIDE * (band.right - band.left))
        left = 0 if k == 0 else (found.bands[k - 1].right + band.left) // 2
        right = columns if k + 1 == len(found.bands) else (band.right + found.bands[k + 1].left) // 2
        out.append((max(left, band.left - room), min(right, band.right + room)))
    return out


def follow(scan: OpenScan, emulsion: Emulsion, found: Survey, spot: float, blocks: Blocks) -> None:
    """Fit every block, piece by piece of the film, and overwrite its shape and light."""
    period = found.period
    canvas = np.empty((int(2.0 * period + 12.0 * spot) + 8, scan.columns))
    brightest, table = saturation(emulsion), node_table(period, spot)
    least = SHADE * float(emulsion.noise(np.zeros(1, dtype=np.float32))[0])
    margin = int(period + 8.0 * spot) + 2
    for begin in range(0, scan.rows, PIECE):
        here = np.flatnonzero((blocks.middle >= begin) & (blocks.middle < begin + PIECE))
        if here.size == 0:
            continue
        first = max(begin - margin, 0)
        piece = exposed(scan, emulsion, first, min(begin + PIECE + margin, scan.rows))
        for trace, (left, right) in enumerate(windows(found, scan.columns)):
            light, column = light_of(piece, left, right, least)
            shapes, residual = first_shapes(light, column, first, blocks.middle[here], period, spot)
            at = here[np.isfinite(residual)]
            if at.size == 0:
                continue
            blocks.shape[trace, at] = shapes[np.isfinite(residual)]
            known = Known(period, spot, line_light(light, spot), brightest, ROOM, table, canvas)
            _fit(piece, first, blocks, trace, at, known)


def line_light(light: Floats, spot: float) -> float:
    """Exposure on the axis of a line at rest that leaves such light in each row.

    Examples
    --------
    >>> round(line_light(np.array([3.0, 3.0, 0.0, 3.1]), 1.2), 3)
    0.997
    """
    lit = light[light > 0.0]
    return float(np.median(lit) / (np.sqrt(2.0 * np.pi) * spot)) if lit.size else 1.0


def _fit(
    piece: NDArray[np.float32], first: int, blocks: Blocks, trace: int, at: NDArray[np.int64], known: Known
) -> None:
    """Fit blocks of one trace to a piece of film; those that do not swing as their neighbours do a second time."""
    shapes, light = blocks.shape[trace], blocks.light[trace]

    def fit(block: int) -> None:
        tried = shapes[block].copy()
        lit, share = fit_block(piece, first, tried, blocks.middle[block], known, ROUNDS)
        good = share > LIT and lit > DIM * known.gain
        if good and np.hypot(tried[CUBIC], tried[CUBIC + 3]) > SMALLEST * known.spot:
            shapes[block], light[block] = tried, lit
        else:
            light[block] = 0.0

    start = shapes[at].copy()
    for block in at:
        fit(int(block))
    for turn in range(RETRIES + 1):
        usual = usual_swing(shapes[at], light[at] > 0.0)
        odd = unlike(shapes[at], usual) | (light[at] <= 0.0)
        again = np.flatnonzero(odd & np.isfinite(usual[:, 0]))
        if again.size == 0:
            break
        for k in again:
            light[at[k]] = 0.0
            if turn < RETRIES:
                shapes[at[k]] = start[k]
                shapes[at[k], [CUBIC, CUBIC + 3]] = usual[k]
                shapes[at[k], [CUBIC + 1, CUBIC + 2, CUBIC + 4, CUBIC + 5]] = 0.0
                fit(int(at[k]))


def usual_swing(shapes: Floats, good: NDArray[np.bool_]) -> Floats:
    """The swing of the good blocks around each, the middle one of them, (blocks, 2): cosine and sine, px."""
    pair = np.where(good[:, None], shapes[:, [CUBIC, CUBIC + 3]], np.nan)
    padded = np.pad(pair, ((AROUND, AROUND), (0, 0)), constant_values=np.nan)
    around = np.stack([padded[k : k + len(pair)] for k in range(2 * AROUND + 1)])
    some = np.isfinite(around[:, :, 0]).sum(axis=0) >= 3
    out = np.full_like(pair, np.nan)
    out[some] = np.nanmedian(around[:, some], axis=0)
    return out


def unlike(shapes: Floats, usual: Floats) -> NDArray[np.bool_]:
    """Which blocks swing otherwise than their neighbours."""
    apart = np.hypot(*(shapes[:, [CUBIC, CUBIC + 3]] - usual).T)
    return np.asarray(apart > ALIKE * np.hypot(*usual.T))


def _tracks(blocks: Blocks, rows: int, spot: float) -> Tracks:
    tracks = Tracks.empty(len(blocks.shape), rows, blocks.period, spot)
    for k, shape in enumerate(blocks.shape):
        kept = joined(shape, blocks.light[k], blocks.period, spot)
        tracks.course[k], tracks.slope[k], tracks.curvature[k], tracks.brightness[k] = blended(
            blocks.middle, shape, kept, blocks.period, rows
        )
    tracks.qc[:] = np.where(np.isfinite(tracks.course), GAP, LOST)
    return tracks
