"""What was read of a film becomes a record of the contract: angles, uncertainty, flags, and where they come from."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import permutations
from typing import TYPE_CHECKING, Any

import numpy as np

from data_schemas.contents import identifier
from data_schemas.errors import RecordError
from data_schemas.film_description import DescribedTrace, FilmDescription
from data_schemas.layouts import CONVENTIONS, VERSION
from data_schemas.variables import attributes, dataset
from data_schemas.variables_record import ELONGATION_FLAGS
from pipeline.film.comparing import clock_uncertainty
from pipeline.film.instrument import instrument_of
from pipeline.film.knowledge import Known, default_traces
from pipeline.film.marks.checks import marks_flags, marks_seen
from pipeline.film.parts import Floats, TimeAxis
from pipeline.film.reading import Reading, accepted_fraction, rows_per_second, scale_error
from pipeline.film.wander import paper_motion

if TYPE_CHECKING:
    import xarray as xr

_MOST_TRACES = 7
_FACTOR = 5.0  # mm: a swing wrong by a factor of e counts as a place wrong by this
AMBIGUOUS, LOST = (np.uint16(ELONGATION_FLAGS[name]) for name in ("ambiguous", "lost"))


def make_record(reading: Reading, known: Known, name: str) -> xr.DataTree:
    """Turn a reading into a record.

    Parameters
    ----------
    reading : Reading
    known : Known
        Names the traces and states the instrument.
    name : str
        Identifier where the description gives none.

    Returns
    -------
    DataTree
        A record. Elongations count from each trace's mean place, as the film shows no vertical.

    Raises
    ------
    RecordError
        The traces found are not those described.
    UsageError
        Several traces, but no periods or no gravity at which they hold.
    """
    import xarray as xr

    traces = known.traces or default_traces(reading.samples.column.shape[0])
    rest, swing = places(reading)
    order = match(traces, rest * reading.scale, swing * reading.scale)
    kept = [k for k, found in enumerate(order) if found not in reading.left_out]
    traces, order = tuple(traces[k] for k in kept), [order[k] for k in kept]
    lever = np.array([known.lever(trace) for trace in traces])
    radians = reading.scale / lever[:, None]
    pendulums = known.pendulums(traces)
    labels = [str(each.label) for each in pendulums]
    combination = np.array([[trace.combination.get(label, 0.0) for label in labels] for trace in traces])
    column, period = reading.samples.column[order], reading.tracks.rows_per_swing / rows_per_second(reading.axis)
    paper = paper_motion(reading.samples.time, column, combination.sum(axis=1), period)
    if paper is not None:
        column = np.where(paper.creased, np.nan, column - paper.shift)
    doubtful = np.zeros(reading.samples.time.size)
    for first, last, by in reading.axis.doubts:
        doubtful[(reading.samples.time >= first) & (reading.samples.time <= last)] = by
    groups = {
        "/": _root(reading, known, name),
        "/record": dataset(
            "record",
            {
                "combination": combination,
                "elongation": (column - rest[order, None]) * radians,
                "elongation_uncertainty": reading.samples.sigma[order] * radians,
                "elongation_qc": reading.samples.qc[order]
                | np.where(doubtful > 0.0, AMBIGUOUS, np.uint16(0))
                | np.where(paper is not None and paper.creased, LOST, np.uint16(0)),
                "time_uncertainty": np.hypot(doubtful, 0.0 if reading.kind == "strobe" else time_sigma(reading.axis)),
            },
            {"trace": [trace.name for trace in traces], "pendulum": labels},
        ),
        "/film": _film(reading, known, traces, lever, rest, order),
    }
    if paper is not None:
        attrs = groups["/film"].attrs
        attrs["flags"] = ", ".join([*filter(None, [attrs["flags"]]), "paper-wandered"])
        attrs["paper_wander"] = float(np.std(paper.shift)) * reading.scale  # mm
        attrs["paper_steps"], attrs["paper_creases"] = paper.steps, paper.creases
    instrument = instrument_of(
        known,
        pendulums,
        reading.samples.time,
        _rate_uncertainty(reading),
        scale_error(reading, known.speed),
        needed=len(traces) > 1,
    )
    if instrument is not None:
        groups["/instrument"] = instrument
    return xr.DataTree.from_dict(groups)


def places(reading: Reading) -> tuple[Floats, Floats]:
    """Mean column of each trace, and amplitude of its swing, (traces,) px."""
    columns = reading.samples.column
    empty = ~np.any(np.isfinite(columns), axis=1, keepdims=True)
    filled = np.where(empty, 0.0, columns)
    return np.nanmean(filled, axis=1), np.sqrt(2.0) * np.nanstd(filled, axis=1)


def _root(reading: Reading, known: Known, name: str) -> xr.Dataset:
    import xarray as xr

    description = known.description
    start = known.start_time
    files = ", ".join(path.name for path in reading.scan.paths)
    time = {**attributes("time"), "units": f"seconds since {start}"}
    return xr.Dataset(
        coords={"time": ("time", reading.samples.time, time)},
        attrs={
            "Conventions": CONVENTIONS,
            "schema": "isochrony-record",
            "schema_version": VERSION,
            "record_id": identifier(_stated(description, "record_id") or name),
            "title": _stated(description, "title") or f"pendulum record read from {files}",
            "history": f"read by isochrony from {files}: {reading.kind} reading",
            "source": f"{files}; seconds count from a full minute of the chronometer, which one the film does not say",
        },
    )


def _stated(description: FilmDescription | None, name: str) -> str:
    stated = description is not None and name in description.model_fields_set
    return str(getattr(description, name)) if stated else ""


def _film(
    reading: Reading,
    known: Known,
    traces: Sequence[DescribedTrace],
    lever: Floats,
    rest: Floats,
    order: list[int],
) -> xr.Dataset:
    gap = known.marking(None).gap
    values = {
        "optical_lever": lever,
        "speed": rows_per_second(reading.axis) * reading.scale,
        "mark_interval": reading.axis.interval,
        "gap": gap,
        "scale": reading.scale,
        "source_file": ", ".join(path.name for path in reading.scan.paths),
        "source_sha256": ", ".join(reading.scan.sha256),
    }
    film = dataset(
        "film",
        {name: value for name, value in values.items() if value is not None},
        {"trace": [trace.name for trace in traces]},
    )
    offset = reading.axis.offset[order]
    film.attrs = {
        **findings(reading),
        "trace_offset": (offset - offset[0]) * reading.scale,
        "resting_column": rest[order],
        "assumed": "; ".join(known.assumptions(traces)),
    }
    return film


def findings(reading: Reading) -> dict[str, Any]:
    """What a reader of the record should know of the reading, as attributes of /film."""
    axis = reading.axis
    found: dict[str, Any] = {
        "reading": reading.kind,
        "elongation_zero": "mean place of each trace on the film; its place under the vertical is not known",
        "accepted_fraction": accepted_fraction(reading.tracks, axis),
        "marks_found": int(marks_seen(axis, reading.strobe).size),
        "skew": float(np.degrees(np.arctan(axis.shear))),
        "time_sigma": time_sigma(axis),
        "time_noise": 0.0 if reading.kind == "strobe" else axis.mark_sigma * float(np.sqrt(axis.interval)),
        # at the marks the times are exact
        "time_rate_sigma": 0.0 if reading.kind == "strobe" else axis.rate_sigma,
        "flags": ", ".join(flags(reading)),
        "notes": "; ".join(reading.notes),
    }
    if reading.edits is not None:
        found["edits"] = reading.edits.text()
    if reading.difference is not None:
        difference = reading.difference
        found["reading_difference_start"] = difference.start
        found["reading_difference_disagrees"] = difference.disagree.any(axis=0).astype(np.uint8)
    return found


def flags(reading: Reading) -> list[str]:
    """What to distrust: the marks, and readings that contradict each other."""
    found = list(marks_flags(reading.axis, reading.strobe))
    if reading.difference is not None and reading.difference.contradicts:
        found.append("readings-disagree")
    return found


def _rate_uncertainty(reading: Reading) -> float | None:
    """By how much the film's time axis may run wrong, s a day; None at the marks alone, whose times are exact."""
    if reading.kind == "strobe":
        return None
    relative = None
    if reading.difference is not None:
        relative = clock_uncertainty(reading.difference, reading.tracks.rows_per_swing / rows_per_second(reading.axis))
    return 86400.0 * max(marks_rate(reading.axis), relative or 0.0)


