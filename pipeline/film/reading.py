"""The reading of a film in one screen: emulsion, traces, time, places at the marks, samples."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from data_schemas.errors import RefusedError, UsageError
from data_schemas.film_edits import FilmEdits
from pipeline.film.following import SLOW, FilmTraces
from pipeline.film.knowledge import Known, film_scale
from pipeline.film.marks.search import GapSearch
from pipeline.film.normal_points import PhaseDifference, compare, normal_points
from pipeline.film.parts import Samples, Strobe, TimeAxis, Tracks
from pipeline.film.scan.opening import OpenScan

RATES = (10.0, 12.5, 20.0, 25.0)  # Hz
SAMPLES, SINGLE = 12.0, 24.0  # a swing; more say the same again, but a single trace's turns are fitted one by one
ROWS_PER_SAMPLE = 1.2  # fewer leave samples without a row
CLOSE, OFTEN, LEAST_AT_MARKS = 16.5, 1.9, 0.8  # spots between strokes; marks a swing; share of them that is read
BESIDE = 3.5  # spots from a mark, within which its gap takes light
LEAST_ACCEPTED = 0.5  # of the rows; a film of which less can be read between the marks is too slow for it
LEAST_READ = 0.25  # of the rows; less is no trace
SPEED_TOLERANCE = 0.03
MANY_MISSING, LONG_GAP = 0.1, 5.0  # share of the marks; s


@dataclass(frozen=True)
class Reading:
    """What was read of a film."""

    scan: OpenScan  # as it was read: turned, if it lay upside down
    tracks: Tracks
    axis: TimeAxis
    strobe: Strobe
    samples: Samples  # of the chosen reading
    kind: str  # the chosen reading: "continuous" or "strobe"
    scale: float  # mm, size of a pixel
    difference: PhaseDifference | None  # between the two readings, where both are there
    notes: tuple[str, ...]  # what was believed and might be wrong, one sentence each
    left_out: frozenset[int] = frozenset()  # traces that a person ignores
    edits: FilmEdits | None = None  # what a person corrected

    def between(self, start: float, stop: float) -> "Reading":
        """The same with the samples of a stretch of time alone, s; `UsageError` where there are none."""
        samples, inside = self.samples, (self.samples.time >= start) & (self.samples.time <= stop)
        if not inside.any():
            shown = " to ".join(f"{each:.1f}" for each in samples.time[[0, -1]])
            raise UsageError(f"nothing was read from {start:g} to {stop:g} s; the film shows {shown} s")
        return replace(self, samples=Samples(*(each[..., inside] for each in vars(samples).values())))

    @property
    def marks(self) -> NDArray[np.int64]:
        """Numbers of the marks that a trace shows: one too faint for the search is yet read where it is due."""
        return np.union1d(self.axis.index, self.strobe.index[np.isfinite(self.strobe.position).any(axis=0)])

    @property
    def flags(self) -> list[str]:
        """What to distrust: the axis's flags, marks that no trace shows, and readings that contradict each other."""
        marks, index = self.marks, self.axis.index
        raised = {
            "marks-many-missing": marks.size < (1.0 - MANY_MISSING) * (index[-1] - index[0] + 1),
            "marks-long-gap": bool((np.diff(marks) * self.axis.interval > LONG_GAP).any()),
            "readings-disagree": self.difference is not None and self.difference.contradicts,
        }
        return [*self.axis.flags, *(name for name, holds in raised.items() if holds)]

    @property
    def row_flags(self) -> NDArray[np.uint16]:
        """Flags of every row, (traces, rows); of a film read at the marks alone, those of the nearest mark."""
        axis, strobe, flags = self.axis, self.strobe, self.tracks.qc
        if self.kind != "strobe":
            return flags
        middles = np.interp(strobe.index[1:] - 0.5, axis.index, axis.row)
        nearest = np.searchsorted(middles, np.arange(flags.shape[1]))
        return np.where(np.isfinite(axis.seconds), strobe.qc[:, nearest], flags)


