"""A text table becomes a record: seconds from the first row, angles in radians, pendulums by label."""

import difflib
import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import NDArray

from data_schemas.contents import identifier, shown
from data_schemas.errors import RecordError, UsageError
from data_schemas.layouts import root_attributes
from data_schemas.variables import attributes, dataset, rows_of
from pipeline.importing.table import Table, choose_columns, find_column, is_date, read_columns, read_table, unit_in

NETCDF = (".nc", ".nc4", ".cdf")
ANGLES = {"rad": "rad", "mrad": "mrad", "deg": "deg", "°": "deg", "degrees": "deg", "degree": "deg", "mm": "mm"}
NO_ANGLES = ("m", "cm", "px", "rad/s", "deg/s", "°/s", "m/s", "m/s2", "m/s^2", "m/s²", "V", "Hz")
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0}
MOST_ANGLE = 10.0  # rad, of an elongation whose unit nobody says
LEAST_PLACES = 8
_LABEL = re.compile(r"[^\s=:-]{1,64}")
_NO_DATE = "2000-01-01T00:00:00Z"
_COARSE = 1e6  # s; from here on a float64 of the time itself is coarser than 0.1 ns


@dataclass(frozen=True)
class ImportOptions:
    """What the columns of the table mean; every default is the plainest reading."""

    time: str = ""  # name of the time column, or its number from 1; "" takes the first
    columns: Sequence[str] = ()  # to import, as NAME or NAME:TRACE; empty takes all but the time
    unit: str = ""  # "rad", "mrad", "deg" or "mm" (on the film); "" takes what a column's header says, else rad
    lever: float | None = None  # optical lever, mm rad-1, positive; needed with and only with "mm"
    periods: Mapping[str, float] = field(default_factory=dict)  # full, infinitesimal arc, s; "" is the only pendulum
    gravity: float | None = None  # at which the periods hold, m s-2
    combinations: Mapping[str, str] = field(default_factory=dict)  # {"upper": "1-2"}; others by their trace's label
    accelerations: Mapping[str, str] = field(default_factory=dict)  # columns of vertical_ or horizontal_acceleration
    position: str = ""  # "X,Y": columns of a bob's place, whose angle is about the circle through all of them
    noise: float | None = None  # 1 sigma of the samples, in the table's unit
    instrument: Mapping[str, Any] = field(default_factory=dict)  # more of /instrument: a number, or one by pendulum

    def radians_per_unit(self, header: str = "") -> float:
        """Factor to radians from the table's unit, which a column's header may say; `UsageError` where they differ."""
        if self.unit and header and self.unit != header:
            raise UsageError(f"--unit {self.unit}: the header says {header}; drop --unit, or correct the header")
        unit = self.unit or header or "rad"
        if unit == "mm":
            if self.lever is None:
                raise UsageError("--unit mm needs --lever, the optical lever in mm per rad")
            return 1.0 / self.lever
        if self.lever is not None:
            raise UsageError(f"--lever is for elongations in mm; add --unit mm, or drop it with {unit}")
        return {"deg": math.radians(1.0), "mrad": 1e-3}.get(unit, 1.0)


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
    options = options or ImportOptions()
    table = read_columns(path) if Path(path).suffix.lower() in NETCDF else read_table(path)
    time_column = find_column(table, options.time) if options.time else 0
    start, reading, seconds = relative_times(table, time_column)
    if options.position:
        table, chosen = with_angle(table, options.position)
    else:
        beside = {time_column, *(find_column(table, name) for name in options.accelerations.values())}
        chosen = choose_columns(table, beside, options.columns)
    angles, scale = _elongation(table, chosen, options)
    pendulums, combination = combine(list(chosen), options.combinations)
    values = {"combination": combination, "elongation": angles}
    values |= {name: np.array(table.numbers(find_column(table, of))) for name, of in options.accelerations.items()}
    if options.noise is not None:
        values["elongation_uncertainty"] = options.noise * scale
    name = Path(table.source).name
    columns = ", ".join(f"trace {label} from column {table.title(column)}" for label, column in chosen.items())
    root = root_attributes(
        "record",
        identifier(Path(name).stem),
        title=f"pendulum record imported from {name}",
        history=f"imported by isochrony: {columns}, in {options.unit or 'the units of the headers, else rad'}",
        source=f"{name}, whose own clock reads {reading} at the start",
    )
    time = {**attributes("time"), "units": f"seconds since {start}"}
    groups = {
        "/": xr.Dataset(coords={"time": ("time", seconds, time)}, attrs=root),
        "/record": dataset("record", values, {"trace": list(chosen), "pendulum": pendulums}),
    }
    period = _periods(pendulums, options, needed=len(chosen) > 1)
    if period is not None or options.gravity is not None or options.instrument:
        groups["/instrument"] = _instrument(pendulums, period, options)
    if options.lever is not None:
        lever = np.full(len(chosen), options.lever)
        groups["/film"] = dataset("film", {"optical_lever": lever}, {"trace": list(chosen)})
    return xr.DataTree.from_dict(groups)