def marks_rate(axis: TimeAxis) -> float:
    """Relative 1 sigma of the rate of a line through all marks: what their noise leaves, however smooth the paper."""
    length = float(np.nanmax(axis.seconds) - np.nanmin(axis.seconds))
    return axis.mark_sigma * float(np.sqrt(12.0 * axis.interval / length)) / length


def time_sigma(axis: TimeAxis) -> float:
    """R.m.s. of the stated uncertainty of the rows' times, s; NaN where no row has a time."""
    timed = np.isfinite(axis.seconds)
    return float(np.sqrt(np.mean(axis.seconds_sigma[timed] ** 2))) if timed.any() else float("nan")


def match(described: Sequence[DescribedTrace], rest: Floats, swing: Floats) -> list[int]:
    """For each described trace, the number of the one found.

    Without a place for each, traces are described as they lie from the left to the right. The scan need not begin at
    the paper's edge: a shift common to all places does not count.

    Parameters
    ----------
    described : sequence of DescribedTrace
    rest, swing : (found,) arrays
        Where the traces found rest and how far they swing, mm.

    Raises
    ------
    RecordError
        More or fewer traces were found than are described, or too many.
    """
    count = len(described)
    if rest.size != count:
        names = ", ".join(trace.name for trace in described)
        raise RecordError(
            f"{_traces(rest.size)} found on the film, but {count} described ({names}); say which are there with --trace"
        )
    if any(trace.position is None for trace in described):
        return [int(k) for k in np.argsort(rest, kind="stable")]
    if count > _MOST_TRACES:
        raise RecordError(f"{count} traces are described; at most {_MOST_TRACES} can be told apart")
    places = np.array([trace.position for trace in described], dtype=np.float64)
    sizes = [trace.amplitude for trace in described]

    def strangeness(order: Iterable[int]) -> float:
        order = list(order)
        # a shift of all places alike costs every order the same
        cost = float(np.sum((rest[order] - places) ** 2))
        for size, found in zip(sizes, order, strict=True):
            if size is not None and swing[found] > 0.0:
                cost += (_FACTOR * float(np.log(swing[found] / size))) ** 2
        return cost

    return list(min(permutations(range(count)), key=strangeness))


def _traces(count: int) -> str:
    return "no trace was" if count == 0 else "1 trace was" if count == 1 else f"{count} traces were"
