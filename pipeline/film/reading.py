"""The reading of a film in one screen: emulsion, traces, time, places at the marks, samples."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from data_schemas.errors import RecordError, RefusedError
from pipeline.film.comparing import PhaseDifference, compare
from pipeline.film.knowledge import Known
from pipeline.film.normal_points import Samples, normal_points
from pipeline.film.parts import Emulsion, Strobe, TimeAxis, Tracks
from pipeline.film.scan.opening import OpenScan, lines_are_light

_MM_PER_INCH = 25.4
Progress = Callable[[str, int, int], None]
"""Told the stage, how much of it is done, and of how much."""

READINGS = ("auto", "continuous", "strobe")
RATES = (25.0, 20.0, 12.5, 10.0)  # Hz; more than eight samples a swing
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


def read_film(
    scan: OpenScan,
    known: Known,
    *,
    reading: str = "auto",
    rate: float | None = None,
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
    jobs : int
        Processor cores to use.
    progress : function, optional
        Told the stage and how far it is.

    Raises
    ------
    RefusedError
        The film shows no trace, or no time, that can be trusted.
    RecordError
        Nothing says how large a pixel is.
    """
    from pipeline.film.strobe.reading import read_at_marks

    scan, emulsion, tracks, axis = _read_time(scan, known, reading, jobs, progress)
    strobe = read_at_marks(scan, emulsion, tracks, axis, jobs)
    scale, note = film_scale(scan.scale, known.speed, axis)
    disagrees = _disagreement(axis, scale, known.speed)
    if disagrees:
        axis = replace(axis, flags=(*axis.flags, "dpi-disagrees"))
    notes = [each for each in (*scan.notes, note, disagrees) if each]
    kind = _choose(reading, tracks, axis)
    samples, difference = at_marks(strobe, axis), None
    if np.isfinite(tracks.position).any():  # rows were read, too
        between = normal_points(tracks, axis, rate or _rate(axis))
        difference = compare(tracks, axis, between, strobe) if between.time.size and strobe.index.size else None
        samples = between if kind == "continuous" else samples
    unread = np.flatnonzero(~np.any(np.isfinite(samples.column), axis=1))
    if unread.size:
        which = "nothing of the film" if unread.size == len(samples.column) else f"nothing of trace {unread[0] + 1}"
        raise RefusedError(f"{which} could be read by the {kind} reading; look at it with isochrony plot")
    return Reading(scan, tracks, axis, strobe, samples, kind, scale, difference, tuple(notes))


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


def _read_time(
    scan: OpenScan, known: Known, reading: str, jobs: int, progress: Progress | None
) -> tuple[OpenScan, Emulsion, Tracks, TimeAxis]:
    """The film turned the right way, its emulsion, traces and time."""
    from pipeline.film.marks.axis import time_axis
    from pipeline.film.marks.lines import hide
    from pipeline.film.marks.minutes import TimeReversedError
    from pipeline.film.scan.cause import cause_in
    from pipeline.film.strobe.dense import dense_emulsion, dense_tracks
    from pipeline.film.strobe.dense_survey import Saturated
    from pipeline.film.tracking.probing import measure_emulsion
    from pipeline.film.tracking.track import track

    count, marking = known.count, known.marking(scan.scale, scan.directed)
    if lines_are_light(scan.image) is None:
        raise RefusedError("no line stands out anywhere, the film is blank; scan it with more contrast")

    def followed(scan: OpenScan, dense: bool) -> tuple[OpenScan, Emulsion, Tracks, TimeAxis]:
        if dense:
            emulsion = dense_emulsion(scan, count)
            tracks = dense_tracks(scan, emulsion, count)
            sure = Saturated.of(emulsion)
            return scan, sure, tracks, time_axis(scan, sure, tracks, marking, jobs, emulsion)
        emulsion = measure_emulsion(scan)
        tracks = track(scan, emulsion, count=count, jobs=jobs, progress=_stage(progress, "traces"))
        if emulsion.blank.across is not None:
            tracks = hide(tracks, emulsion.blank.across)
        return scan, emulsion, tracks, time_axis(scan, emulsion, tracks, marking, jobs, emulsion)

    faults = []
    for dense in ways_to_follow(reading, marking.speed):
        try:
            return followed(scan, dense)
        except TimeReversedError:
            return followed(scan.upside_down(), dense)
        except RefusedError as fault:
            faults.append(fault)
    cause = cause_in(scan)
    raise faults[0] if cause is None else RefusedError(f"{cause} ({faults[0]})")


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


def _rate(axis: TimeAxis) -> float:
    """The highest usual rate that leaves a row for every sample."""
    rows = rows_per_second(axis)
    return next((rate for rate in RATES if rows >= _ROWS_PER_SAMPLE * rate), RATES[-1])


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
