"""A film whose traces were followed, and its time: as it lies, with a person's edits, and turned the right way."""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RecordError, RefusedError
from data_schemas.film_edits import FilmEdits
from pipeline.film.edits import NO_EDITS, Placed, check_scan, place
from pipeline.film.emulsion import FilmEmulsion, shown_darkness
from pipeline.film.knowledge import Known, film_scale
from pipeline.film.marks.alignment import bars, free_columns, light_across, swept
from pipeline.film.marks.axis import axis_of
from pipeline.film.marks.lines import NoMarksError, fitted, ticks
from pipeline.film.marks.numbering import TimeReversedError, shear_of_marks
from pipeline.film.marks.search import ROWS, GapSearch, find_gaps, over_pieces, search_gaps
from pipeline.film.parts import Emulsion, Floats, Marking, TimeAxis, Tracks
from pipeline.film.scan.opening import OpenScan, cause_in, lines_are_light
from pipeline.film.wander import exchanged

if TYPE_CHECKING:
    from pipeline.film.tracking.track import Following

SLOW = 25.0  # rows a second; below it the strokes of a swing lie a dozen rows apart, and the swing is a dense band
SWAYING = 20.0  # rows of a swing in which its sway is sought
ASKEW = 0.5  # rows by which one end of the slit may lag behind the other
Progress = Callable[[str, int, int], None]  # Told the stage, how much of it is done, and of how much


