"""Traces of a film, row by row: followed along the film and back, piece by piece, then read where they were followed.

Pixels are decoded ahead, and rows are read behind, in any thread. Nothing but numbers per row is kept.
"""

from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations, permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats, median_present
from pipeline.film.edits import Placed
from pipeline.film.emulsion import FilmEmulsion, Optics, measure_blank, shown_darkness
from pipeline.film.marks.search import in_order
from pipeline.film.parts import Tracks
from pipeline.film.scan.opening import OpenScan
from pipeline.film.tracking.outcome import MARGIN_SPOTS, NOTHING, checked, flag_lost, read_both
from pipeline.film.tracking.pieces import HIDDEN, NO_LINES, Filter, Piece, Section, follow_from, replay, run
from pipeline.film.tracking.probing import SURE, probe
from pipeline.film.tracking.seeding import read_section

NEAR_PIECES, FAR_PIECES = 3, 8  # searched from the film's start, and from there to the section that was probed
LEAD_SWINGS = 8.0  # before the first section, on which traces that were not found there may be followed
PIECE_SWINGS, SECTION_SWINGS = 4.0, 6.0
SOUND = 0.6  # share of rows read in half a swing, from which a trace is there
NEAR_SWING = 1.5  # of a first guess of the rows in a swing
LEAST_LINE = 0.5  # of a swing, from which a line drawn by hand starts a trace
WINGS = 4.0  # spots, beyond which a line lights nothing
LIT = 0.5  # of the usual light: what is fainter may be chance in the grain beyond the ends of the film
AMPLITUDE, PLACE, PHASE, COMMON = 0.06, 0.5, 0.25, 1.5  # 1 sigma: of the amplitude (twice), radians
WORST, AMBIGUOUS = 40.0, 9.0  # chi square a trace at most, and by which the second best must be worse
MOST_TRACES = 6
MODELLED = 0.008  # of a resting line's darkness: variance that the model of a line may leave, over darkness
Last = list[tuple[float, Floats]]  # Row and state at which each trace was read last


@dataclass
class Film:
    """The film, and what is known of it as a whole."""

    scan: OpenScan
    emulsion: FilmEmulsion
    optics: Optics
    period: float
    edits: Placed | None = None
    lines: Floats = field(default_factory=lambda: NO_LINES)  # (traces, rows), columns of lines drawn by hand, or none
    jobs: int = 1  # threads that may work
    progress: Callable[[int, int], None] = lambda done, total: None  # rows done, and rows to do

    @cached_property
    def pieces(self) -> list[tuple[int, int]]:
        """First rows of the pieces that are followed one by one, and those behind the last."""
        height = int(np.clip(round(PIECE_SWINGS * self.period), 48, 2048))
        return [(first, min(first + height, self.scan.rows)) for first in range(0, self.scan.rows, height)]

    def darkness(self, first: int, stop: int) -> NDArray[np.float32]:
        """Rows `first` to `stop`, above blank film; NaN where nothing is to be read."""
        darkness = shown_darkness(self.emulsion, self.scan, first, stop, np.nan)
        return darkness if self.edits is None else self.edits.hide(darkness, first)

    def pixels(self, pieces: range) -> Iterator[NDArray[np.float32]]:
        """The darkness of some pieces, in their order."""
        return in_order(lambda number: self.darkness(*self.pieces[number]), pieces, self.jobs)

    def section(self, first: int, stop: int, traces: int) -> Section | None:
        """The traces found anew on the section that begins at a row and reaches to `stop` at least."""
        stop = min(self.scan.rows, max(stop, first + round(SECTION_SWINGS * self.period)))
        return read_section(self.darkness(first, stop), first, self.optics, self.period, traces, least=SURE)


