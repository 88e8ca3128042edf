"""Traces of a film, row by row: the recipe.

Each way along the film and back leads from piece to piece; the pixels beforehand, and the rows' readings behind, are
any thread's work. Nothing but numbers a row is kept.

Traces found anew are known by amplitude, resting place and phase. Through a blackout the paper may have run fast or
slow, which shifts the phases of all traces alike, and the ship may have moved the slow part; what the pendulums keep
are their amplitudes and the phase between them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import dataclass, field, replace
from itertools import combinations, permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RefusedError
from pipeline.arrays import Floats, median_present
from pipeline.film.edits import Placed
from pipeline.film.emulsion import FilmEmulsion
from pipeline.film.marks.pieces import in_order
from pipeline.film.parts import Tracks
from pipeline.film.scan.opening import OpenScan
from pipeline.film.tracking.line_profile import Optics
from pipeline.film.tracking.outcome import MARGIN_SPOTS, flag_lost, read_both
from pipeline.film.tracking.pieces import Filter, Piece, run, run_again
from pipeline.film.tracking.probing import SURE, probe
from pipeline.film.tracking.section import Section, follow_from, read_section

NOTHING = (
    "no swinging trace found on the film: lines that turn at regular intervals are looked for, dark on light, with rows"
    " running along time; check the orientation and polarity of the scan, or give period and traces"
)
NEAR_PIECES, FAR_PIECES = 3, 8  # looked at from the film's start, and from there to the section that was probed
LEAD_SWINGS = 8.0  # before the first section, on which traces that were not found there may be followed
LEAST_READ = 0.15
STRANGE = 4.0
AMPLITUDE, PLACE, PHASE, COMMON = 0.06, 0.5, 0.25, 1.5  # 1 sigma: of the amplitude (twice), radians
AMBIGUOUS = 9.0  # how much worse the second best must be
WORST = 40.0
MOST_TRACES = 6
PIECE_SWINGS, SECTION_SWINGS = 4.0, 6.0
SOUND = 0.6  # share of rows read by which the last good row of a lost trace is told
LEAST_LINE = 0.5  # of a swing, from which a line that a person drew takes up a trace
LIT = 0.5  # of the usual light: what is fainter may be chance in the grain beyond the ends of the film
Progress = Callable[[int, int], None]
Last = list[tuple[float, Floats]]
"""Row and state at which each trace was read last."""


def silent(done: int) -> None:
    """Tell nobody how far the work is."""


@dataclass
class Film:
    """The film, and what is known of it as a whole."""

    scan: OpenScan
    emulsion: FilmEmulsion
    optics: Optics
    period: float
    edits: Placed | None = None
    lines: Floats | None = None  # (traces, rows), columns where a person says that traces run
    pieces: list[tuple[int, int]] = field(init=False)

    def __post_init__(self) -> None:
        height = int(np.clip(round(PIECE_SWINGS * self.period), 48, 2048))
        firsts = range(0, self.scan.rows, height)
        self.pieces = [(first, min(first + height, self.scan.rows)) for first in firsts]

    def darkness(self, first: int, stop: int) -> NDArray[np.float32]:
        """Rows `first` to `stop`, above blank film; NaN where nothing is to be read."""
        darkness = self.emulsion.darkness(self.scan.read(first, stop), first)
        return darkness if self.edits is None else self.edits.hide(darkness, first)

    def pixels(self, pieces: list[tuple[int, int]], jobs: int) -> Iterator[NDArray[np.float32]]:
        """The darkness of some pieces, in their order."""
        return in_order(lambda piece: self.darkness(*piece), pieces, jobs)


@dataclass
class Forward:
    """What the way along the film left: arrays (traces, rows); the filter before each piece, and where traces were."""

    place: Floats
    variance: Floats
    light: Floats
    followed: NDArray[np.uint8]
    checkpoints: dict[int, tuple[Filter, Last]]


@dataclass
class Following:
    """Traces followed along the film and back, and what it takes to follow a stretch of it once more."""

    film: Film
    section: Section
    ahead: Forward
    behind: dict[int, Filter]  # before each piece, on the way back
    tracks: Tracks
    misfit: NDArray[np.float32]

    @staticmethod
    def of(film: Film, section: Section) -> Following:
        """Nothing followed yet; the traces are those of a section."""
        place, variance, light = np.full((3, len(section.swings), film.scan.rows), [[[0.0]], [[np.inf]], [[np.nan]]])
        ahead = Forward(place, variance, light, np.zeros(place.shape, np.uint8), {})
        tracks = Tracks.empty(len(place), film.scan.rows, film.period, film.optics.spot)
        return Following(film, section, ahead, {}, tracks, np.full(place.shape, np.nan, np.float32))

    def all_along(self, progress: Callable[[int], None] = silent, jobs: int = 1) -> None:
        """Follow all traces over the whole film, both ways."""
        swings, pieces = self.section.swings, range(len(self.film.pieces))
        last = [(swing.row, swing.state) for swing in swings]
        self.forward(pieces, Filter.idle(len(swings), self.film.period), last, progress, jobs)
        self.backward(pieces, Filter.idle(len(swings), self.film.period), progress, jobs)

    def checked(self) -> Tracks:
        """The traces, where they can be trusted.

        Raises
        ------
        RefusedError
            Something else lies on a trace, one is hardly read, or two are one line.
        """
        for k, misfit in enumerate(self.misfit):
            _refuse_strangers(misfit, k)
        _refuse_unread(self.tracks)
        _refuse_doubles(self.tracks)
        return self.tracks

    def again(self, edits: Placed, jobs: int = 1) -> Following:
        """The same with the stretches that a person edited followed once more."""
        traces, rows = self.tracks.course.shape
        film = replace(self.film, edits=edits, lines=edits.courses(traces, rows))
        out = replace(self, film=film, ahead=deepcopy(self.ahead), tracks=deepcopy(self.tracks))
        out.misfit, out.behind = self.misfit.copy(), dict(self.behind)
        firsts = [first for first, _ in film.pieces]
        for first_row, last_row in edits.stretches(rows, film.period):
            first, last = np.searchsorted(firsts, [first_row, last_row], side="right").tolist()
            some = range(first - 1, last)
            out.tracks.forget(slice(firsts[first - 1], film.pieces[last - 1][1]))
            out.forward(some, *deepcopy(self.ahead.checkpoints[some[0]]), jobs=jobs)
            out.backward(some, deepcopy(self.behind[some[-1]]), jobs=jobs)
        edits.without_ignored(out.tracks)
        return out

    def forward(
        self, pieces: range, begun: Filter, last: Last, progress: Callable[[int], None] = silent, jobs: int = 1
    ) -> None:
        """Follow all traces along some pieces; what is lost is looked for again at the start of each."""
        film, out, section = self.film, self.ahead, self.section
        traces, spans = len(last), film.pieces[pieces.start : pieces.stop]
        for number, (first, stop), darkness in zip(pieces, spans, film.pixels(spans, jobs), strict=True):
            begins, part = np.full(traces, -1), slice(first, stop)
            if first >= section.first - (stop - first) and not begun.alive.all():
                _look_again(film, begun, begins, first, stop, section, last)
            lines = _lines(film, part)
            _take_up(begun, begins, lines, first, film.period)
            out.checkpoints[number] = deepcopy(begun), list(last)
            out.place[:, part], out.variance[:, part], out.followed[:, part] = 0.0, np.inf, 0
            out.light[:, part] = np.nan
            if begun.alive.any() or (begins >= 0).any():
                piece = run(begun, darkness, first, 1, film.optics, begins, lines)
                out.place[:, part], out.variance[:, part] = piece.place, piece.variance
                usual = np.array([[median_present(each)] for each in piece.brightness])
                light = np.where(np.isnan(piece.brightness), usual, piece.brightness)  # where nothing is to be read
                out.light[:, part] = np.where(piece.followed > 0, light, np.nan)
                out.followed[:, part] = piece.followed
                for k in range(traces):
                    good = np.flatnonzero(np.isfinite(piece.variance[k]))
                    if good.size:
                        last[k] = (first + good[-1] + 0.5, piece.states[good[-1], k].copy())
            progress(stop)

    def backward(self, pieces: range, begun: Filter, progress: Callable[[int], None] = silent, jobs: int = 1) -> None:
        """Follow all traces back, join both ways piece by piece, and read every row."""
        film = self.film

        def read(piece: tuple[Any, ...]) -> int:
            if len(piece) > 1:
                read_both(film.emulsion, film.optics, self.tracks, self.misfit, *piece)
            return int(piece[0])

        for first in in_order(read, self._followed_back(pieces, begun, jobs), jobs):
            progress(2 * film.scan.rows - first)
        some = slice(film.pieces[pieces.start][0], film.pieces[pieces.stop - 1][1])
        for position, course, qc in zip(self.tracks.position, self.tracks.course, self.tracks.qc, strict=True):
            flag_lost(position, course, qc, film.period, some)

    def _followed_back(self, pieces: range, begun: Filter, jobs: int) -> Iterator[tuple[Any, ...]]:
        """Follow all traces back and join both ways: the first row of each piece, and what its rows are read with."""
        film, ahead = self.film, self.ahead
        spans, margin = film.pieces[pieces.start : pieces.stop][::-1], 4 * round(MARGIN_SPOTS * film.optics.spot)
        for number, (first, stop), darkness in zip(pieces[::-1], spans, film.pixels(spans, jobs), strict=True):
            part = slice(first, stop)
            lines, known = _lines(film, part), deepcopy(ahead.checkpoints[number][0])
            kept = ahead.place[:, part], ahead.variance[:, part], ahead.followed[:, part]
            forth = run_again(known, *kept, film.optics, lines)
            self.behind[number] = deepcopy(begun)
            begins = _turn_back(begun, forth, ahead, first, stop, film.period)
            if not (begun.alive.any() or (begins >= 0).any() or forth.followed.any()):
                yield (first,)
                continue
            back = run(begun, darkness, first, -1, film.optics, begins, lines)
            alone = (ahead.followed[:, part] == 0) & (back.followed > 0)
            ahead.light[:, part][alone] = back.brightness[alone]
            low = max(0, first - margin)
            yield first, darkness, forth, back, first - low, ahead.light[:, low : stop + margin].copy()


def track(
    scan: OpenScan,
    emulsion: FilmEmulsion,
    *,
    count: int | None = None,
    jobs: int = 1,
    progress: Progress | None = None,
) -> Tracks:
    """Find the traces of a film, `count` if known, follow them both ways and read them row by row.

    Raises
    ------
    RefusedError
        Nothing swings on the film, fewer traces than were expected, or some that cannot be trusted.
    """
    return follow_traces(scan, emulsion, count=count, jobs=jobs, progress=progress).checked()


def follow_traces(
    scan: OpenScan,
    emulsion: FilmEmulsion,
    *,
    count: int | None = None,
    jobs: int = 1,
    progress: Progress | None = None,
) -> Following:
    """Find the traces of a film, and follow them both ways.

    Parameters
    ----------
    scan, emulsion
        Of `measure_emulsion`.
    count : int, optional
        Number of traces.
    jobs : int
        Threads that may work.
    progress : callable, optional
        Called with rows done and rows to do.

    Raises
    ------
    RefusedError
        Nothing swings on the film, or fewer traces than were expected.
    """
    given = Optics(emulsion.spot, 0.0, emulsion.curve, emulsion.grain) if emulsion.spot else None

    def darkness(first: int, stop: int) -> NDArray[np.float32]:
        return emulsion.darkness(scan.read(first, stop), first)

    probed = probe(darkness, scan.rows, float(np.sqrt(emulsion.grain[0])), count, given)
    if probed is None:
        raise RefusedError(NOTHING)
    section, optics = probed
    traces = len(section.swings)
    if count is not None and traces < count:
        raise RefusedError(
            f"{traces} of {count} traces stand out on the film: another is too faint, or lies on one of them; scan "
            "with more light, or say with --trace what swings on it"
        )
    film = Film(scan, emulsion, optics, section.period)
    tell = silent if progress is None else lambda done: progress(done, 2 * scan.rows)
    out = Following.of(film, _first_section(film, section))
    out.all_along(tell, jobs)
    return out


def _refuse_strangers(misfit: NDArray[np.float32], trace: int) -> None:
    """Refuse a film on which something else lies on a trace for most of its way."""
    known = misfit[np.isfinite(misfit)]
    usual = float(np.quantile(known, 0.75)) if known.size else 0.0
    if usual > STRANGE:
        raise RefusedError(
            f"trace {trace + 1} of the film does not look like one line: on a quarter of its rows the mean square"
            f" residual is over {usual:.1f} times the grain's, at most {STRANGE:g} is allowed; another trace may lie"
            " on it: give count, or cut the film where it can be read"
        )


def _refuse_unread(out: Tracks) -> None:
    """Refuse a film on which a trace was found but not read."""
    read = np.isfinite(out.position).mean(axis=1)
    if read.max() < LEAST_READ:
        raise RefusedError(NOTHING)
    worst = int(np.argmin(read))
    if read[worst] < LEAST_READ * read.max():
        raise RefusedError(
            f"trace {worst + 1} of the film was found but read on {100.0 * read[worst]:.0f} % of the rows only, the"
            f" best on {100.0 * read.max():.0f} %: scan again, cut the film where it can be read, or give count"
        )


def _refuse_doubles(out: Tracks) -> None:
    """Refuse a film on which two traces are read as one line for most of their way."""
    for b, a in combinations(range(len(out.course)), 2):
        away = np.abs(out.course[a] - out.course[b]) / np.sqrt(1.0 + out.slope[a] ** 2)
        away = away[np.isfinite(away)]
        if away.size and float(np.mean(away < out.spot)) > 0.5:
            raise RefusedError(
                f"traces {b + 1} and {a + 1} of the film lie on each other on more than half of the rows: give count,"
                " or cut the film where they lie apart"
            )


def _first_section(film: Film, probed: Section) -> Section:
    """The first section looked at on which all traces are found, with some rows before it on which they may begin."""
    ahead, traces = [first for first, _ in film.pieces if first < probed.first], len(probed.swings)
    section = probed
    for first in sorted({*ahead[:NEAR_PIECES], *ahead[:: max(1, len(ahead) // FAR_PIECES)]}):
        found = _section(film, first, first, traces)
        if found is not None and len(found.swings) == traces:
            section = found
            break
    first = max(0, section.first - round(LEAD_SWINGS * film.period))
    darkness = film.darkness(first, section.first + section.darkness.shape[0])
    begin = section.first + section.begin - first
    return follow_from(section.swings, darkness, first, begin, film.optics, 1.0) if first < section.first else section


def _section(film: Film, first: int, stop: int, traces: int) -> Section | None:
    """The traces found anew on the section that begins at a row and reaches to `stop` at least."""
    stop = min(film.scan.rows, max(stop, first + round(SECTION_SWINGS * film.period)))
    return read_section(film.darkness(first, stop), first, film.optics, film.period, traces, least=SURE)


def match(section: Section, last: list[tuple[float, Floats]]) -> list[int] | None:
    """Trace number of each swing of the section, None if it cannot be told; -1 for a swing that is none of them."""
    traces, names = len(section.swings), len(last)
    if max(traces, names) > MOST_TRACES:
        return None
    size = min(traces, names)
    cost = sorted(
        (_cost(section, chosen, named, last), chosen, named)
        for chosen in permutations(range(traces), size)
        for named in combinations(range(names), size)
    )
    if cost[0][0] > WORST * size or (len(cost) > 1 and cost[1][0] - cost[0][0] < AMBIGUOUS):
        return None
    result = [-1] * traces
    for place, name in zip(cost[0][1], cost[0][2], strict=True):
        result[place] = name
    return result


def _cost(section: Section, chosen: tuple[int, ...], names: tuple[int, ...], last: list[tuple[float, Floats]]) -> float:
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


def _look_again(
    film: Film, begun: Filter, begins: NDArray[np.int64], first: int, stop: int, first_section: Section,
    last: list[tuple[float, Floats]],
) -> None:  # fmt: skip
    """Find traces that are not being followed on this piece and what comes next, and tell which is which.

    Within the first section its own reading tells; beyond it traces are known by where and how they swung last.
    """
    if first < first_section.first + first_section.darkness.shape[0]:
        section: Section | None = first_section
        names: list[int] | None = list(range(len(last)))
    else:
        section = _section(film, first, stop, len(last))
        names = match(section, last) if section is not None else None
    if section is None or names is None:
        return
    for number, k in enumerate(names):
        if k < 0 or begun.alive[k]:
            continue
        light = section.brightness[number]
        usual = median_present(light)
        begin = _solid_from(light > LIT * usual, first - section.first, film.period)
        if begin is not None and section.first + begin < stop:
            begun.restart(k, section.states[begin, number], usual, alive=False)
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


def _lines(film: Film, part: slice) -> Floats | None:
    """The lines that traces follow on some rows, where a person says so."""
    lines = None if film.lines is None else np.ascontiguousarray(film.lines[:, part])
    return lines if lines is not None and np.isfinite(lines).any() else None


def _take_up(begun: Filter, begins: NDArray[np.int64], lines: Floats | None, first: int, period: float) -> None:
    """Take up traces that are not followed where a line of half a swing or more says how they run."""
    if lines is None:
        return
    for k in np.flatnonzero((begun.alive == 0) & (begins < 0)).tolist():
        rows = np.flatnonzero(np.isfinite(lines[k]))[: round(period)]
        if rows.size < LEAST_LINE * period:
            continue
        turn, away = 2.0 * np.pi / period, rows - rows[0]
        terms = np.stack([np.ones(rows.size), np.cos(turn * away), np.sin(turn * away)], axis=1)
        rest, cosine, sine = np.linalg.lstsq(terms, lines[k, rows], rcond=None)[0].tolist()
        begins[k] = rows[0]
        # the pair is amplitude times cosine and sine of the phase, which turns with the rows
        begun.restart(k, np.array([rest, 0.0, 0.0, cosine, -sine, turn]), alive=False)


def _turn_back(begun: Filter, forth: Piece, ahead: Forward, first: int, stop: int, period: float) -> NDArray[np.int64]:
    """Rows at which the way back takes up traces that it does not follow but the way along did."""
    begins = np.full(begun.alive.size, -1)
    half = max(4, round(0.5 * period))
    for k in np.flatnonzero((begun.alive == 0) & ahead.followed.any(axis=1)).tolist():
        low, light = max(0, first - half), ahead.light[k]
        read = np.isfinite(ahead.variance[k, low:stop]) & (light[low:stop] > LIT * median_present(light))
        behind = _solid_from(read[::-1], 0, period)
        if behind is not None and behind < stop - first:
            row = stop - 1 - behind
            lamp = median_present(light[max(0, row - half) : row + 1])
            begins[k] = row - first
            begun.restart(k, forth.states[begins[k], k], max(lamp, 0.02), alive=False)
    return begins