@dataclass(frozen=True)
class FilmTraces:
    """A film whose traces were followed and whose gaps were found: what edits begin from."""

    scan: OpenScan  # as it was read: turned, if it lay upside down
    emulsion: Emulsion
    tracks: Tracks
    following: "Following | None"  # what it takes to follow a stretch once more; None for dense bands
    film: FilmEmulsion  # that of the rows, also where `emulsion` is that of dense bands
    search: GapSearch | RefusedError | None  # gaps on the traces; None where marks lie beside them
    placed: Placed = NO_EDITS  # a person's edits

    def edited(self, edits: FilmEdits, known: Known, jobs: int = 1) -> "FilmTraces":
        """The same as edits make it; `RecordError`: they are another film's; `RefusedError`: it is too slow."""
        check_scan(edits, self.scan)
        placed = place(edits, self.scan, self.tracks, known.description.start_time)
        following, search, spans = self.following, self.search, []
        if following is None:
            if placed.lines:
                raise RefusedError("edits: the strokes of this film lie too close for a trace to be followed by hand")
            tracks = deepcopy(self.tracks)
            placed.without_ignored(tracks)
        else:
            following = following.again(placed, jobs)
            tracks = following.tracks
            stretches = placed.stretches(self.scan.rows, tracks.rows_per_swing)
            # in whole pieces, as all of the film was searched
            pieces = sorted({piece for first, last in stretches for piece in range(first // ROWS, last // ROWS + 1)})
            spans = [(piece * ROWS, min((piece + 1) * ROWS, self.scan.rows) - 1) for piece in pieces]
        if isinstance(search, GapSearch):
            gaps = search.gaps
            if spans:
                again, _ = find_gaps(self.scan, self.emulsion, tracks, search.width, jobs, spans)
                for first, last in spans:
                    gaps = gaps.pick((gaps.row < first) | (gaps.row >= last + 1))
                gaps = gaps.joined_by(again)
            search = search._replace(gaps=gaps.pick(placed.shows(gaps.trace, gaps.row, gaps.column)))
        return replace(self, tracks=tracks, following=following, search=search, placed=placed)

    def axis(self, known: Known, jobs: int = 1) -> TimeAxis:
        """When each row was exposed, by marks as described, else dark lines, gaps, the rest; raises as `axis_of`."""
        if self.following is not None:
            replace(self.following, tracks=self.tracks).checked()
        marking, search = known.marking(self.scan.scale, self.scan.directed), self.search
        if search is None:
            return self._axis_beside(_kind_of(marking, self.film), marking, jobs)
        try:
            if isinstance(search, RefusedError):
                raise search
            return axis_of(search, self.tracks, marking, self.placed.marks)
        except RefusedError as fault:
            if marking.kind == "gaps" or isinstance(fault, TimeReversedError):
                raise
            across = self.film.blank.across
            try:
                return self._axis_beside("edge" if across is None else across.kind, marking, jobs)
            except NoMarksError:
                raise fault from None

    def lie_upside_down(self, known: Known, axis: TimeAxis) -> bool:
        """Whether the traces are those of a film upside down: differences sway with the ship, and pendulums do not."""
        tracks = self.tracks
        some = slice(None, None, max(1, int(tracks.rows_per_swing / SWAYING)))
        try:
            traces, order, _ = known.as_described(tracks.course, film_scale(self.scan.scale, known.speed, axis)[0])
        except RecordError:  # said when the record is made
            return False
        sums = np.array([sum(each.combination.values()) for each in traces])
        rows = np.arange(tracks.course.shape[1], dtype=np.float64)[some]
        return exchanged(rows, tracks.course[order][:, some], sums, tracks.rows_per_swing)

    def _axis_beside(self, kind: str, marking: Marking, jobs: int) -> TimeAxis:
        """The time axis by marks of some kind beside the traces."""
        scan, tracks, lines = self.scan, self.tracks, self.film.blank.across
        if kind == "edge":
            lines = ticks(partial(shown_darkness, self.film, scan), scan.rows, free_columns(tracks, scan.columns))
        if lines is None:
            raise NoMarksError("film: no lines run across it; state another mark_kind")
        if not np.isfinite(tracks.position).any():
            raise RefusedError(
                "film: marks lie beside its traces, and swings as dense as these are read in gaps alone; "
                "scan a faster film, or read it with --reading continuous"
            )
        own = swept(tracks, scan.columns)

        def light(begin: int, stop: int, first: int, exposure: NDArray[np.float32]) -> Floats:
            return light_across(exposure[begin - first : stop - first], begin, own)

        shown = np.concatenate(over_pieces(scan, self.emulsion, light, jobs), axis=2)
        stood = bars(shown, own, tracks, self.emulsion)
        if kind != "edge":  # marks that were made while the paper stood lie on the bar, and hide its light
            stood = [found and [each._replace(saturated=True) for each in found] for found in stood]
        for row in sorted(each.row for found in stood for each in found or ()):
            tracks.named_over(row)
        return axis_of(GapSearch(fitted(lines), stood, 1.0, lines), tracks, marking, self.placed.marks)


def _kind_of(marking: Marking, film: FilmEmulsion) -> str:
    """Where marks are looked for first; see `Marking`. Which tone lines have, the film says: it may be a negative."""
    across = film.blank.across
    if marking.kind and (across is None or marking.kind in ("gaps", "edge", across.kind)):
        return marking.kind
    return "dark-lines" if across is not None and across.kind == "dark-lines" else "gaps"


def ways_to_follow(reading: str, speed: float | None) -> tuple[bool, ...]:
    """Whether traces are followed as dense bands, first and, if that is refused, second; `speed` in rows a second."""
    if reading == "continuous" or (speed is not None and speed >= SLOW):
        return (False,)
    return (True, False) if speed is not None else (False, True)


def find_time(
    scan: OpenScan, known: Known, edits: FilmEdits | None = None, jobs: int = 1, progress: Progress | None = None
) -> tuple[FilmTraces, TimeAxis | RefusedError]:
    """The film turned the right way, and its time or why that is refused; `RefusedError`: no trace can be followed."""
    _ = known.traces  # names that cannot be meant are told before any work
    if lines_are_light(scan.image) is None:
        raise RefusedError("no line stands out anywhere, the film is blank; scan it with more contrast")

    def timed(scan: OpenScan, dense: bool, turned: bool = False) -> tuple[FilmTraces | None, TimeAxis | RefusedError]:
        traces = None
        try:
            traces = follow_film(scan, known, dense, jobs, progress)
            traces = traces if edits is None else traces.edited(edits, known, jobs)
            axis = traces.axis(known, jobs)
            if "marks-direction-unknown" in axis.flags and traces.lie_upside_down(known, axis):
                raise TimeReversedError(
                    "film: the differences sway with the ship and the pendulums do not; check position and combination "
                    "of the described traces, and --orientation"
                )
            return traces, axis
        except RefusedError as fault:
            again = isinstance(fault, TimeReversedError) and not turned
            return timed(scan.upside_down(), dense, turned=True) if again else (traces, fault)

    faults: list[RefusedError] = []
    first: FilmTraces | None = None
    for dense in ways_to_follow(known.options.reading, known.marking(scan.scale).speed):
        traces, axis = timed(scan, dense)
        if isinstance(axis, RefusedError):
            faults.append(axis)
            first = first or traces
        elif traces is not None:
            return traces, axis
    cause = cause_in(scan)
    refusal = faults[0] if cause is None else RefusedError(f"{cause} ({faults[0]})")
    if first is None:
        raise refusal
    return first, refusal


def follow_film(scan: OpenScan, known: Known, dense: bool, jobs: int, progress: Progress | None) -> FilmTraces:
    """Traces of a film followed, as dense bands or row by row, and their gaps found; `RefusedError` without traces."""
    from pipeline.film.tracking.probing import measure_emulsion
    from pipeline.film.tracking.track import follow_traces

    if dense:
        return _follow_bands(scan, known, jobs)
    film = measure_emulsion(scan)
    told = None if progress is None else partial(progress, "traces")
    following = follow_traces(scan, film, count=known.count, jobs=jobs, progress=told)
    return _searched(FilmTraces(scan, film, following.tracks, following, film, None), known, jobs)


def _follow_bands(scan: OpenScan, known: Known, jobs: int) -> FilmTraces:
    """Traces of a slow film, set upright."""
    from pipeline.film.marks.dense import dense_emulsion, dense_tracks
    from pipeline.film.marks.survey import Saturated, lie_of

    lie, askew = lie_of(scan, known.count), 0.0
    while True:
        upright = scan.straightened(lie.lean, lie.shear + askew)
        film = dense_emulsion(upright, known.count)
        tracks = dense_tracks(upright, film, known.count)
        traces = _searched(FilmTraces(upright, Saturated(film), tracks, None, film, None), known, jobs)
        if askew or not any(lie) or not isinstance(traces.search, GapSearch):
            return traces
        askew = shear_of_marks(traces.search.gaps, len(tracks.course))  # marks show it better than swings
        if abs(askew) * scan.columns < ASKEW:
            return traces


def _searched(traces: FilmTraces, known: Known, jobs: int) -> FilmTraces:
    """The same with the gaps that its traces show, where these mark it."""
    marking = known.marking(traces.scan.scale)
    if _kind_of(marking, traces.film) != "gaps":
        return traces
    try:
        search: GapSearch | RefusedError = search_gaps(traces.scan, traces.emulsion, traces.tracks, marking, jobs)
    except RefusedError as fault:
        search = fault
    return replace(traces, search=search)
