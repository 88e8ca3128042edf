"""The reading of a film in one screen: emulsion, traces, time, places at the marks, samples."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from data_schemas.errors import RecordError, RefusedError, UsageError
from pipeline.film.comparing import PhaseDifference, compare
from pipeline.film.knowledge import Known
from pipeline.film.normal_points import Samples, normal_points
from pipeline.film.parts import Emulsion, Strobe, TimeAxis, Tracks
from pipeline.film.scan.opening import OpenScan, lines_are_light

if TYPE_CHECKING:
    from data_schemas.film_edits import FilmEdits
    from pipeline.film.edits import Placed
    from pipeline.film.emulsion import FilmEmulsion
    from pipeline.film.marks.axis import GapSearch
    from pipeline.film.tracking.track import Following

_MM_PER_INCH = 25.4
Progress = Callable[[str, int, int], None]
"""Told the stage, how much of it is done, and of how much."""

READINGS = ("auto", "continuous", "strobe")
RATES = (10.0, 12.5, 20.0, 25.0)  # Hz
SAMPLES, SINGLE = 12.0, 24.0  # a swing; more say the same again, but a single trace's turns are fitted one by one
_ROWS_PER_SAMPLE = 1.2  # fewer leave samples without a row
SLOW = 25.0  # rows a second; below it the strokes of a swing lie a dozen rows apart, and the swing is a dense band
_LEAST_ACCEPTED = 0.5  # of the rows; a film of which less can be read between the marks is too slow for it
_SPEED_TOLERANCE = 0.03


@dataclass(frozen=True)
class Reading:
    """What was read of a film.

    Attributes
    ----------
    scan : OpenScan
        As it was read: turned, if it lay upside down.
    tracks : Tracks
    axis : TimeAxis
    strobe : Strobe
    samples : Samples
        Of the chosen reading.
    kind : str
        The chosen reading: "continuous" or "strobe".
    scale : float
        Size of a pixel, mm.
    difference : PhaseDifference or None
        Between the two readings, where both are there.
    notes : tuple of str
        What was believed and might be wrong, one sentence each.
    left_out : tuple of int
        Traces that a person ignores.
    edits : FilmEdits or None
        What a person corrected.
    """

    scan: OpenScan
    tracks: Tracks
    axis: TimeAxis
    strobe: Strobe
    samples: Samples
    kind: str
    scale: float
    difference: PhaseDifference | None
    notes: tuple[str, ...]
    left_out: tuple[int, ...] = ()
    edits: FilmEdits | None = None

    def between(self, start: float, stop: float) -> Reading:
        """The same with the samples of a stretch of time alone, s.

        Raises
        ------
        UsageError
            There are none.
        """
        samples, inside = self.samples, (self.samples.time >= start) & (self.samples.time <= stop)
        if not inside.any():
            shown = " to ".join(f"{each:.1f}" for each in samples.time[[0, -1]])
            raise UsageError(f"nothing was read from {start:g} to {stop:g} s; the film shows {shown} s")
        time, column, sigma = samples.time[inside], samples.column[:, inside], samples.sigma[:, inside]
        return replace(self, samples=Samples(time, column, sigma, samples.qc[:, inside]))


@dataclass(frozen=True)
class FilmTraces:
    """A film whose traces were followed and whose gaps were found: what edits begin from.

    Attributes
    ----------
    scan : OpenScan
        As it was read: turned, if it lay upside down.
    emulsion : Emulsion
    tracks : Tracks
    following : Following or None
        What it takes to follow a stretch once more; None for dense bands.
    film : FilmEmulsion
        That of the rows, also where `emulsion` is that of dense bands.
    found : GapSearch or RefusedError or None
        Gaps on the traces; None where marks lie beside them.
    left_out : tuple of int
        Traces that a person ignores on the whole film.
    edits : FilmEdits or None
    placed : Placed or None
        The same in the reader's terms.
    """

    scan: OpenScan
    emulsion: Emulsion
    tracks: Tracks
    following: Following | None
    film: FilmEmulsion
    found: GapSearch | RefusedError | None
    left_out: tuple[int, ...] = ()
    edits: FilmEdits | None = None
    placed: Placed | None = None

    def edited(self, edits: FilmEdits, known: Known, jobs: int = 1) -> FilmTraces:
        """The same as a person's edits make it.

        Raises
        ------
        RecordError
            They are of another scan, lie outside it, or name a trace that is not there.
        RefusedError
            A trace is to be followed on a film that is too slow for it.
        """
        from pipeline.film.edits import check_scan, place
        from pipeline.film.marks.pieces import ROWS
        from pipeline.film.marks.search import find_gaps

        check_scan(edits, self.scan)
        placed = place(edits, self.scan, self.tracks, known.start_time)
        following = self.following
        if self.following is None:
            if placed.lines:
                raise RefusedError("edits: the strokes of this film lie too close for a trace to be followed by hand")
            tracks = deepcopy(self.tracks)
            placed.without_ignored(tracks)
        else:
            following = self.following.again(placed, jobs)
            tracks = _beside_lines(following.tracks, self.film)
        found, spans = self.found, []
        if self.following is not None:  # in whole pieces, as all of the film was searched
            stretches = placed.stretches(self.scan.rows, tracks.rows_per_swing)
            pieces = sorted({piece for first, last in stretches for piece in range(first // ROWS, last // ROWS + 1)})
            spans = [(piece * ROWS, min((piece + 1) * ROWS, self.scan.rows) - 1) for piece in pieces]
        if not isinstance(found, RefusedError | None):
            gaps = found.gaps
            if spans:
                again, _ = find_gaps(self.scan, self.emulsion, tracks, found.width, jobs, spans)
                old = np.all([(gaps.row < first) | (gaps.row >= last + 1) for first, last in spans], axis=0)
                gaps = gaps.pick(old).joined_by(again)
            found = found._replace(gaps=gaps.pick(placed.shows(gaps.trace, gaps.row, gaps.column)))
        left_out = placed.left_out(self.scan.rows)
        return replace(
            self, tracks=tracks, following=following, found=found, left_out=left_out, edits=edits, placed=placed
        )

    def axis(self, known: Known, jobs: int = 1) -> TimeAxis:
        """When each row of a film was exposed; raises as `marks.axis.time_axis`."""
        from pipeline.film.marks.axis import time_axis

        if self.following is not None:
            replace(self.following, tracks=self.tracks).checked()
        marking = known.marking(self.scan.scale, self.scan.directed)
        marks = None if self.placed is None else self.placed.marks
        return time_axis(self.scan, self.emulsion, self.tracks, marking, jobs, self.film, self.found, marks)


def read_film(
    scan: OpenScan,
    known: Known,
    *,
    reading: str = "auto",
    rate: float | None = None,
    edits: FilmEdits | None = None,
    jobs: int = 1,
    progress: Progress | None = None,
) -> Reading:
    """Read a film.

    Parameters
    ----------
    scan : OpenScan
    known : Known
        What is known of the film; nothing need be.
    reading : {"auto", "continuous", "strobe"}
        Between the marks, or at the marks alone; auto takes the first where the film is fast enough.
    rate : float, optional
        Samples a second between the marks; the highest of 25, 20, 12.5 and 10 that the film's rows support.
    edits : FilmEdits, optional
        What a person corrects.
    jobs : int
        Processor cores to use.
    progress : function, optional
        Told the stage and how far it is.

    Raises
    ------
    RefusedError
        The film shows no trace, or no time, that can be trusted.
    RecordError
        Nothing says how large a pixel is, or the edits are none of this film.
    """
    traces, axis = find_time(scan, known, reading, edits, jobs, progress)
    if isinstance(axis, RefusedError):
        raise axis
    return read_traces(traces, axis, known, reading=reading, rate=rate, jobs=jobs)


def read_traces(
    traces: FilmTraces, axis: TimeAxis, known: Known, *, reading: str = "auto", rate: float | None = None, jobs: int = 1
) -> Reading:
    """The samples of a film whose traces and time are known; parameters and faults as of `read_film`."""
    from pipeline.film.strobe.reading import read_at_marks

    scan, tracks = traces.scan, traces.tracks
    strobe = read_at_marks(scan, traces.emulsion, tracks, axis, jobs)
    strobe = strobe if traces.placed is None else traces.placed.readable(strobe, axis)
    scale, note = film_scale(scan.scale, known.speed, axis)
    disagrees = _disagreement(axis, scale, known.speed)
    if disagrees:
        axis = replace(axis, flags=(*axis.flags, "dpi-disagrees"))
    notes = [each for each in (*scan.notes, note, disagrees) if each]
    kind = _choose(reading, tracks, axis)
    samples, difference = at_marks(strobe, axis), None
    if np.isfinite(tracks.position).any():  # rows were read, too
        between = normal_points(tracks, axis, rate or _rate(tracks, axis))
        difference = compare(tracks, axis, between, strobe) if between.time.size and strobe.index.size else None
        samples = between if kind == "continuous" else samples
    unread = np.flatnonzero(~np.any(np.isfinite(samples.column), axis=1))
    if unread.size:
        which = "nothing of the film" if unread.size == len(samples.column) else f"nothing of trace {unread[0] + 1}"
        raise RefusedError(f"{which} could be read by the {kind} reading; look at it with isochrony plot")
    return Reading(
        scan, tracks, axis, strobe, samples, kind, scale, difference, tuple(notes), traces.left_out, traces.edits
    )


def ways_to_follow(reading: str, speed: float | None) -> tuple[bool, ...]:
    """Whether traces are followed as dense bands, first and, where that is refused, second; `speed` in rows a second.

    Examples
    --------
    >>> ways_to_follow("auto", 17.7), ways_to_follow("continuous", 17.7), ways_to_follow("auto", 59.1)
    ((True, False), (False,), (False,))
    """
    if reading == "continuous" or (speed is not None and speed >= SLOW):
        return (False,)
    return (True, False) if speed is not None else (False, True)


def find_time(
    scan: OpenScan,
    known: Known,
    reading: str = "auto",
    edits: FilmEdits | None = None,
    jobs: int = 1,
    progress: Progress | None = None,
) -> tuple[FilmTraces, TimeAxis | RefusedError]:
    """The film turned the right way with its traces, and its time or why that is refused; as of `read_film`.

    Raises
    ------
    RefusedError
        No trace can be followed.
    """
    from pipeline.film.marks.minutes import TimeReversedError
    from pipeline.film.scan.opening import cause_in

    _ = known.traces  # names that cannot be meant are told before any work
    if lines_are_light(scan.image) is None:
        raise RefusedError("no line stands out anywhere, the film is blank; scan it with more contrast")

    def timed(traces: FilmTraces) -> tuple[FilmTraces, TimeAxis | RefusedError]:
        try:
            traces = traces if edits is None else traces.edited(edits, known, jobs)
            return traces, traces.axis(known, jobs)
        except TimeReversedError:
            raise
        except RefusedError as fault:
            return traces, fault

    faults: list[RefusedError] = []
    first: FilmTraces | None = None
    for dense in ways_to_follow(reading, known.marking(scan.scale, scan.directed).speed):
        try:
            try:
                traces, axis = timed(follow_film(scan, known, dense, jobs, progress))
            except TimeReversedError:
                traces, axis = timed(follow_film(scan.upside_down(), known, dense, jobs, progress))
        except RefusedError as fault:
            faults.append(fault)
            continue
        if not isinstance(axis, RefusedError):
            return traces, axis
        faults.append(axis)
        first = first or traces
    cause = cause_in(scan)
    refusal = faults[0] if cause is None else RefusedError(f"{cause} ({faults[0]})")
    if first is None:
        raise refusal
    return first, refusal


def follow_film(scan: OpenScan, known: Known, dense: bool, jobs: int, progress: Progress | None) -> FilmTraces:
    """Traces of a film followed, as dense bands or row by row, and their gaps found.

    Raises
    ------
    RefusedError
        There are none.
    """
    from pipeline.film.marks.axis import kind_of, search_gaps
    from pipeline.film.strobe.dense import dense_emulsion, dense_tracks
    from pipeline.film.strobe.dense_survey import Saturated
    from pipeline.film.tracking.probing import measure_emulsion
    from pipeline.film.tracking.track import follow_traces

    following: Following | None = None
    emulsion: Emulsion
    if dense:
        film = dense_emulsion(scan, known.count)
        tracks, emulsion = dense_tracks(scan, film, known.count), Saturated.of(film)
    else:
        emulsion = film = measure_emulsion(scan)
        following = follow_traces(scan, film, count=known.count, jobs=jobs, progress=_stage(progress, "traces"))
        tracks = _beside_lines(following.tracks, film)
    marking = known.marking(scan.scale, scan.directed)
    found: GapSearch | RefusedError | None = None
    if kind_of(marking, film) == "gaps":
        try:
            found = search_gaps(scan, emulsion, tracks, marking, jobs)
        except RefusedError as fault:
            found = fault
    return FilmTraces(scan, emulsion, tracks, following, film, found)


def _beside_lines(tracks: Tracks, film: FilmEmulsion) -> Tracks:
    """Traces but for the rows on which lines across the film hide them."""
    from pipeline.film.marks.lines import hide

    return tracks if film.blank.across is None else hide(tracks, film.blank.across)


def _stage(progress: Progress | None, stage: str) -> Callable[[int, int], None] | None:
    """The progress of one stage."""
    return None if progress is None else lambda done, total: progress(stage, done, total)


def at_marks(strobe: Strobe, axis: TimeAxis) -> Samples:
    """The places at the marks as samples."""
    return Samples(np.asarray(strobe.index * axis.interval, dtype=np.float64), strobe.position, strobe.sigma, strobe.qc)


def accepted_fraction(tracks: Tracks, axis: TimeAxis) -> float:
    """Part of the rows within the marks' reach that was accepted, of all traces together."""
    timed = np.isfinite(axis.seconds)
    return float(np.isfinite(tracks.position[:, timed]).mean()) if timed.any() else 0.0