@dataclass
class Following:
    """Traces followed along, (traces, rows), and back, and what it takes to follow a stretch of it once more."""

    film: Film
    section: Section
    tracks: Tracks
    misfit: NDArray[np.float32]
    place: Floats
    variance: Floats
    light: Floats
    followed: NDArray[np.uint8]
    first_look: FilmEmulsion  # with which they were followed along
    checkpoints: dict[int, tuple[Filter, Last]] = field(default_factory=dict)  # before each piece, with last readings
    behind: dict[int, Filter] = field(default_factory=dict)  # the same on the way back

    @staticmethod
    def of(film: Film, section: Section) -> "Following":
        """All traces of a section followed over the whole film, both ways."""
        traces, rows = len(section.swings), film.scan.rows
        tracks = Tracks.empty(traces, rows, film.period, film.optics.spot, film.optics.shear)
        misfit, (place, variance, light) = np.empty((traces, rows), np.float32), np.empty((3, traces, rows))
        out = Following(
            film, section, tracks, misfit, place, variance, light, np.zeros((traces, rows), np.uint8), film.emulsion
        )
        pieces, idle = range(len(film.pieces)), Filter.idle(traces, film.period)
        out._forward(pieces, deepcopy(idle), [(swing.row, swing.state) for swing in section.swings])
        out._measure_between()
        out._backward(pieces, idle)
        out.tracks = replace(tracks, rows_per_swing=usual_swing(tracks))
        return out

    def again(self, edits: Placed, jobs: int = 1) -> "Following":
        """The same with the stretches that a person edited followed once more."""
        traces, rows = self.followed.shape
        lines = edits.courses(traces, rows)
        lines = NO_LINES if lines is None else lines
        film = replace(self.film, edits=edits, lines=lines, jobs=jobs, progress=lambda *_: None)
        out = deepcopy(self, {id(self.film): film, id(self.section): self.section})
        firsts = [first for first, _ in film.pieces]
        for first_row, last_row in edits.stretches(rows, film.period):
            first, last = np.searchsorted(firsts, [first_row, last_row], side="right").tolist()
            some = range(first - 1, last)
            out.tracks.forget(slice(firsts[first - 1], film.pieces[last - 1][1]))
            out._forward(some, *deepcopy(self.checkpoints[some[0]]))
            out._backward(some, deepcopy(self.behind[some[-1]]))
        edits.without_ignored(out.tracks)
        return out

    def checked(self) -> Tracks:
        """The traces, where they can be trusted; see `checked`."""
        optics = self.film.optics
        return checked(self.tracks, self.misfit, MODELLED * float(optics.curve.darkness(1.0)) / float(optics.grain[1]))

    @property
    def along(self) -> Film:
        """The film as it is followed along."""
        return replace(self.film, emulsion=self.first_look)

    def _forward(self, pieces: range, begun: Filter, last: Last) -> None:
        """Follow all traces along some pieces; those that were lost are searched for at the start of each."""
        film = self.along
        for number, darkness in zip(pieces, film.pixels(pieces), strict=True):
            first, stop = film.pieces[number]
            part, begun.begins[:] = slice(first, stop), -1
            lines = np.ascontiguousarray(film.lines[:, part])
            if first >= self.section.first - (stop - first) and not begun.alive.all():
                self._look_again(begun, first, stop, last)
            _start_on_lines(begun, lines, film.period)
            self.checkpoints[number] = deepcopy(begun), list(last)
            piece = run(begun, darkness, first, 1, film.optics.lens, lines)
            self.place[:, part], self.variance[:, part] = piece.place, piece.variance
            self.followed[:, part] = piece.followed
            usual = np.array([[median_present(each)] for each in piece.brightness])
            light = np.where(np.isnan(piece.brightness), usual, piece.brightness)  # where nothing is to be read
            self.light[:, part] = np.where(piece.followed > 0, light, np.nan)
            for k, variance in enumerate(piece.variance):
                good = np.flatnonzero(np.isfinite(variance))
                if good.size:
                    last[k] = (first + good[-1] + 0.5, piece.states[good[-1], k].copy())
            film.progress(stop, 2 * film.scan.rows)

    def _measure_between(self) -> None:
        """Blank film and, with it, the optics once more, now that it is known which film no line lit."""
        film, rows = self.film, np.arange(self.film.scan.rows)
        half = int(np.ceil(WINGS * film.optics.spot))
        left, right = np.stack([np.full_like(self.place, -np.inf), np.full_like(self.place, np.inf)])
        for k, (place, variance) in enumerate(zip(self.place, self.variance, strict=True)):
            read = np.isfinite(variance)
            if read.any():
                course, known = np.interp(rows, rows[read], place[read]), self.followed[k] > 0
                left[k] = minimum_filter1d(np.where(known, course, -np.inf), 2 * half + 1)
                right[k] = maximum_filter1d(np.where(known, course, np.inf), 2 * half + 1)

        def unlit(first: int, height: int, columns: int) -> NDArray[np.bool_]:
            at, some = np.arange(columns), slice(first, first + height)
            bounds = zip(left[:, some], right[:, some], strict=True)
            beside = [(at < a[:, None] - half) | (at > b[:, None] + half) for a, b in bounds]
            return np.asarray(np.logical_and.reduce(beside))

        blank = measure_blank(film.scan, film.emulsion.blank.across, unlit)
        film = replace(film, emulsion=replace(film.emulsion, blank=blank._replace(across=film.emulsion.blank.across)))
        self.film = film

    def _backward(self, pieces: range, begun: Filter) -> None:
        """Follow all traces back, join both ways piece by piece, and read every row."""
        film, tracks = self.film, self.tracks

        def read(piece: tuple[Any, ...]) -> int:
            read_both(film.emulsion, film.optics, film.period, tracks, self.misfit, *piece)
            return int(piece[0])

        for first in in_order(read, self._followed_back(pieces, begun), film.jobs):
            film.progress(2 * film.scan.rows - first, 2 * film.scan.rows)
        some = slice(film.pieces[pieces.start][0], film.pieces[pieces.stop - 1][1])
        flag_lost(tracks.position, tracks.course, tracks.qc, film.period, some)

    def _followed_back(self, pieces: range, begun: Filter) -> Iterator[tuple[Any, ...]]:
        """Follow all traces back: of each piece its first row, and what its rows are read with (see `read_both`)."""
        film = self.film
        margin = 4 * round(MARGIN_SPOTS * film.optics.spot)
        for number, darkness in zip(pieces[::-1], film.pixels(pieces[::-1]), strict=True):
            first, stop = film.pieces[number]
            part = slice(first, stop)
            lines, known = np.ascontiguousarray(film.lines[:, part]), deepcopy(self.checkpoints[number][0])
            kept = self.place[:, part], self.variance[:, part], self.followed[:, part]
            forth = replay(known, *kept, film.optics.lens, lines)
            self.behind[number] = deepcopy(begun)
            self._turn_back(begun, forth, first, stop)
            back = run(begun, darkness, first, -1, film.optics.lens, lines)
            alone = (self.followed[:, part] == 0) & (back.followed > 0)
            self.light[:, part][alone] = back.brightness[alone]
            low = max(0, first - margin)
            yield first, darkness, forth, back, first - low, self.light[:, low : stop + margin].copy()

    def _look_again(self, begun: Filter, first: int, stop: int, last: Last) -> None:
        """Find traces that are not being followed, and say which is which by where and how they swung last."""
        section, names = self.section, list(range(len(last)))
        if first >= section.first + section.darkness.shape[0]:
            again = self.along.section(first, stop, len(last))
            if again is None:
                return
            section, names = again, match(again, last)
        for number, k in enumerate(names):
            if k < 0 or begun.alive[k]:
                continue
            usual = median_present(section.brightness[number])
            lit, hidden = section.brightness[number] > LIT * usual, section.hidden[number]
            begin = _solid_from(lit, hidden, first - section.first, self.film.period)
            if begin is not None and section.first + begin < stop:
                begun.restart(k, section.states[begin, number], usual, section.first + begin - first)

    def _turn_back(self, begun: Filter, forth: Piece, first: int, stop: int) -> None:
        """Take up traces that the way back does not follow but the way along did."""
        half = max(4, round(0.5 * self.film.period))
        low = max(0, first - half)
        for k in np.flatnonzero((begun.alive == 0) & self.followed.any(axis=1)).tolist():
            light = self.light[k]
            read = np.isfinite(self.variance[k, low:stop]) & (light[low:stop] > LIT * median_present(light))
            hidden = self.followed[k, low:stop] == HIDDEN
            behind = _solid_from(read[::-1], hidden[::-1], 0, self.film.period)
            if behind is not None and behind < stop - first:
                row = stop - 1 - behind
                lamp = median_present(light[max(0, row - half) : row + 1])
                begun.restart(k, forth.states[row - first, k], max(lamp, 0.02), row - first)


