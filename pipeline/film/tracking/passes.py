"""Along the whole film and back, piece by piece; nothing but numbers a row is kept.

Each way leads from piece to piece; the pixels beforehand, and the rows' readings behind, are any thread's work.

Traces found anew are known by amplitude, resting place and phase. Through a blackout the paper may have run fast or
slow, which shifts the phases of all traces alike, and the ship may have moved the slow part; what the pendulums keep
are their amplitudes and the phase between them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import dataclass, field
from itertools import combinations, permutations

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats, median_present
from pipeline.film.emulsion import FilmEmulsion
from pipeline.film.marks.pieces import in_order
from pipeline.film.parts import Tracks
from pipeline.film.scan.opening import OpenScan
from pipeline.film.tracking.line_profile import Optics
from pipeline.film.tracking.outcome import Both, read_both
from pipeline.film.tracking.pieces import Filter, Piece, run, run_again
from pipeline.film.tracking.probing import SURE
from pipeline.film.tracking.section import Section, read_section

AMPLITUDE, PLACE, PHASE, COMMON = 0.06, 0.5, 0.25, 1.5  # 1 sigma: of the amplitude (twice), radians
AMBIGUOUS = 9.0  # how much worse the second best must be
WORST = 40.0
MOST_TRACES = 6
PIECE_SWINGS, SECTION_SWINGS = 4.0, 6.0
SOUND = 0.6  # share of rows read by which the last good row of a lost trace is told
LIT = 0.5  # of the usual light: what is fainter may be chance in the grain beyond the ends of the film
Progress = Callable[[int, int], None]


def match(section: Section, last: list[tuple[float, Floats]]) -> list[int] | None:
    """Trace number of each swing of the section, None if it cannot be told; -1 for a swing that is none of them."""
    found = section.swings
    if len(found) > MOST_TRACES or len(last) > MOST_TRACES:
        return None
    cost = []
    size = min(len(found), len(last))
    for chosen in permutations(range(len(found)), size):
        for names in combinations(range(len(last)), size):
            cost += [(_cost(section, chosen, names, last), chosen, names)]
    cost.sort(key=lambda each: each[0])
    if cost[0][0] > WORST * size or (len(cost) > 1 and cost[1][0] - cost[0][0] < AMBIGUOUS):
        return None
    result = [-1] * len(found)
    for place, name in zip(cost[0][1], cost[0][2], strict=True):
        result[place] = name
    return result


def _cost(
    section: Section,
    chosen: tuple[int, ...],
    names: tuple[int, ...],
    last: list[tuple[float, Floats]],
) -> float:
    total, phases = 0.0, []
    for place, name in zip(chosen, names, strict=True):
        swing = section.swings[place]
        row, state = last[name]
        amplitude = float(np.hypot(state[3], state[4]))
        total += (np.log(swing.amplitude / amplitude) / AMPLITUDE) ** 2
        total += ((swing.state[0] - state[0]) / (PLACE * amplitude)) ** 2
        then = np.arctan2(state[4], state[3]) + state[5] * (swing.row - row)
        phases.append(np.arctan2(swing.state[4], swing.state[3]) - then)
    turned = np.exp(1j * np.array(phases))
    common = float(np.angle(turned.mean()))
    apart = np.angle(turned * np.exp(-1j * common))
    return float(total + np.sum((apart / PHASE) ** 2) + (common / COMMON) ** 2)


@dataclass
class Film:
    """The film, and what is known of it as a whole."""

    scan: OpenScan
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

    def pixels(self, pieces: list[tuple[int, int]], jobs: int) -> Iterator[NDArray[np.float32]]:
        """The darkness of some pieces, in their order."""
        return in_order(lambda piece: self.darkness(*piece), pieces, jobs)


@dataclass
class Forward:
    """What the way along the film left: arrays (traces, rows), and the filter before each piece."""

    place: Floats
    variance: Floats
    light: Floats
    followed: NDArray[np.uint8]
    checkpoints: list[Filter]


def forward(film: Film, first_section: Section, progress: Callable[[int], None], jobs: int = 1) -> Forward:
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
    for (first, stop), darkness in zip(film.pieces, film.pixels(film.pieces, jobs), strict=True):
        begins = np.full(traces, -1)
        if first >= first_section.first - (stop - first) and not begun.alive.all():
            _look_again(film, begun, begins, first, stop, first_section, last)
        out.checkpoints.append(deepcopy(begun))
        if begun.alive.any() or (begins >= 0).any():
            piece = run(begun, darkness, first, 1, film.optics, begins)
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
        begin = _solid_from(light > LIT * median_present(light), first - section.first, film.period)
        if begin is not None and section.first + begin < stop:
            lamp = median_present(section.brightness[found])
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


def backward(
    film: Film, ahead: Forward, progress: Callable[[int], None], jobs: int = 1
) -> tuple[Tracks, NDArray[np.float32]]:
    """Follow all traces back, join both ways piece by piece, and read every row.

    Returns
    -------
    tracks : Tracks
    misfit : (traces, rows) array
        Mean square residual of each row's fit over that of the grain.
    """
    traces, rows = ahead.place.shape
    tracks = Tracks.empty(traces, rows, film.period, film.optics.spot)
    misfit = np.full((traces, rows), np.nan, np.float32)
    blackest = float(np.log10(film.emulsion.full_scale / 0.75) - film.emulsion.blank.darkness.max())

    def read(piece: tuple[int, Both | None]) -> int:
        first, both = piece
        if both is not None:
            read_both(both, film.emulsion, film.optics, tracks, misfit, blackest)
        return first

    for first in in_order(read, _followed_back(film, ahead, jobs), jobs):
        progress(2 * film.scan.rows - first)
    return tracks, misfit


def _followed_back(film: Film, ahead: Forward, jobs: int) -> Iterator[tuple[int, Both | None]]:
    """Follow all traces back and join both ways: the first row of each piece, and what its rows are read with."""
    begun = Filter.idle(ahead.place.shape[0], film.period)
    backwards = film.pieces[::-1]
    for (first, stop), darkness in zip(backwards, film.pixels(backwards, jobs), strict=True):
        part = slice(first, stop)
        forth = run_again(
            ahead.checkpoints.pop(), ahead.place[:, part], ahead.variance[:, part], ahead.followed[:, part], film.optics
        )
        begins = _turn_back(begun, forth, ahead, first, stop, film.period)
        if not (begun.alive.any() or (begins >= 0).any() or forth.followed.any()):
            yield first, None
            continue
        back = run(begun, darkness, first, -1, film.optics, begins)
        alone = (ahead.followed[:, part] == 0) & (back.followed > 0)
        ahead.light[:, part][alone] = back.brightness[alone]
        yield first, Both.of(first, darkness, forth, back, ahead.light, film.optics.spot)


def _turn_back(begun: Filter, forth: Piece, ahead: Forward, first: int, stop: int, period: float) -> NDArray[np.int64]:
    """Rows at which the way back takes up traces that it does not follow but the way along did."""
    traces = begun.alive.size
    begins = np.full(traces, -1)
    half = max(4, round(0.5 * period))
    for k in range(traces):
        if begun.alive[k] or not ahead.followed[k].any():
            continue
        low, light = max(0, first - half), ahead.light[k]
        read = np.isfinite(ahead.variance[k, low:stop]) & (light[low:stop] > LIT * median_present(light))
        behind = _solid_from(read[::-1], 0, period)
        if behind is not None and behind < stop - first:
            row = stop - 1 - behind
            lamp = median_present(light[max(0, row - half) : row + 1])
            begins[k] = row - first
            begun.restart(k, forth.states[begins[k], k], max(lamp, 0.02), alive=False)
    return begins
