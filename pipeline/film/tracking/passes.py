"""Along the whole film and back, piece by piece; nothing but numbers a row is kept."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.emulsion.film_emulsion import FilmEmulsion
from pipeline.film.parts import Scan
from pipeline.film.tracking.combine import combined
from pipeline.film.tracking.gap_fit import fit_gaps
from pipeline.film.tracking.gaps import as_table, find_gaps, from_table, lamp_course
from pipeline.film.tracking.judgement import judge, openness
from pipeline.film.tracking.matching import match
from pipeline.film.tracking.optics import Optics
from pipeline.film.tracking.pieces import Filter, Piece, run, run_again
from pipeline.film.tracking.probing import SURE
from pipeline.film.tracking.reading import FIELDS, read_piece
from pipeline.film.tracking.section import Section, read_section

PIECE_SWINGS, SECTION_SWINGS = 4.0, 6.0
MARGIN_SPOTS = 16
SOUND = 0.6  # share of rows read by which the last good row of a lost trace is told
LIT = 0.5  # of the usual light: what is fainter may be chance in the grain beyond the ends of the film
Progress = Callable[[int, int], None]


@dataclass
class Film:
    """The film, and what is known of it as a whole."""

    scan: Scan
    emulsion: FilmEmulsion
    optics: Optics
    period: float
    pieces: list[tuple[int, int]] = field(init=False)

    def __post_init__(self) -> None:
        height = int(np.clip(round(PIECE_SWINGS * self.period), 48, 2048))
        firsts = range(0, self.scan.rows, height)
        self.pieces = [(first, min(first + height, self.scan.rows)) for first in firsts]

    def darkness(self, first: int, stop: int) -> NDArray[np.float32]:
        """Rows `first` to `stop`, above blank film."""
        return self.emulsion.darkness(self.scan.read(first, stop), first)


@dataclass
class Forward:
    """What the way along the film left: arrays (traces, rows), and the filter before each piece."""

    place: Floats
    variance: Floats
    light: Floats
    followed: NDArray[np.uint8]
    checkpoints: list[Filter]


def forward(film: Film, first_section: Section, progress: Callable[[int], None]) -> Forward:
    """Follow all traces along the film; what is lost is looked for again at the start of each piece."""
    traces, rows = len(first_section.swings), film.scan.rows
    out = Forward(
        np.zeros((traces, rows)),
        np.full((traces, rows), np.inf),
        np.full((traces, rows), np.nan),
        np.zeros((traces, rows), np.uint8),
        [],
    )
    begun = Filter.idle(traces, film.period)
    last = [(swing.row, swing.state) for swing in first_section.swings]
    for first, stop in film.pieces:
        begins = np.full(traces, -1)
        if first >= first_section.first - (stop - first) and not begun.alive.all():
            _look_again(film, begun, begins, first, stop, first_section, last)
        out.checkpoints.append(begun.copy())
        if begun.alive.any() or (begins >= 0).any():
            piece = run(begun, film.darkness(first, stop), first, 1, film.optics, begins)
            out.place[:, first:stop], out.variance[:, first:stop] = piece.place, piece.variance
            out.light[:, first:stop] = np.where(piece.followed > 0, piece.brightness, np.nan)
            out.followed[:, first:stop] = piece.followed
            for k in range(traces):
                good = np.flatnonzero(np.isfinite(piece.variance[k]))
                if good.size:
                    last[k] = (first + good[-1] + 0.5, piece.states[good[-1], k].copy())
        progress(stop)
    return out


def _look_again(
    film: Film,
    begun: Filter,
    begins: NDArray[np.int64],
    first: int,
    stop: int,
    first_section: Section,
    last: list[tuple[float, Floats]],
) -> None:
    """Find traces that are not being followed on this piece and what comes next, and tell which is which.

    Within the first section its own reading tells; beyond it traces are known by where and how they swung last.
    """
    if first < first_section.first + first_section.darkness.shape[0]:
        section: Section | None = first_section
        names: list[int] | None = list(range(len(last)))
    else:
        ahead = min(film.scan.rows, first + max(stop - first, round(SECTION_SWINGS * film.period)))
        section = read_section(film.darkness(first, ahead), first, film.optics, film.period, len(last), least=SURE)
        names = match(section, last) if section is not None else None
    if section is None or names is None:
        return
    for found, k in enumerate(names):
        if k < 0 or begun.alive[k]:
            continue
        light = section.brightness[found]
        begin = _solid_from(light > LIT * np.nanmedian(light), first - section.first, film.period)
        if begin is not None and section.first + begin < stop:
            lamp = float(np.nanmedian(section.brightness[found]))
            begun.restart(k, section.states[begin, found], lamp, alive=False)
            begins[k] = section.first + begin - first


def _solid_from(read: NDArray[np.bool_], least: int, period: float) -> int | None:
    """First row, not before `least`, from which on a trace is read on most rows of half a swing.

    Beyond the ends of a film chance readings of the grain are met, and a trace begun on one is lost again at once.
    """
    half = max(4, round(0.5 * period))
    total = np.concatenate([[0], np.cumsum(read)])
    rows = np.flatnonzero(read)
    stop = np.minimum(rows + half, read.size)
    solid = rows[(total[stop] - total[rows] >= SOUND * half) & (rows >= least)]
    return int(solid[0]) if solid.size else None


def backward(film: Film, ahead: Forward, progress: Callable[[int], None], out: Outcome) -> None:
    """Follow all traces back, join both ways piece by piece, and read every row."""
    traces, rows = ahead.place.shape
    begun = Filter.idle(traces, film.period)
    margin = round(MARGIN_SPOTS * film.optics.spot)
    for number in range(len(film.pieces) - 1, -1, -1):
        first, stop = film.pieces[number]
        part = slice(first, stop)
        forth = run_again(
            ahead.checkpoints.pop(), ahead.place[:, part], ahead.variance[:, part], ahead.followed[:, part], film.optics
        )
        begins = _turn_back(begun, forth, ahead, first, stop, film.period)
        if not (begun.alive.any() or (begins >= 0).any() or forth.followed.any()):
            progress(rows + rows - first)
            continue
        darkness = film.darkness(first, stop)
        back = run(begun, darkness, first, -1, film.optics, begins)
        alone = (ahead.followed[:, part] == 0) & (back.followed > 0)
        ahead.light[:, part][alone] = back.brightness[alone]
        states, variance, slope_variance, disagreement, known = combined(forth, back, film.optics)
        low, high = max(0, first - margin), min(rows, stop + margin)
        wide = max(0, first - 4 * margin), min(rows, stop + 4 * margin)
        lamps, gaps = [], []
        for k in range(traces):
            lamp = lamp_course(ahead.light[k, wide[0] : wide[1]], film.period)[low - wide[0] : high - wide[0]]
            gaps.append(find_gaps(ahead.light[k, low:high], lamp, low, film.optics.spot))
            lamps.append(lamp[first - low : stop - low])
        lamp = np.stack(lamps)
        table, gap_of = as_table(gaps)
        numbers, curve = film.optics.numbers(), film.optics.curve.table()
        fit_gaps(darkness, first, states, known, lamp, table, gap_of, numbers, curve, np.empty(table.shape[0]))
        gaps = from_table(table, gap_of)
        reading = np.empty((traces, stop - first, FIELDS))
        read_piece(darkness, first, states, known, slope_variance, lamp, table, gap_of, numbers, curve, reading)
        for k in range(traces):
            share = openness(gaps[k], first, stop - first, film.optics.spot)
            column = np.clip(np.nan_to_num(states[:, k, 0] + states[:, k, 3]), 0, darkness.shape[1] - 1).astype(int)
            black = darkness[np.arange(stop - first), column] > out.blackest
            position, sigma, qc = judge(
                reading[k], states[:, k], variance[k], disagreement[k], known[k], share, lamp[k], black, film.optics
            )
            out.misfit[k, part] = np.where(known[k] > 0, reading[k, :, 4], np.nan)
            out.keep(k, part, position, sigma, qc, states[:, k], known[k] > 0, ahead.light[k, part] / lamp[k])
        progress(rows + rows - first)


def _turn_back(begun: Filter, forth: Piece, ahead: Forward, first: int, stop: int, period: float) -> NDArray[np.int64]:
    """Rows at which the way back takes up traces that it does not follow but the way along did."""
    traces = begun.alive.size
    begins = np.full(traces, -1)
    half = max(4, round(0.5 * period))
    for k in range(traces):
        if begun.alive[k] or not ahead.followed[k].any():
            continue
        low, light = max(0, first - half), ahead.light[k]
        read = np.isfinite(ahead.variance[k, low:stop]) & (light[low:stop] > LIT * np.nanmedian(light))
        behind = _solid_from(read[::-1], 0, period)
        if behind is not None and behind < stop - first:
            row = stop - 1 - behind
            lamp = float(np.nanmedian(light[max(0, row - half) : row + 1]))
            begins[k] = row - first
            begun.restart(k, forth.states[begins[k], k], max(lamp, 0.02), alive=False)
    return begins


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

        def column() -> NDArray[np.float64]:
            return np.full((traces, rows), np.nan)

        return Outcome(
            column(),
            column(),
            column(),
            column(),
            column(),
            column(),
            np.zeros((traces, rows), np.uint16),
            np.full((traces, rows), np.nan, np.float32),
            shear,
            blackest,
        )

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
