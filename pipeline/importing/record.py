"""A text table becomes a record: seconds from the first row, angles in radians, pendulums by label."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from decimal import Decimal
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from data_schemas.contents import shown
from data_schemas.errors import RecordError
from data_schemas.layouts import CONVENTIONS, VERSION
from data_schemas.variables import attributes
from pipeline.importing.pendulums import ImportOptions, combine, periods
from pipeline.importing.table import Table, choose_columns, find_column, is_date, read_table

if TYPE_CHECKING:
    import xarray as xr

_NO_DATE = "2000-01-01T00:00:00Z"
_COARSE = 1e6  # s; from here on a float64 of the time itself is coarser than 0.1 ns


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
    scale = options.radians_per_unit()
    table = read_table(path)
    time_column = find_column(table, options.time) if options.time else 0
    chosen = choose_columns(table, time_column, options.columns)
    pendulums, combination = combine(list(chosen), options.combinations)
    period = periods(pendulums, options, needed=len(chosen) > 1)
    clock = relative_times(table, time_column)
    groups = {
        "/": _root(table, clock, chosen, options),
        "/record": _traces(chosen, pendulums, combination, _elongation(table, chosen) * scale),
    }
    if period is not None or options.gravity is not None:
        groups["/instrument"] = _instrument(pendulums, period, options.gravity)
    if options.lever is not None:
        lever = np.full(len(chosen), options.lever)
        groups["/film"] = _dataset("film", {"optical_lever": lever}, {"trace": list(chosen)})
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
        attrs={
            "Conventions": CONVENTIONS,
            "schema": "isochrony-record",
            "schema_version": VERSION,
            "record_id": Path(name).stem,
            "title": f"pendulum record imported from {name}",
            "history": f"imported by isochrony: {columns}, in {options.unit}",
            "source": f"{name}, whose own clock reads {clock.reading} at the start",
        },
    )


def _traces(
    chosen: Mapping[str, int],
    pendulums: list[str],
    combination: NDArray[np.float64],
    elongation: NDArray[np.float64],
) -> xr.Dataset:
    return _dataset(
        "record",
        {"combination": combination, "elongation": elongation},
        {"trace": list(chosen), "pendulum": pendulums},
    )


def _instrument(pendulums: list[str], period: NDArray[np.float64] | None, gravity: float | None) -> xr.Dataset:
    given = {"period": period, "reference_gravity": gravity}
    return _dataset(
        "instrument",
        {name: value for name, value in given.items() if value is not None},
        {"pendulum": pendulums},
    )


def _dataset(group: str, variables: Mapping[str, Any], labels: Mapping[str, list[str]]) -> xr.Dataset:
    """A group's dataset, its dimensions and attributes from the table of variables."""
    import xarray as xr

    from data_schemas.variables import VARIABLES

    def entry(name: str, value: Any) -> tuple[tuple[str, ...], Any, dict[str, Any]]:
        key = f"{group}/{name}"
        return VARIABLES[key].dims, value, attributes(key)

    return xr.Dataset(
        {name: entry(name, value) for name, value in variables.items()},
        coords={name: entry(name, np.array(values)) for name, values in labels.items()},
    )


@dataclass(frozen=True)
class Clock:
    """The times of a table.

    Attributes
    ----------
    start : str
        ISO date for the units "seconds since ..."; a conventional one if the table gives numbers.
    reading : str
        What the table's own clock read at the first row.
    seconds : (rows,) array
        Seconds from the first row, strictly increasing.
    """

    start: str
    reading: str
    seconds: NDArray[np.float64]


def relative_times(table: Table, column: int) -> Clock:
    """Seconds from the first row.

    Raises
    ------
    RecordError
        A time is missing or unreadable, repeats or goes back (the line is named), or there are not two rows.
    """
    if len(table.rows) < 2:
        raise RecordError(f"{table.source}: holds {len(table.rows)} sample; a record needs at least two")
    first = table.rows[0][column]
    if is_date(first):
        start, times = _from_dates(table, column)
        reading = first
    else:
        start, reading = _NO_DATE, f"{first} s"
        times = _from_numbers(table, column)
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
    exact = [Decimal(row[column].replace(",", ".")) for row in table.rows]
    return np.array([float(value - exact[0]) for value in exact])


def _from_dates(table: Table, column: int) -> tuple[str, NDArray[np.float64]]:
    moments = []
    for line, row in zip(table.lines, table.rows, strict=True):
        try:
            moment = datetime.fromisoformat(row[column])
        except ValueError:
            raise RecordError(
                f"{table.source}: line {line}: time '{shown(row[column])}' is no ISO date "
                "such as 2024-05-01T12:00:00.25Z; correct it or remove the row"
            ) from None
        # A date without a zone is taken as UTC: only differences matter.
        moments.append(moment if moment.tzinfo else moment.replace(tzinfo=UTC))
    start = moments[0].astimezone(UTC).isoformat().replace("+00:00", "Z")
    return start, np.array([(moment - moments[0]).total_seconds() for moment in moments])