def follow_traces(
    scan: OpenScan, emulsion: FilmEmulsion, *, count: int | None = None, jobs: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Following:  # fmt: skip
    """Find a film's traces, `count` if known, and follow them both ways; `RefusedError`: nothing swings, or fewer."""
    section = probe(scan, emulsion, count)
    if section is None:
        raise RefusedError(NOTHING)
    traces = len(section.swings)
    if count is not None and traces < count:
        raise RefusedError(
            f"{traces} of {count} traces stand out on the film: another is too faint, or lies on one of them; scan "
            "with more light, or say with --trace what swings on it"
        )
    film = Film(scan, emulsion, section.optics, section.period, jobs=jobs, progress=progress or (lambda *_: None))
    return Following.of(film, first_section(film, section))


def usual_swing(tracks: Tracks) -> float:
    """Rows in a full swing: the usual distance of turns to the same side, of all traces; as told before without any."""
    apart = []
    for slope in (*tracks.slope, *-tracks.slope):
        before = np.flatnonzero((slope[:-1] > 0.0) & (slope[1:] <= 0.0))
        turns = before + slope[before] / (slope[before] - slope[before + 1])
        apart.append(np.diff(turns))
    rows = np.concatenate(apart)
    rows = rows[(rows > tracks.rows_per_swing / NEAR_SWING) & (rows < NEAR_SWING * tracks.rows_per_swing)]
    return float(np.median(rows)) if rows.size else tracks.rows_per_swing


def first_section(film: Film, probed: Section) -> Section:
    """The first of some sections on which all traces are found, with some rows before it on which they may begin."""
    ahead, section = [first for first, _ in film.pieces if first < probed.first], probed
    for first in sorted({*ahead[:NEAR_PIECES], *ahead[:: max(1, len(ahead) // FAR_PIECES)]}):
        other = film.section(first, first, len(probed.swings))
        if other is not None and len(other.swings) == len(probed.swings):
            section = other
            break
    first = max(0, section.first - round(LEAD_SWINGS * film.period))
    if first == section.first:
        return section
    darkness = film.darkness(first, section.first + section.darkness.shape[0])
    return follow_from(section.swings, darkness, first, film.optics, 1.0)


def _solid_from(read: NDArray[np.bool_], hidden: NDArray[np.bool_], least: int, period: float) -> int | None:
    """First row from `least` on with most of half a swing read: beyond a film's ends chance readings are met."""
    half = max(4, round(0.5 * period))
    total, lacking = (np.concatenate([[0], np.cumsum(each)]) for each in (read, hidden))
    rows = np.flatnonzero(read)
    stop = np.minimum(rows + half, read.size)
    solid = rows[(total[stop] - total[rows] >= SOUND * (half - lacking[stop] + lacking[rows])) & (rows >= least)]
    return int(solid[0]) if solid.size else None


def _start_on_lines(begun: Filter, lines: Floats, period: float) -> None:
    """Start traces that are not followed where a line of half a swing or more says how they run."""
    for k, line in enumerate(lines):
        rows = np.flatnonzero(np.isfinite(line))[: round(period)]
        if begun.alive[k] or begun.begins[k] >= 0 or rows.size < LEAST_LINE * period:
            continue
        turn, away = 2.0 * np.pi / period, rows - rows[0]
        terms = np.stack([np.ones(rows.size), np.cos(turn * away), np.sin(turn * away)], axis=1)
        rest, cosine, sine = np.linalg.lstsq(terms, line[rows], rcond=None)[0].tolist()
        # the pair is amplitude times cosine and sine of the phase, which turns with the rows
        begun.restart(k, np.array([rest, 0.0, 0.0, cosine, -sine, turn]), begin=int(rows[0]))


def match(section: Section, last: Last) -> list[int]:
    """Trace number of each swing of the section, -1 for a swing that is none of them; none if that is not certain."""
    traces, names = len(section.swings), len(last)
    if max(traces, names) > MOST_TRACES:
        return []
    size = min(traces, names)
    cost = sorted(
        (_cost(section, chosen, named, last), chosen, named)
        for chosen in permutations(range(traces), size)
        for named in combinations(range(names), size)
    )
    if cost[0][0] > WORST * size or (len(cost) > 1 and cost[1][0] - cost[0][0] < AMBIGUOUS):
        return []
    names_of = dict(zip(cost[0][1], cost[0][2], strict=True))
    return [names_of.get(place, -1) for place in range(traces)]


def _cost(section: Section, chosen: tuple[int, ...], names: tuple[int, ...], last: Last) -> float:
    """Chi square of some swings that are taken for some traces."""
    total, phases = 0.0, []
    for place, name in zip(chosen, names, strict=True):
        swing, (row, state) = section.swings[place], last[name]
        amplitude = float(np.hypot(state[3], state[4]))
        total += (np.log(swing.amplitude / amplitude) / AMPLITUDE) ** 2
        total += ((swing.state[0] - state[0]) / (PLACE * amplitude)) ** 2
        then = np.arctan2(state[4], state[3]) + state[5] * (swing.row - row)
        phases.append(np.arctan2(swing.state[4], swing.state[3]) - then)
    turned = np.exp(1j * np.array(phases))
    common = float(np.angle(turned.mean()))
    apart = np.angle(turned * np.exp(-1j * common))
    return float(total + np.sum((apart / PHASE) ** 2) + (common / COMMON) ** 2)
