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
from pipeline.film.parts import Emulsion, Expected, Floats, Scan, Tracks
from pipeline.film.strobe.dense_blending import blended, joined
from pipeline.film.strobe.dense_kernels import CUBIC, SIZE, fit_block, nodes
from pipeline.film.strobe.dense_start import SHADE, first_shapes, light_of
from pipeline.film.strobe.dense_survey import Survey, survey
from pipeline.film.strobe.saturated import saturation

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


def dense_tracks(scan: Scan, emulsion: Emulsion, expected: Expected | None = None) -> Tracks:
    """Courses of all traces of a slow film whose bands lie side by side; no readings by rows.

    Raises
    ------
    RefusedError
        No swinging band was found, fewer than were expected, or most of one cannot be followed.
    """
    known = expected or Expected()
    spot = spot_of(scan, known)
    found = survey(scan, emulsion, known)
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


def spot_of(scan: Scan, known: Expected) -> float:
    """1 sigma of the spot, px: the stated one, or the usual one."""
    if known.spot is not None:
        return known.spot
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


def follow(scan: Scan, emulsion: Emulsion, found: Survey, spot: float, blocks: Blocks) -> None:
    """Fit every block, piece by piece of the film, and overwrite its shape and light."""
    period = found.period
    canvas = np.empty((int(2.0 * period + 12.0 * spot) + 8, scan.columns))
    brightest = saturation(emulsion)
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
            gain = line_light(light, spot)
            _fit(piece, first, blocks, trace, at, spot, gain, brightest, canvas)


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
    piece: NDArray[np.float32], first: int, blocks: Blocks, trace: int, at: NDArray[np.int64], spot: float,
    gain: float, brightest: float, canvas: Floats,
) -> None:  # fmt: skip
    """Fit blocks of one trace to a piece of film; those that do not swing as their neighbours do a second time."""
    shapes, light = blocks.shape[trace], blocks.light[trace]
    course, slope = np.empty((2, nodes(blocks.period, spot)))

    def fit(block: int) -> None:
        quality = np.empty(3)
        tried = shapes[block].copy()
        fit_block(
            piece, first, tried, blocks.middle[block], blocks.period, 2.0 * np.pi / blocks.period, spot, gain,
            brightest, ROOM, ROUNDS, canvas, course, slope, quality,
        )  # fmt: skip
        good = (
            quality[2] > LIT and quality[0] > DIM * gain and np.hypot(tried[CUBIC], tried[CUBIC + 3]) > SMALLEST * spot
        )
        shapes[block], light[block] = (tried, quality[0]) if good else (shapes[block], 0.0)

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
    traces = len(blocks.shape)
    course, slope, curvature, light = (np.full((traces, rows), np.nan) for _ in range(4))
    for k in range(traces):
        kept = joined(blocks.shape[k], blocks.light[k], blocks.period, spot)
        course[k], slope[k], curvature[k], light[k] = blended(blocks.middle, blocks.shape[k], kept, blocks.period, rows)
    return Tracks(
        position=np.full_like(course, np.nan),
        sigma=np.full_like(course, np.nan),
        course=course,
        slope=slope,
        curvature=curvature,
        brightness=light,
        qc=np.where(np.isfinite(course), GAP, LOST).astype(np.uint16),
        rows_per_swing=blocks.period,
        spot=spot,
    )
