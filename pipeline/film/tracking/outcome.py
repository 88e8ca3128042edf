"""What was read of a film's traces, filled piece by piece."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.tracking.combine import combined
from pipeline.film.tracking.gap_fit import fit_gaps
from pipeline.film.tracking.gaps import as_table, find_gaps, from_table, lamp_course
from pipeline.film.tracking.judgement import judge, openness
from pipeline.film.tracking.optics import Optics
from pipeline.film.tracking.pieces import Piece
from pipeline.film.tracking.reading import FIELDS, read_piece

MARGIN_SPOTS = 16  # of gaps, beyond a piece


@dataclass(frozen=True)
class Both:
    """A piece of film followed both ways, apart from all others: with this its rows are read.

    Attributes
    ----------
    first : int
        Its first row.
    darkness : (rows, columns) array
        Above blank film.
    forth, back : Piece
        The ways along the film and back.
    above : int
        How far the light reaches beyond the piece's first row, at most four margins.
    light : (traces, more rows) array
        Brightness of the lines in the piece and around it, NaN where not followed.
    """

    first: int
    darkness: NDArray[np.float32]
    forth: Piece
    back: Piece
    above: int
    light: Floats

    @staticmethod
    def of(first: int, darkness: NDArray[np.float32], forth: Piece, back: Piece, light: Floats, spot: float) -> Both:
        """With a copy of what is needed of the whole film's light, (traces, rows)."""
        margin = 4 * round(MARGIN_SPOTS * spot)
        low, high = max(0, first - margin), min(light.shape[1], first + darkness.shape[0] + margin)
        return Both(first, darkness, forth, back, first - low, light[:, low:high].copy())


def read_both(both: Both, optics: Optics, period: float, out: Outcome) -> None:
    """Read the rows of a piece into their places; pieces do not touch each other's."""
    first, darkness, rows = both.first, both.darkness, both.darkness.shape[0]
    traces = both.light.shape[0]
    states, variance, slope_variance, disagreement, known = combined(both.forth, both.back, optics)
    margin = round(MARGIN_SPOTS * optics.spot)
    low, high = max(0, both.above - margin), min(both.light.shape[1], both.above + rows + margin)
    lamps, gaps = [], []
    for light in both.light:
        lamp = lamp_course(light, period)
        gaps.append(find_gaps(light[low:high], lamp[low:high], first - both.above + low, optics.spot))
        lamps.append(lamp[both.above : both.above + rows])
    lamp = np.stack(lamps)
    table, gap_of = as_table(gaps)
    numbers, curve = optics.numbers(), optics.curve.table()
    fit_gaps(darkness, first, states, known, lamp, table, gap_of, numbers, curve, np.empty(table.shape[0]))
    gaps = from_table(table, gap_of)
    reading = np.empty((traces, rows, FIELDS))
    read_piece(darkness, first, states, known, slope_variance, lamp, table, gap_of, numbers, curve, reading)
    part, inside = slice(first, first + rows), slice(both.above, both.above + rows)
    for k in range(traces):
        share = openness(gaps[k], first, rows, optics.spot)
        column = np.clip(np.nan_to_num(states[:, k, 0] + states[:, k, 3]), 0, darkness.shape[1] - 1).astype(int)
        black = darkness[np.arange(rows), column] > out.blackest
        position, sigma, qc = judge(
            reading[k], states[:, k], variance[k], disagreement[k], known[k], share, lamp[k], black, optics
        )
        out.misfit[k, part] = np.where(known[k] > 0, reading[k, :, 4], np.nan)
        out.keep(k, part, position, sigma, qc, states[:, k], known[k] > 0, both.light[k, inside] / lamp[k])


@dataclass
class Outcome:
    """The columns of `Tracks`, filled piece by piece, and the mean square residual of each row's fit."""

    position: NDArray[np.float64]
    sigma: NDArray[np.float64]
    course: NDArray[np.float64]
    slope: NDArray[np.float64]
    curvature: NDArray[np.float64]
    brightness: NDArray[np.float64]
    qc: NDArray[np.uint16]
    misfit: NDArray[np.float32]
    shear: float
    blackest: float

    @staticmethod
    def empty(traces: int, rows: int, shear: float, blackest: float) -> Outcome:
        """Nothing read yet."""
        position, sigma, course, slope, curvature, brightness = np.full((6, traces, rows), np.nan)
        qc, misfit = np.zeros((traces, rows), np.uint16), np.full((traces, rows), np.nan, np.float32)
        return Outcome(position, sigma, course, slope, curvature, brightness, qc, misfit, shear, blackest)

    def keep(
        self,
        trace: int,
        part: slice,
        position: Floats,
        sigma: Floats,
        qc: NDArray[np.uint16],
        states: Floats,
        known: NDArray[np.bool_],
        brightness: Floats,
    ) -> None:
        """One trace's rows of a piece."""
        rate = states[:, 1] - states[:, 5] * states[:, 4]
        bend = states[:, 2] - states[:, 5] ** 2 * states[:, 3]
        gain = 1.0 + self.shear * rate
        self.position[trace, part], self.sigma[trace, part], self.qc[trace, part] = position, sigma, qc
        self.course[trace, part] = np.where(known, states[:, 0] + states[:, 3], np.nan)
        self.slope[trace, part] = np.where(known, rate / gain, np.nan)
        self.curvature[trace, part] = np.where(known, bend / gain**3, np.nan)
        self.brightness[trace, part] = np.where(known, brightness, np.nan)
