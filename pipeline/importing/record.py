"""A text table becomes a record: seconds from the first row, angles in radians, pendulums by label."""

from __future__ import annotations

import difflib
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from decimal import Decimal
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from data_schemas.contents import identifier, shown
from data_schemas.errors import RecordError, UsageError
from data_schemas.layouts import root_attributes
from data_schemas.variables import VARIABLES, attributes, dataset
from pipeline.importing.pendulums import ImportOptions, combine, constant, periods
from pipeline.importing.table import Table, choose_columns, find_column, is_date, read_columns, read_table, unit_in

if TYPE_CHECKING:
    import xarray as xr

NETCDF = (".nc", ".nc4", ".cdf")
ANGLES = {"rad": "rad", "mrad": "mrad", "deg": "deg", "°": "deg", "degrees": "deg", "degree": "deg", "mm": "mm"}
NO_ANGLES = ("m", "cm", "px", "rad/s", "deg/s", "°/s", "m/s", "m/s2", "m/s^2", "m/s²", "V", "Hz")
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0}
MOST_ANGLE = 10.0  # rad, of an elongation whose unit nobody says
LEAST_PLACES = 8
FINER = re.compile(r"\.\d{6}(\d+)")
_NO_DATE = "2000-01-01T00:00:00Z"
_COARSE = 1e6  # s; from here on a float64 of the time itself is coarser than 0.1 ns


@np.errstate(all="ignore")
def import_csv(path: str | os.PathLike[str], options: ImportOptions | None = None) -> xr.DataTree:
    """Turn a text table into a record.

    Parameters
    ----------
    path : path
        Table of numbers with or without a header (see `pipeline.importing.table`).
    options : ImportOptions, optional
        Meaning of the columns.

    Returns
    -------
    DataTree
        A record; `time` starts at 0, and the root attribute `source` keeps the file and its clock.

    Raises
    ------
    UsageError
        An option that fits neither the table nor the other options.
    FileError, RecordError
        The table cannot be read, or its times or values cannot make a record.
    """
    import xarray as xr

    options = options or ImportOptions()
    table = read_columns(path) if Path(path).suffix.lower() in NETCDF else read_table(path)
    time_column = find_column(table, options.time) if options.time else 0
    clock = relative_times(table, time_column)
    if options.position:
        table, chosen = with_angle(table, options.position)
    else:
        beside = {time_column, *(find_column(table, name) for name in options.accelerations.values())}
        chosen = choose_columns(table, beside, options.columns)
    for column in () if options.unit else chosen.values():
        unit = unit_in(table.names[column], {each: each for each in NO_ANGLES})
        if unit and table.names[column].rstrip()[-1] in ")]":
            raise RecordError(
                f"{table.source}: column '{table.names[column]}' is in {unit}, which is no angle; choose others with "
                "--column, or say --xy X,Y where they are a bob's position"
            )
    scale = np.array([options.radians_per_unit(unit_in(table.names[column], ANGLES)) for column in chosen.values()])
    angles = _elongation(table, chosen) * scale[:, None]
    if not options.unit and np.nanmax(np.abs(angles), initial=0.0) > MOST_ANGLE:
        raise RecordError(
            f"{table.source}: angles up to {np.nanmax(np.abs(angles)):.3g} are hardly radians; "
            "say --unit deg, mrad or mm, or --unit rad if they are"
        )
    pendulums, combination = combine(list(chosen), options.combinations)
    period = periods(pendulums, options, needed=len(chosen) > 1)
    values = {"combination": combination, "elongation": angles}
    values |= {name: np.array(table.numbers(find_column(table, of))) for name, of in options.accelerations.items()}
    if options.noise is not None:
        values["elongation_uncertainty"] = options.noise * scale
    groups = {
        "/": _root(table, clock, chosen, options),
        "/record": dataset("record", values, {"trace": list(chosen), "pendulum": pendulums}),
    }
    if period is not None or options.gravity is not None or options.instrument:
        groups["/instrument"] = _instrument(pendulums, period, options)
    if options.lever is not None:
        lever = np.full(len(chosen), options.lever)
        groups["/film"] = dataset("film", {"optical_lever": lever}, {"trace": list(chosen)})
    return xr.DataTree.from_dict(groups)


def _elongation(table: Table, chosen: Mapping[str, int]) -> NDArray[np.float64]:
    """Values of the chosen columns (trace, time) in the table's unit."""
    values = np.array([table.numbers(column) for column in chosen.values()])
    for (label, column), trace in zip(chosen.items(), values, strict=True):
        if np.isnan(trace).all():
            raise RecordError(
                f"{table.source}: column {table.title(column)} (trace {label}) holds no value; "
                "choose others with --column"
            )
    return values


def _root(table: Table, clock: Clock, chosen: Mapping[str, int], options: ImportOptions) -> xr.Dataset:
    import xarray as xr

    name = Path(table.source).name
    columns = ", ".join(f"trace {label} from column {table.title(column)}" for label, column in chosen.items())
    time = {**attributes("time"), "units": f"seconds since {clock.start}"}
    return xr.Dataset(
        coords={"time": ("time", clock.seconds, time)},
        attrs=root_attributes(
            "record",
            identifier(Path(name).stem),
            title=f"pendulum record imported from {name}",
            history=f"imported by isochrony: {columns}, in {options.unit or 'the units of the headers, else rad'}",
            source=f"{name}, whose own clock reads {clock.reading} at the start",
        ),
    )


