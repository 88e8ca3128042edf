"""Courses of the traces of a slow film, whose swings lie so close that no row shows a line by itself.

Such films are read at the marks alone; this is where the gaps are looked for. A block of two swings is fitted in the
film's middle and carried on, swing by swing, to both ends; neighbouring blocks are blended.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RefusedError
from pipeline.film.marks.pieces import exposed
from pipeline.film.parts import Emulsion, Expected, Floats, Scan, Tracks
from pipeline.film.strobe.dense_kernels import SIZE, fit_block
from pipeline.film.strobe.dense_start import Band, bands, first_shape, rows_per_swing

GAP, LOST = 1, 32  # of the record's flags
SECTION = 24  # swings in which bands and period are looked for
CLOSE = 10.0  # spots between strokes
PIECE = 1024  # rows read at once
MARGIN = 3.0  # swings read on either side of a piece
STARTS = 9  # places tried for the first block
ROOM = np.array([6.0, 8.0, 6.0, 4.0, 12.0, 8.0, 3.0, 12.0, 8.0, 3.0])  # px, from block to block
ROUNDS = 3
LIT, DIM = 0.5, 0.06  # share of points lit, and light, from which a block is believed
PATIENCE = 2  # blocks carried on blindly before the trace is looked for anew
USUAL_SPOT = 1.2  # px: 0.1 mm at 300 dpi


def is_dense(rows_per_swing: float, spot: float) -> bool:
    """Whether strokes lie so close that rows do not show lines one by one, and only marks are to be read.

    Examples
    --------
    >>> is_dense(17.9, 1.2), is_dense(59.6, 1.2)  # 1.5 and 5 mm/s at 300 dpi, swings of a second
    (True, False)
    """
    return 0.5 * rows_per_swing < CLOSE * spot


def dense_tracks(scan: Scan, emulsion: Emulsion, expected: Expected | None = None) -> Tracks:
    """Courses of all traces of a slow film whose bands lie side by side; no readings by rows.

    Raises
    ------
    RefusedError
        No swinging band was found, or fewer than were expected.
    """
    known = expected or Expected()
    spot = known.spot if known.spot is not None else USUAL_SPOT if scan.scale is None else 0.1 / scan.scale
    found, period = _survey(scan, emulsion, known)
    courses = [_Course(scan, emulsion, band, period, spot) for band in found]
    return _tracks(courses, scan.rows, period, spot)


def _survey(scan: Scan, emulsion: Emulsion, known: Expected) -> tuple[list[Band], float]:
    """Bands and rows per swing, by the section that swings most clearly of several."""
    length = min(scan.rows, int(SECTION * (known.rows_per_swing or 25.0)))
    found: list[Band] = []
    periods = []
    for begin in np.unique(np.linspace(0, scan.rows - length, 7).astype(int)[1:-1]):
        piece = exposed(scan, emulsion, int(begin), int(begin) + length)
        here = bands(piece, known.count)
        if here:
            periods.append(rows_per_swing(piece, here))
            found = here if not found or len(here) > len(found) else found
    if not found or len(found) < (known.count or 1):
        raise RefusedError(
            f"film: {len(found)} swinging bands found, {known.count or 1} expected; bands that lie over each other "
            "cannot be told apart: give the traces' number, or scan them one by one"
        )
    return found, known.rows_per_swing or float(np.median(periods))


class _Course:
    """Blocks of one trace, followed from the film's middle to both ends."""

    def __init__(self, scan: Scan, emulsion: Emulsion, band: Band, period: float, spot: float) -> None:
        self.scan, self.emulsion, self.band, self.period, self.spot = scan, emulsion, band, period, spot
        self.canvas = np.empty((int(2.0 * period + 12.0 * spot) + 8, scan.columns))
        self.piece: NDArray[np.float32] = np.empty((0, 0), dtype=np.float32)
        self.first = self.stop = 0
        self.middle, shape = self._begin()
        self.shapes: dict[int, Floats] = {0: shape}
        self.light: dict[int, float] = {0: 1.0}
        for way in (1, -1):
            self._follow(way, shape)

    def _load(self, middle: float, way: int) -> None:
        """Have the film around a row in hand, and what lies ahead of it."""
        margin = int(MARGIN * self.period)
        low, high = max(int(middle) - margin, 0), min(int(middle) + margin, self.scan.rows)
        if low >= self.first and high <= self.stop and self.piece.size:
            return
        self.first, self.stop = (low, min(low + PIECE, self.scan.rows)) if way > 0 else (max(high - PIECE, 0), high)
        self.first, self.stop = min(self.first, low), max(self.stop, high)
        self.piece = exposed(self.scan, self.emulsion, self.first, self.stop)

    def _begin(self) -> tuple[float, Floats]:
        best, best_light, at = np.zeros(SIZE), 0.0, 0.5 * self.scan.rows
        for share in np.linspace(0.3, 0.7, STARTS)[np.argsort(np.abs(np.linspace(-1, 1, STARTS)), kind="stable")]:
            middle = float(share * self.scan.rows)
            self._load(middle, 1)
            shape, light = first_shape(self.piece, self.first, self.band, middle, self.period, self.spot, self.canvas)
            if light > best_light:
                best, best_light, at = shape, light, middle
            if light > 0.7:
                break
        if best_light <= 0.0:
            raise RefusedError(
                f"film: no swinging line found in columns {self.band.left} to {self.band.right}; "
                "give the traces' number and the rows in a swing"
            )
        return at, best

    def _follow(self, way: int, shape: Floats) -> None:
        turn, quality, blind = 2.0 * np.pi / self.period, np.empty(3), 0
        for block in self._blocks(way):
            middle = self.middle + block * self.period
            self._load(middle, way)
            shape = carried(shape, float(way), blind > 0)
            tried = shape.copy()
            fit_block(
                self.piece, self.first, tried, middle, self.period, turn, self.spot, ROOM, ROUNDS, self.canvas, quality
            )
            good = quality[2] > LIT and quality[0] > DIM
            if not good and blind >= PATIENCE:
                tried, light = first_shape(
                    self.piece, self.first, self.band, middle, self.period, self.spot, self.canvas
                )
                good = light > DIM
            if good:
                shape, blind = tried, 0
                self.shapes[block], self.light[block] = tried.copy(), float(quality[0])
            else:
                blind += 1

    def _blocks(self, way: int) -> Iterator[int]:
        block = way
        while 0.3 * self.period < self.middle + block * self.period < self.scan.rows - 0.3 * self.period:
            yield block
            block += way