def _elongation(
    table: Table, chosen: Mapping[str, int], options: ImportOptions
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Values of the chosen columns (trace, time) in rad, and their units in rad."""
    for column in () if options.unit else chosen.values():
        name = table.names[column]
        unit = unit_in(name, {each: each for each in NO_ANGLES})
        if unit and name.rstrip()[-1] in ")]":
            remedy = "choose others with --column, or say --xy X,Y where they are a bob's position"
            raise RecordError(f"{table.source}: column '{name}' is in {unit}, which is no angle; {remedy}")
    scale = np.array([options.radians_per_unit(unit_in(table.names[column], ANGLES)) for column in chosen.values()])
    angles = np.array([table.numbers(column) for column in chosen.values()]) * scale[:, None]
    for (label, column), trace in zip(chosen.items(), angles, strict=True):
        if np.isnan(trace).all():
            told = f"column {table.title(column)} (trace {label}) holds no value"
            raise RecordError(f"{table.source}: {told}; choose others with --column")
    if not options.unit and (largest := np.nanmax(np.abs(angles), initial=0.0)) > MOST_ANGLE:
        remedy = "say --unit deg, mrad or mm, or --unit rad if they are"
        raise RecordError(f"{table.source}: angles up to {largest:.3g} are hardly radians; {remedy}")
    return angles, scale


def with_angle(table: Table, position: str) -> tuple[Table, dict[str, int]]:
    """A table with the angle of a bob, by its x and y, about the centre of the circle through them (Kasa 1976)."""
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


def combine(traces: Sequence[str], given: Mapping[str, str]) -> tuple[list[str], NDArray[np.float64]]:
    """Labels of the pendulums, and each trace as their combination (trace, pendulum).

    A trace is read from `given`, else from its own label: "1" is a pendulum, "1-2" a difference.

    `UsageError`: a combination that names no pendulums, or traces that repeat each other.

    Examples
    --------
    >>> combine(["1", "1-2"], {})
    (['1', '2'], array([[ 1.,  0.],
           [ 1., -1.]]))
    """
    for trace in given:
        if trace not in traces:
            raise UsageError(f"--combination {trace}=...: there is no trace '{trace}'; traces: {', '.join(traces)}")
    parts = {trace: given.get(trace, trace).split("-") for trace in traces}
    for trace, labels in parts.items():
        if not all(_LABEL.fullmatch(label) for label in labels) or len(set(labels)) < len(labels):
            told = f"trace '{trace}': '{given.get(trace, trace)}' is no combination of different pendulums"
            raise UsageError(f"{told}; write --combination {trace}=1 or {trace}=1-2")
    pendulums = sorted({label for labels in parts.values() for label in labels}, key=by_number)
    matrix = np.array([[float(x == first) - (x in others) for x in pendulums] for first, *others in parts.values()])
    if len(traces) > 1 and np.linalg.matrix_rank(matrix) < len(traces):
        told = f"traces {', '.join(traces)} repeat each other as combinations of pendulums"
        raise UsageError(f"{told}; leave one out with --column, or correct --combination")
    return pendulums, matrix


def by_number(label: str) -> tuple[bool, int, str]:
    """Order labels as numbers where they are numbers: 2 before 10."""
    is_number = label.isascii() and label.isdigit()
    return not is_number, int(label) if is_number else 0, label


def periods_by_label(given: Mapping[str, float], pendulums: Sequence[str]) -> dict[str, float]:
    """Periods of `--period`, s, by pendulum; `UsageError` for one of no pendulum, or of several without a label."""
    known, periods = ", ".join(pendulums), dict(given)
    if "" in periods:
        if len(pendulums) > 1:
            raise UsageError(f"--period {periods['']:g}: there are pendulums {known}; write LABEL=SECONDS for each")
        periods[pendulums[0]] = periods.pop("")
    for label in periods:
        if label not in pendulums:
            raise UsageError(f"--period {label}=...: there is no pendulum '{label}'; pendulums: {known}")
    return periods


def need_period_and_gravity(unknown: Sequence[str], gravity: float | None, remedy: str = "") -> None:
    """`UsageError` where pendulums are without a period, or the gravity at which the periods hold is not known."""
    if unknown:
        named = f"pendulum {unknown[0]} has no period, which gravity needs; add --period {unknown[0]}=SECONDS"
        raise UsageError(named + remedy)
    if gravity is None:
        raise UsageError("the gravity at which the periods hold is missing; add --gravity, in m/s2")


def _periods(pendulums: Sequence[str], options: ImportOptions, *, needed: bool) -> NDArray[np.float64] | None:
    """Period of each pendulum in s; None if none was given nor is needed (a single trace does without)."""
    given = periods_by_label({label: _constant("period", value) for label, value in options.periods.items()}, pendulums)
    if not given and not needed:
        return None
    unknown = [label for label in pendulums if label not in given]
    need_period_and_gravity(unknown, options.gravity if needed else 0.0)
    return np.array([given[label] for label in pendulums])


def _constant(name: str, value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        raise UsageError(f"instrument: {name} = {shown(repr(value))} is not a number; correct it") from None


def _instrument(pendulums: list[str], period: NDArray[np.float64] | None, options: ImportOptions) -> xr.Dataset:
    """Group /instrument; `UsageError`: a constant that is not known, or that has no value for a pendulum."""
    values: dict[str, Any] = {} if period is None else {"period": period}
    words, known = {}, rows_of("instrument")
    stated = {} if options.gravity is None else {"reference_gravity": options.gravity}
    for name, value in {**stated, **options.instrument}.items():
        row = known.get(name)
        if name in ("restoring", "acceleration_frame"):
            words[name] = str(value)
        elif row is None or row.dtype != "f8" or "base" in row.dims:
            names = (each for each in known if not each.startswith("base"))
            near = difflib.get_close_matches(name, names, n=1, cutoff=0.0)[0]
            raise UsageError(f"instrument: '{shown(name)}' is not known; did you mean '{near}'?")
        elif row.dims == ("pendulum",):
            each = value if isinstance(value, Mapping) else dict.fromkeys(pendulums, value)
            lacking = [label for label in pendulums if label not in each]
            if lacking:
                raise UsageError(f"instrument: {name} lacks pendulum {', '.join(lacking)}; give it as LABEL = NUMBER")
            values[name] = np.array([_constant(name, each[label]) for label in pendulums])
        elif value is not None:
            values[name] = _constant(name, value)
    return dataset("instrument", values, {"pendulum": pendulums}).assign_attrs(words)


def relative_times(table: Table, column: int) -> tuple[str, str, NDArray[np.float64]]:
    """Start of a table, what its own clock reads there, and seconds (rows,) from the first row, strictly increasing.

    The start is an ISO date for the units "seconds since ..."; a conventional one if the table gives numbers.

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
        here, last = f"line {table.lines[row]}: time {shown(table.rows[row][column])}", table.lines[row - 1]
        raise RecordError(f"{table.source}: {here} {what} that of line {last}; sort the rows and keep one row a time")
    return start, reading, times


def _from_numbers(table: Table, column: int) -> NDArray[np.float64]:
    values: NDArray[np.float64] = np.array(table.numbers(column))
    if missing := np.flatnonzero(np.isnan(values)).tolist():
        line = table.lines[missing[0]]
        raise RecordError(f"{table.source}: line {line}: the time is missing; fill it in or remove the row")
    if abs(values[0]) < _COARSE:
        return np.array(values - values[0])
    cells = (row[column].replace(",", ".") for row in table.rows)
    exact = [Decimal(cell if value else 0) for cell, value in zip(cells, values, strict=True)]  # 0e-9999999999999999999
    return np.array([float(value - exact[0]) for value in exact])


def _from_dates(table: Table, column: int) -> tuple[str, NDArray[np.float64]]:
    """Start and seconds; a date without a zone is taken as UTC: only differences matter."""
    cells = [row[column] for row in table.rows]
    moments = pd.to_datetime(cells, utc=True, format="ISO8601", errors="coerce")
    for row in np.flatnonzero(moments.isna())[:1].tolist():
        told = f"line {table.lines[row]}: time '{shown(cells[row])}' is no ISO date such as 2024-05-01T12:00:00.25Z"
        raise RecordError(f"{table.source}: {told}; correct it or remove the row")
    return moments[0].isoformat().replace("+00:00", "Z"), np.array((moments - moments[0]).total_seconds())
