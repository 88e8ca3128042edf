"""What was read of a film becomes a record of the contract: angles, uncertainty, flags, and where they come from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from data_schemas.contents import identifier
from data_schemas.errors import RecordError
from data_schemas.film_description import DescribedTrace
from data_schemas.layouts import CONVENTIONS, VERSION
from data_schemas.variables import attributes, dataset
from data_schemas.variables_record import ELONGATION_FLAGS
from pipeline.film.knowledge import Known, default_traces
from pipeline.film.normal_points import clock_uncertainty
from pipeline.film.parts import Floats
from pipeline.film.reading import Reading, accepted_fraction
from pipeline.film.wander import Paper, paper_motion

if TYPE_CHECKING:
    import xarray as xr

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

    axis, samples = reading.axis, reading.samples
    traces, order, rest = as_described(samples.column, reading.scale, known)
    kept = [k for k, found in enumerate(order) if found not in reading.left_out]
    traces, order = tuple(traces[k] for k in kept), [order[k] for k in kept]
    lever = np.array([known.lever(trace) for trace in traces])
    radians = reading.scale / lever[:, None]
    pendulums = known.pendulums(traces)
    labels = [str(each.label) for each in pendulums]
    combination = np.array([[trace.combination.get(label, 0.0) for label in labels] for trace in traces])
    column, period = samples.column[order], reading.tracks.rows_per_swing / axis.rows_per_second
    row = np.interp(samples.time, axis.index * axis.interval, axis.row)
    paper = paper_motion(samples.time, row, column, combination.sum(axis=1), period)
    if paper is not None:
        column = np.where(paper.creased, np.nan, column - paper.shift)
    doubtful = np.zeros(samples.time.size)
    for first, last, by in axis.doubts:
        doubtful[(samples.time >= first) & (samples.time <= last)] = by
    by_rows = reading.kind != "strobe"  # at the marks the times are exact
    described, files = known.description, ", ".join(path.name for path in reading.scan.paths)
    source = f"{files}; seconds count from a full minute of the chronometer, which one the film does not say"
    time_words = {**attributes("time"), "units": f"seconds since {described.start_time}"}
    film = dataset(
        "film",
        {
            "optical_lever": lever,
            "speed": axis.rows_per_second * reading.scale,
            "mark_interval": axis.interval,
            "scale": reading.scale,
            "source_file": files,
            "source_sha256": ", ".join(reading.scan.sha256),
        }
        | ({} if known.description.gap is None else {"gap": known.description.gap}),
        {"trace": [trace.name for trace in traces]},
    )
    film.attrs = findings(reading, paper) | {"assumed": "; ".join(known.assumptions(traces))}
    groups = {
        "/": xr.Dataset(
            coords={"time": ("time", samples.time, time_words)},
            attrs={
                "Conventions": CONVENTIONS,
                "schema": "isochrony-record",
                "schema_version": VERSION,
                "record_id": identifier((described.record_id if known.states("record_id") else "") or name),
                "title": (described.title if known.states("title") else "") or f"pendulum record read from {files}",
                "history": f"read by isochrony from {files}: {reading.kind} reading",
                "source": source,
            },
        ),
        "/record": dataset(
            "record",
            {
                "combination": combination,
                "elongation": (column - rest[order, None]) * radians,
                "elongation_uncertainty": samples.sigma[order] * radians,
                "elongation_qc": samples.qc[order]
                | np.where(doubtful > 0.0, AMBIGUOUS, np.uint16(0))
                | np.where(paper is not None and paper.creased, LOST, np.uint16(0)),
                "time_uncertainty": np.hypot(doubtful, axis.time_sigma if by_rows else 0.0),
            },
            {"trace": [trace.name for trace in traces], "pendulum": labels},
        ),
        "/film": film,
    }
    clock = None  # by how much the film's time axis may run wrong, s a day
    if by_rows:
        drift = None if reading.difference is None else clock_uncertainty(reading.difference, period)
        length = float(np.nanmax(axis.seconds) - np.nanmin(axis.seconds))
        line = axis.mark_sigma * float(np.sqrt(12.0 * axis.interval / length)) / length  # through all marks, its rate
        clock = 86400.0 * max(line, drift or 0.0)
    scale = scale_error(reading, known.speed)
    instrument = known.instrument(pendulums, samples.time, clock, scale, needed=len(traces) > 1)
    if instrument is not None:
        groups["/instrument"] = instrument
    return xr.DataTree.from_dict(groups)


def findings(reading: Reading, paper: Paper | None = None) -> dict[str, Any]:
    """What a reader of the record should know of the reading and of the paper's motion, as attributes of /film."""
    axis = reading.axis
    found: dict[str, Any] = {
        "reading": reading.kind,
        "elongation_zero": "mean place of each trace on the film; its place under the vertical is not known",
        "accepted_fraction": accepted_fraction(reading.tracks, reading.axis),
        "marks_found": int(reading.marks.size),
        "skew": float(np.degrees(np.arctan(axis.shear))),
        "time_sigma": axis.time_sigma,
        # at the marks the times are exact
        "time_noise": 0.0 if reading.kind == "strobe" else axis.mark_sigma * float(np.sqrt(axis.interval)),
        "time_rate_sigma": 0.0 if reading.kind == "strobe" else axis.rate_sigma,
        "flags": ", ".join([*reading.flags, *(["paper-wandered"] if paper is not None else [])]),
        "notes": "; ".join(reading.notes),
    }
    if reading.edits is not None:
        found["edits"] = reading.edits.text()
    if paper is not None:
        found["paper_wander"] = float(np.std(paper.shift)) * reading.scale  # mm
        found["paper_creases"] = paper.creases
        found |= {"paper_steps": np.array(paper.steps)} if paper.steps else {}
    return found


