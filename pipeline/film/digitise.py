"""`digitise`: the image of a film becomes a record: angles, uncertainty, flags, and where they come from."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from data_schemas.contents import identifier
from data_schemas.errors import RefusedError, UsageError
from data_schemas.film_description import FilmDescription, description_path, film_stem, load_description
from data_schemas.film_edits import FilmEdits, load_edits
from data_schemas.layouts import root_attributes
from data_schemas.variables import ELONGATION_FLAGS, attributes, dataset
from pipeline.film.following import SWAYING, Progress, find_time
from pipeline.film.knowledge import FilmOptions, Known
from pipeline.film.normal_points import clock_uncertainty
from pipeline.film.parts import Floats
from pipeline.film.reading import Reading, accepted_fraction, read_traces
from pipeline.film.scan.opening import OpenScan, open_scan
from pipeline.film.wander import Paper, paper_motion

SOME_SWINGS, LEAST_BLOCKS = 10.0, 6  # by which the period of the swing is told; and fewest blocks of so many
OFFSET = 0.3  # mm along the film, 1 sigma, of a trace from marks beside it
AMBIGUOUS, LOST = (np.uint16(ELONGATION_FLAGS[name]) for name in ("ambiguous", "lost"))
Paths = str | os.PathLike[str] | Sequence[str | os.PathLike[str]]


def digitise(
    paths: Paths, description: FilmDescription | None = None, *, options: FilmOptions | None = None,
    edits: FilmEdits | str | os.PathLike[str] | None = None, rows: tuple[int, int | None] | None = None,
    jobs: int = 1, progress: Progress | None = None,
) -> xr.DataTree:  # fmt: skip
    """Read the image of a film into a record.

    Parameters
    ----------
    paths : path or sequence of path
        One image (TIFF, PNG, JPEG), or overlapping strips of one film in order.
    description : FilmDescription, optional
        What is known of the film; left out: NAME.film.toml beside the image, if it is there.
    options : FilmOptions, optional
        What stands before the description: lever, speed, traces, periods and the like; how the image is taken and read.
    edits : FilmEdits or path, optional
        What a person corrects (NAME.edits.toml); applied only where it is given.
    rows : (int, int or None), optional
        First row of the film that is read, and the one behind the last; None: to its end.
    jobs : int
        Processor cores to use.
    progress : function, optional
        Told the stage, how much of it is done, and of how much.

    Returns
    -------
    DataTree
        A record (see `data_schemas`); its group /film says how it was read and what had to be assumed.

    Raises
    ------
    UsageError
        An option that cannot be meant, or several traces without periods.
    FileError
        The image cannot be read.
    RefusedError, RecordError
        It shows no film that can be read with certainty.
    """
    found, known = read(paths, description, options, edits=edits, rows=rows, jobs=jobs, progress=progress)
    return make_record(found, known, film_stem(found.scan.paths[0]))


def read(
    paths: Paths, description: FilmDescription | None = None, options: FilmOptions | None = None, *,
    edits: FilmEdits | str | os.PathLike[str] | None = None, rows: tuple[int, int | None] | None = None,
    jobs: int = 1, progress: Progress | None = None,
) -> tuple[Reading, Known]:  # fmt: skip
    """Read the image of a film, without making a record of it; parameters and faults as of `digitise`."""
    edits, options = load_edits(edits) if isinstance(edits, str | os.PathLike) else edits, options or FilmOptions()
    if edits is not None:  # rows and columns count on the scan turned so
        if options.orientation not in ("auto", str(edits.orientation)):
            raise UsageError(f"orientation {options.orientation}: the edits were made at {edits.orientation} degrees")
        options = replace(options, orientation=str(edits.orientation))
    scan, known = open_film(paths, description, options)
    if rows is not None:
        if edits is not None:
            raise UsageError("rows: edits count on the whole film; give times instead, or no edits")
        scan = scan.part(*rows)
    traces, axis = find_time(scan, known, edits, jobs, progress)
    if isinstance(axis, RefusedError):
        raise axis
    return read_traces(traces, axis, known, jobs), known


def open_film(
    paths: Paths, description: FilmDescription | None = None, options: FilmOptions | None = None
) -> tuple[OpenScan, Known]:
    """Open the image of a film with what is known of it: as given, or as described beside it."""
    first = Path(paths if isinstance(paths, str | os.PathLike) else paths[0] if len(paths) else "")
    beside = description_path(first)
    if description is None and beside.is_file():
        description = load_description(beside)
    known = Known(description, options)
    orientation, lines = known.options.orientation, known.options.lines
    return open_scan(paths, dpi=known.dpi, orientation=orientation, lines=lines), known


def make_record(reading: Reading, known: Known, name: str) -> xr.DataTree:
    """Turn a reading into a record, called `name` where the description gives no identifier.

    Elongations, rad, count from each trace's mean place. `RecordError`: the traces found are not those described;
    `UsageError`: several traces, but no periods or no gravity at which they hold.
    """
    axis, samples = reading.axis, reading.samples
    traces, order, rest = known.as_described(samples.column, reading.scale)
    kept = [k for k, found in enumerate(order) if found not in reading.left_out]
    traces, order = tuple(traces[k] for k in kept), [order[k] for k in kept]
    lever = np.array([known.lever(trace) for trace in traces])
    radians = reading.scale / lever[:, None]
    pendulums = known.pendulums(traces)
    labels = [str(each.label) for each in pendulums]
    combination = np.array([[trace.combination.get(label, 0.0) for label in labels] for trace in traces])
    column, period = samples.column[order], reading.tracks.rows_per_swing / axis.rows_per_second
    shown = (samples.time, column) if reading.kind != "strobe" else courses(reading, order)
    row = np.interp(shown[0], axis.index * axis.interval, axis.row)
    paper = paper_motion(shown[0], row, shown[1], combination.sum(axis=1), period)
    if paper is not None:
        paper = paper.at(samples.time, shown[0])
        column = np.where(paper.creased, np.nan, column - paper.shift)
    doubtful = np.zeros(samples.time.size)
    for first, last, by in axis.doubts:
        doubtful[(samples.time >= first) & (samples.time <= last)] = by
    by_rows = reading.kind != "strobe"  # at the marks the times are exact
    described, files = known.description, ", ".join(path.name for path in reading.scan.paths)
    root = root_attributes(
        "record",
        identifier((described.record_id if known.states("record_id") else "") or name),
        title=(described.title if known.states("title") else "") or f"pendulum record read from {files}",
        history=f"read by isochrony from {files}: {reading.kind} reading",
        source=f"{files}; seconds count from a full minute of the chronometer, which one the film does not say",
    )
    time_words = {**attributes("time"), "units": f"seconds since {described.start_time}"}
    beside = axis.kind != "gaps" and len(traces) > 1  # which tell nothing of how far the lamps lie apart
    timed = np.flatnonzero(np.isfinite(axis.seconds))
    place = reading.scale * np.interp(samples.time, axis.seconds[timed], timed)
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
        | ({} if described.gap is None else {"gap": described.gap})
        | ({"paper_speed": np.gradient(place, samples.time)} if beside else {}),
        {"trace": [trace.name for trace in traces]},
    )
    film.attrs = findings(reading, paper) | {"assumed": "; ".join(known.assumptions(traces))}
    groups = {
        "/": xr.Dataset(coords={"time": ("time", samples.time, time_words)}, attrs=root),
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
    found = {
        "chronometer_rate_uncertainty": clock,
        "scale_uncertainty": scale_error(reading, known.speed),
        "delay_uncertainty": OFFSET / (axis.rows_per_second * reading.scale) if beside else None,
    }
    instrument = known.instrument(pendulums, samples.time, found, needed=len(traces) > 1)
    if instrument is not None:
        groups["/instrument"] = instrument
    return xr.DataTree.from_dict(groups)


def courses(reading: Reading, order: list[int]) -> tuple[Floats, Floats]:
    """Times, s, and columns of traces in an order, px: the courses, where rows were read; else places at the marks."""
    tracks, seconds = reading.tracks, reading.axis.seconds
    if not np.isfinite(tracks.position).any():
        return reading.samples.time, reading.samples.column[order]
    timed = np.flatnonzero(np.isfinite(seconds))[:: max(1, int(tracks.rows_per_swing / SWAYING))]
    return seconds[timed], tracks.course[order][:, timed]


def swing_period(reading: Reading) -> tuple[float, float]:
    """Period of the swing as the courses show it between marks, too, s, and its 1 sigma; NaN of too short a film."""
    tracks, seconds = reading.tracks, reading.axis.seconds
    guess, found = tracks.rows_per_swing / reading.axis.rows_per_second, []
    for course in tracks.course:
        known = np.isfinite(course) & np.isfinite(seconds)
        block = (seconds[known] - reading.axis.index[0] * reading.axis.interval) / (SOME_SWINGS * guess)
        turned = (course[known] - course[known].mean()) * np.exp(-2j * np.pi * SOME_SWINGS * block)
        number = np.maximum(block, 0.0).astype(int)
        sums = np.bincount(number, turned.real) + 1j * np.bincount(number, turned.imag)
        there = np.flatnonzero(np.bincount(number))
        if there.size >= LEAST_BLOCKS:
            away, covariance = np.polyfit(there, np.unwrap(np.angle(sums[there])), 1, cov=True)
            found.append((away[0], covariance[0, 0]))
    if not found:
        return np.nan, np.nan
    away, variance = np.mean(found, axis=0) / (2.0 * np.pi * SOME_SWINGS) ** np.array([1, 2])
    return float(guess / (1.0 + away)), float(guess * np.sqrt(variance))


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
    if reading.kind == "strobe":
        period, sigma = swing_period(reading)
        found |= {"swing_period": period, "swing_period_uncertainty": sigma} if np.isfinite(period) else {}
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
    return abs(reading.axis.rows_per_second * reading.scale / nominal - 1.0)


def summary(record: xr.DataTree, reading: Reading) -> dict[str, Any]:
    """Numbers of a reading and of its record, plain; missing_fraction is of the samples, by trace."""
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