def _rate(tracks: Tracks, axis: TimeAxis) -> float:
    """The lowest usual rate of so many samples a swing, or the highest that leaves a row for every sample."""
    rows = rows_per_second(axis)
    enough = (SINGLE if len(tracks.course) == 1 else SAMPLES) * rows / tracks.rows_per_swing
    rates = [rate for rate in RATES if rows >= _ROWS_PER_SAMPLE * rate]
    return next((rate for rate in rates if rate >= enough), rates[-1] if rates else RATES[0])


def _choose(reading: str, tracks: Tracks, axis: TimeAxis) -> str:
    if reading != "auto":
        return reading
    fast = rows_per_second(axis) >= SLOW
    return (
        "continuous"
        if fast and (axis.kind != "gaps" or accepted_fraction(tracks, axis) >= _LEAST_ACCEPTED)
        else "strobe"
    )


def scale_error(reading: Reading, nominal: float | None) -> float | None:
    """By how much, relative, all elongations may be wrong where marks, dpi and nominal speed contradict each other."""
    if "dpi-disagrees" not in reading.axis.flags or nominal is None:
        return None
    return abs(_usual_speed(reading.axis) * reading.scale / nominal - 1.0)


def _disagreement(axis: TimeAxis, scale: float, nominal: float | None) -> str | None:
    """A warning where the marks contradict the nominal speed: dpi or mark interval may be another."""
    speed = _usual_speed(axis) * scale
    if nominal is None or not abs(speed / nominal - 1.0) > _SPEED_TOLERANCE:
        return None
    return f"the marks give {speed:.4g} mm/s, not {nominal:g}; check --dpi, --mark-interval and --speed"