def scale_error(reading: Reading, nominal: float | None) -> float | None:
    """By how much, relative, all elongations may be wrong where marks, dpi and nominal speed contradict each other."""
    if "dpi-disagrees" not in reading.axis.flags or nominal is None:
        return None
    return abs(reading.axis.usual_rows_per_second * reading.scale / nominal - 1.0)


def as_described(column: Floats, scale: float, known: Known) -> tuple[tuple[DescribedTrace, ...], list[int], Floats]:
    """The described traces, for each the number of the one found, and where those rest, (found,) px; see `match`."""
    traces = known.traces or default_traces(len(column))
    filled = np.where(np.isfinite(column).any(axis=1, keepdims=True), column, 0.0)
    rest, swing = np.nanmean(filled, axis=1), np.sqrt(2.0) * np.nanstd(filled, axis=1)
    return traces, match(traces, rest * scale, swing * scale), rest


def match(described: Sequence[DescribedTrace], rest: Floats, swing: Floats) -> list[int]:
    """For each described trace, the number of the one found, by where those rest and how far they swing, (found,) mm.

    Without a place for each, traces are described as they lie from the left to the right. The scan need not begin at
    the paper's edge: a shift common to all places costs every order the same.

    `RecordError`: more or fewer traces were found than are described.
    """
    from scipy.optimize import linear_sum_assignment

    if rest.size != len(described):
        names = ", ".join(trace.name for trace in described)
        shown = {0: "no trace was", 1: "1 trace was"}.get(rest.size, f"{rest.size} traces were")
        raise RecordError(
            f"{shown} found on the film, but {len(described)} described ({names}); say which are there with --trace"
        )
    if any(trace.position is None for trace in described):
        return [int(k) for k in np.argsort(rest, kind="stable")]
    cost = np.square(rest - np.array([[trace.position] for trace in described], dtype=np.float64))
    for row, trace in zip(cost, described, strict=True):
        if trace.amplitude is not None:
            row += np.square(_FACTOR * np.log(np.where(swing > 0.0, swing, trace.amplitude) / trace.amplitude))
    return [int(k) for k in linear_sum_assignment(cost)[1]]


def summary(record: xr.DataTree, reading: Reading) -> dict[str, Any]:
    """Numbers of a reading and of its record, plain.

    Keys: record_id, traces, samples, duration_s, reading, accepted_fraction, missing_fraction (of the samples, by
    trace), marks, speed_mm_s, scale_mm_px, skew_degrees, time_sigma_s, flags, notes, assumed.
    """
    traces, film = record["record"].dataset, record["film"].dataset.attrs
    labels = [str(label) for label in traces["trace"].values]
    missing = np.isnan(traces["elongation"].values).mean(axis=1)
    time = record.dataset["time"].values
    return {
        "record_id": record.attrs["record_id"],
        "traces": labels,
        "samples": int(time.size),
        "duration_s": float(time[-1] - time[0]),
        "reading": reading.kind,
        "accepted_fraction": film["accepted_fraction"],
        "missing_fraction": {label: float(part) for label, part in zip(labels, missing, strict=True)},
        "marks": film["marks_found"],
        "speed_mm_s": reading.axis.rows_per_second * reading.scale,
        "scale_mm_px": reading.scale,
        "skew_degrees": film["skew"],
        "time_sigma_s": film["time_sigma"],
        "flags": [part for part in str(film["flags"]).split(", ") if part],
        "notes": list(reading.notes),
        "assumed": [part for part in str(film["assumed"]).split("; ") if part],
    }