def carried(shape: Floats, by: float, blindly: bool) -> Floats:
    """A block's shape seen from a middle `by` halves later; `blindly` without what the polynomials would lead to."""
    p, c, s = shape[:4], shape[4:7], shape[7:10]
    out = np.zeros(SIZE)
    if blindly:
        out[0], out[4], out[7] = p[0], c[0], s[0]
        return out
    out[0], out[1] = p @ by ** np.arange(4), 0.7 * (p[1] + 2.0 * by * p[2] + 3.0 * by**2 * p[3])
    for at, series in ((4, c), (7, s)):
        out[at], out[at + 1] = series @ by ** np.arange(3), 0.7 * (series[1] + 2.0 * by * series[2])
    return out


def _tracks(courses: list[_Course], rows: int, period: float, spot: float) -> Tracks:
    course, slope, curvature, light = (np.full((len(courses), rows), np.nan) for _ in range(4))
    for k, one in enumerate(courses):
        course[k], slope[k], curvature[k], light[k] = _blended(one, rows)
    known = np.isfinite(course)
    return Tracks(
        position=np.full_like(course, np.nan),
        sigma=np.full_like(course, np.nan),
        course=course,
        slope=slope,
        curvature=curvature,
        brightness=light,
        qc=np.where(known, GAP, LOST).astype(np.uint16),
        rows_per_swing=period,
        spot=spot,
    )


def _blended(one: _Course, rows: int) -> tuple[Floats, Floats, Floats, Floats]:
    """Course, slope, curvature and light by rows: from block to block smoothly."""
    out = np.full((4, rows), np.nan)
    turn = 2.0 * np.pi / one.period
    for block in sorted(one.shapes):
        middle = one.middle + block * one.period
        after = block + 1 in one.shapes
        low = middle if block - 1 in one.shapes else middle - one.period
        high = middle + one.period
        at = np.arange(max(int(np.ceil(low - 0.5)), 0), min(int(np.ceil(high - 0.5)), rows))
        if at.size == 0:
            continue
        here = _values(one.shapes[block], at + 0.5 - middle, one.period, turn)
        if after:
            there = _values(one.shapes[block + 1], at + 0.5 - middle - one.period, one.period, turn)
            x = np.clip((at + 0.5 - middle) / one.period, 0.0, 1.0)
            weight, lean = x * x * (3.0 - 2.0 * x), 6.0 * x * (1.0 - x) / one.period
            apart = there - here
            out[0, at] = here[0] + weight * apart[0]
            out[1, at] = here[1] + weight * apart[1] + lean * apart[0]
            out[2, at] = here[2] + weight * apart[2] + 2.0 * lean * apart[1]
            out[3, at] = one.light[block] + weight * (one.light[block + 1] - one.light[block])
        else:
            out[:3, at], out[3, at] = here, one.light[block]
    return out[0], out[1], out[2], out[3]


def _values(shape: Floats, away: NDArray[np.floating[Any]], half: float, turn: float) -> Floats:
    """Column, slope and curvature of a block's curve, (3, n)."""
    x = away / half
    rotation = np.exp(1j * turn * away)
    slow = np.polynomial.polynomial.Polynomial(shape[:4])
    pair = np.polynomial.polynomial.Polynomial(shape[4:7] - 1j * shape[7:10])
    z, dz, ddz = pair(x), pair.deriv()(x) / half, pair.deriv(2)(x) / half**2
    return np.stack(
        [
            slow(x) + (z * rotation).real,
            slow.deriv()(x) / half + ((dz + 1j * turn * z) * rotation).real,
            slow.deriv(2)(x) / half**2 + ((ddz + 2j * turn * dz - turn**2 * z) * rotation).real,
        ]
    )