def _usual_speed(axis: TimeAxis) -> float:
    """Rows a second from mark to mark, the median: where the paper stood does not count; NaN without two marks."""
    steps = np.diff(axis.row) / np.diff(axis.index)
    return float(np.median(steps)) / axis.interval if steps.size else float("nan")


def rows_per_second(axis: TimeAxis) -> float:
    """Mean speed of the film, from the marks; NaN without two."""
    if axis.index.size < 2:
        return float("nan")
    return float((axis.row[-1] - axis.row[0]) / ((axis.index[-1] - axis.index[0]) * axis.interval))


def film_scale(stated: float | None, speed: float | None, axis: TimeAxis) -> tuple[float, str | None]:
    """Size of a pixel, mm, and what had to be believed for it.

    Parameters
    ----------
    stated : float or None
        As the user or the file says, mm.
    speed : float or None
        Nominal speed of the film, mm s-1.

    Raises
    ------
    RecordError
        Neither is known: elongations would have no scale.
    """
    if stated is not None:
        return stated, None
    rate = rows_per_second(axis)
    if speed is None or not np.isfinite(rate):
        raise RecordError("the image says no resolution, which elongations need; give --dpi, or the film's --speed")
    dpi = _MM_PER_INCH * rate / speed
    return speed / rate, f"the image says no resolution; the marks at {speed:g} mm/s give {dpi:.4g} dpi"