def read_traces(traces: FilmTraces, axis: TimeAxis, known: Known, jobs: int = 1) -> Reading:
    """The samples of a film; `RefusedError`: nothing of a trace was read; `RecordError`: no pixel size is known."""
    from pipeline.film.marks.strobe import read_at_marks

    scan, tracks, reading = traces.scan, traces.tracks, known.options.reading
    width = traces.search.width if isinstance(traces.search, GapSearch) else None
    strobe = traces.placed.readable(read_at_marks(scan, traces.emulsion, tracks, axis, width, jobs), axis)
    scale, note = film_scale(scan.scale, known.speed, axis)
    notes = [each for each in (*scan.notes, note) if each]
    speed = axis.rows_per_second * scale
    if known.speed is not None and abs(speed / known.speed - 1.0) > SPEED_TOLERANCE:
        axis = replace(axis, flags=(*axis.flags, "dpi-disagrees"))
        what = "check --dpi, --mark-interval and --speed"
        notes.append(f"the marks give {speed:.4g} mm/s, not {known.speed:g}; {what}")
    fast = axis.rows_per_second >= SLOW
    if reading == "auto":
        whole = fast and (axis.kind != "gaps" or accepted_fraction(tracks, axis) >= LEAST_ACCEPTED)
        reading = "continuous" if whole and not better_at_marks(tracks, axis, strobe) else "strobe"
    if close(tracks):
        tracks = clear_of_marks(tracks, axis)
    part = accepted_fraction(tracks, axis)
    if reading == "continuous" and part < LEAST_READ:
        raise RefusedError(
            f"film: only {100.0 * part:.0f} % of the rows could be read: its traces are lost or lie too close; scan "
            "it more finely, mask what disturbs (--edits), or read it at the marks alone (--reading strobe)"
        )
    samples, difference = at_marks(strobe, axis), None
    if np.isfinite(tracks.position).any():  # rows were read, too
        between = normal_points(tracks, axis, known.options.rate or _rate(tracks, axis))
        difference = compare(tracks, axis, between, strobe) if between.time.size and strobe.index.size else None
        samples = between if reading == "continuous" else samples
    unread = np.flatnonzero(~np.any(np.isfinite(samples.column), axis=1))
    if unread.size:
        which = "nothing of the film" if unread.size == len(samples.column) else f"nothing of trace {unread[0] + 1}"
        raise RefusedError(f"{which} could be read by the {reading} reading; look at it with isochrony plot")
    left_out, edits = traces.placed.left_out, traces.placed.edits
    return Reading(scan, tracks, axis, strobe, samples, reading, scale, difference, tuple(notes), left_out, edits)


def better_at_marks(tracks: Tracks, axis: TimeAxis, strobe: Strobe) -> bool:
    """Whether strokes lie so close that marks twice a swing tell more: beside gaps and turns rows are read badly."""
    often = tracks.rows_per_swing > OFTEN * axis.interval * axis.rows_per_second
    if not (often and close(tracks) and strobe.index.size):
        return False
    return float(np.isfinite(strobe.position).mean(axis=1).min()) >= LEAST_AT_MARKS


def close(tracks: Tracks) -> bool:
    """Whether the strokes of a swing lie so close that rows beside gaps are read badly."""
    return 0.5 * tracks.rows_per_swing < CLOSE * tracks.spot


def clear_of_marks(tracks: Tracks, axis: TimeAxis) -> Tracks:
    """The same without the rows that a gap takes light from; marks beside the traces take none."""
    if axis.kind != "gaps":
        return tracks
    position, rows = tracks.position.copy(), np.arange(tracks.position.shape[1]) + 0.5
    for own, found, offset in zip(position, axis.row_of_trace, axis.offset, strict=True):
        marks = np.sort(np.where(np.isfinite(found), found, axis.row + offset))
        nearest = marks[np.searchsorted(0.5 * (marks[1:] + marks[:-1]), rows)]
        own[np.abs(rows - nearest) < BESIDE * tracks.spot] = np.nan
    return replace(tracks, position=position)


def at_marks(strobe: Strobe, axis: TimeAxis) -> Samples:
    """The places at the marks as samples."""
    return Samples(np.asarray(strobe.index * axis.interval, dtype=np.float64), strobe.position, strobe.sigma, strobe.qc)


def accepted_fraction(tracks: Tracks, axis: TimeAxis) -> float:
    """Part of the rows within the marks' reach that was accepted, of all traces together."""
    timed = np.isfinite(axis.seconds)
    return float(np.isfinite(tracks.position[:, timed]).mean()) if timed.any() else 0.0


def _rate(tracks: Tracks, axis: TimeAxis) -> float:
    """The lowest usual rate of so many samples a swing, or the highest that leaves a row for every sample."""
    rows = axis.rows_per_second
    enough = (SINGLE if len(tracks.course) == 1 else SAMPLES) * rows / tracks.rows_per_swing
    rates = [rate for rate in RATES if rows >= ROWS_PER_SAMPLE * rate]
    return next((rate for rate in rates if rate >= enough), rates[-1] if rates else RATES[0])


def share_read(kind: str, accepted: float, missing: float) -> str:
    """How much was read, in words: of the rows or, at the marks alone, of the places there."""
    if kind == "strobe":
        return f"{100.0 * (1.0 - missing):.1f} % of the places at the marks read"
    return f"{100.0 * accepted:.1f} % of the rows read"