def with_angle(table: Table, position: str) -> tuple[Table, dict[str, int]]:
    """A table with the angle of a bob of which it holds x and y: about the centre of the circle through all places.

    The circle is the algebraic fit of Kasa (1976); the rest is the mean direction from its centre.

    `UsageError` and `RecordError`: columns that are not there, or places that lie on no circle.
    """
    names = [name.strip() for name in position.split(",")]
    if len(names) != 2:
        raise UsageError(f"--xy {position}: give two columns, as X,Y")
    x, y = (np.array(table.numbers(find_column(table, name))) for name in names)
    known = np.isfinite(x**2 + y**2)
    if known.sum() < LEAST_PLACES:
        raise RecordError(f"{table.source}: columns {position} hold too few places for a circle; give others with --xy")
    system = np.stack([x, y, np.ones_like(x)], axis=1)[known]
    (cx, cy, _), _, rank, _ = np.linalg.lstsq(system, (x**2 + y**2)[known], rcond=None)
    if rank < 3:
        raise RecordError(f"{table.source}: columns {position} lie on a straight line; a bob swings on a circle")
    turned = (x - 0.5 * cx) + 1j * (y - 0.5 * cy)
    angle = np.angle(turned * np.conj(np.mean(np.exp(1j * np.angle(turned[known])))))
    rows = tuple((*row, repr(float(value))) for row, value in zip(table.rows, angle, strict=True))
    return replace(table, names=(*table.names, "angle (rad)"), rows=rows), {"1": len(table.names)}


def _instrument(pendulums: list[str], period: NDArray[np.float64] | None, options: ImportOptions) -> xr.Dataset:
    """Group /instrument.

    `UsageError`: a constant that is not known, or that has no value for a pendulum.
    """
    values: dict[str, Any] = {"period": period}
    words = {}
    for name, value in {"reference_gravity": options.gravity, **options.instrument}.items():
        row = VARIABLES.get(f"instrument/{name}")
        if name in ("restoring", "acceleration_frame"):
            words[name] = str(value)
        elif row is None or row.dtype != "f8" or "base" in row.dims:
            names = (key[11:] for key in VARIABLES if key.startswith("instrument/") and "/base" not in key)
            near = difflib.get_close_matches(name, names, n=1, cutoff=0.0)[0]
            raise UsageError(f"instrument: '{shown(name)}' is not known; did you mean '{near}'?")
        elif row.dims == ("pendulum",):
            each = value if isinstance(value, Mapping) else dict.fromkeys(pendulums, value)
            lacking = [label for label in pendulums if label not in each]
            if lacking:
                raise UsageError(f"instrument: {name} lacks pendulum {', '.join(lacking)}; give it as LABEL = NUMBER")
            values[name] = np.array([constant(name, each[label]) for label in pendulums])
        else:
            values[name] = value if value is None else constant(name, value)
    given = {name: value for name, value in values.items() if value is not None}
    return dataset("instrument", given, {"pendulum": pendulums}).assign_attrs(words)


@dataclass(frozen=True)
class Clock:
    """The times of a table."""

    start: str
    """ISO date for the units "seconds since ..."; a conventional one if the table gives numbers."""
    reading: str
    """What the table's own clock read at the first row."""
    seconds: NDArray[np.float64]
    """(rows,) seconds from the first row, strictly increasing."""


def relative_times(table: Table, column: int) -> Clock:
    """Seconds from the first row.

    `RecordError`: a time is missing or unreadable, repeats or goes back (the line is named), or there are not two rows.
    """
    if len(table.rows) < 2:
        raise RecordError(f"{table.source}: holds {len(table.rows)} sample; a record needs at least two")
    first = table.rows[0][column]
    if is_date(first):
        start, times = _from_dates(table, column)
        reading = first
    else:
        unit = unit_in(table.names[column], {name: name for name in TIMES}) or "s"
        start, reading = _NO_DATE, f"{first} {unit}"
        times = _from_numbers(table, column) * TIMES[unit]
    late = np.flatnonzero(np.diff(times) <= 0.0)
    if late.size:
        row = int(late[0]) + 1
        what = "repeats" if times[row] == times[row - 1] else "goes back from"
        raise RecordError(
            f"{table.source}: line {table.lines[row]}: time {shown(table.rows[row][column])} {what} that of line "
            f"{table.lines[row - 1]}; sort the rows and keep one row a time"
        )
    return Clock(start, reading, times)


def _from_numbers(table: Table, column: int) -> NDArray[np.float64]:
    values = table.numbers(column)
    for line, value in zip(table.lines, values, strict=True):
        if value != value:
            raise RecordError(f"{table.source}: line {line}: the time is missing; fill it in or remove the row")
    if abs(values[0]) < _COARSE:
        return np.array(values) - values[0]
    cells = (row[column].replace(",", ".") for row in table.rows)
    exact = [Decimal(cell if value else 0) for cell, value in zip(cells, values, strict=True)]  # 0e-9999999999999999999
    return np.array([float(value - exact[0]) for value in exact])


def _from_dates(table: Table, column: int) -> tuple[str, NDArray[np.float64]]:
    moments, rest = [], []
    for line, row in zip(table.lines, table.rows, strict=True):
        try:
            moment = datetime.fromisoformat(row[column])
            finer = FINER.search(row[column])  # digits beyond the microsecond, which Python leaves out
            rest.append(float(f"0.{finer[1]}") * 1e-6 if finer else 0.0)
            # A date without a zone is taken as UTC: only differences matter.
            moments.append((moment if moment.tzinfo else moment.replace(tzinfo=UTC)).astimezone(UTC))
        except (ValueError, OverflowError):
            raise RecordError(
                f"{table.source}: line {line}: time '{shown(row[column])}' is no ISO date "
                "such as 2024-05-01T12:00:00.25Z; correct it or remove the row"
            ) from None
    start = moments[0].isoformat().replace("+00:00", "Z")
    seconds = np.array([(moment - moments[0]).total_seconds() for moment in moments])
    return start, seconds + (np.array(rest) - rest[0])
