"""Reading a recorded acceleration: two columns of a CSV file or two variables of a netCDF file."""

from __future__ import annotations

import csv
import io
from array import array
from itertools import chain
from pathlib import Path

import numpy as np

from data_schemas.errors import FileError, SceneError
from data_schemas.scene_motion import Table
from data_schemas.text_files import text_of
from synth.phase import Floats


@np.errstate(all="ignore")
def read_table(term: Table) -> tuple[Floats, Floats]:
    """Times in s and values times the factor.

    `SceneError` if the file or a column is not there, a value is not a number, or the times do not increase.
    """
    path = Path(term.file)
    try:
        columns = _netcdf(path, term) if path.suffix == ".nc" else _csv(path, term)
    except (OSError, ValueError, csv.Error) as error:
        why = getattr(error, "strerror", None) or error
        raise SceneError(f"{path}: cannot be read ({why}); mend {term.section}.file") from None
    seconds, values = columns[0], columns[1] * term.factor
    if seconds.shape != values.shape or seconds.ndim != 1 or seconds.size < 2:
        raise SceneError(f"{path}: time and value must be two columns of equal length with two readings at least")
    if not (np.all(np.isfinite(seconds)) and np.all(np.isfinite(values))):
        raise SceneError(f"{path}: has values missing or infinite; a motion must be known at all times, fill them in")
    if np.any(seconds[1:] <= seconds[:-1]):
        raise SceneError(f"{path}: the times of column {term.time!r} do not increase; sort them")
    return seconds, values


def _csv(path: Path, term: Table) -> tuple[Floats, Floats]:
    numbers = array("d")  # row by row: a list of a million rows would take half a gigabyte
    with io.StringIO(text_of(path, f"mend {term.section}.file", SceneError), newline="") as file:
        first_line = file.readline()
        separator = ";" if ";" in first_line else ","
        rows = (row for row in csv.reader(chain([first_line], file), delimiter=separator) if row)
        first = next(rows, None)
        if first is None:
            raise SceneError(f"{path}: is empty; give a table with a time and a value column")
        names = [cell.strip() for cell in first]
        has_header = not all(_is_number(cell) for cell in names)
        places = [_place(path, names if has_header else [], len(names), column) for column in (term.time, term.value)]
        try:
            for row in rows if has_header else chain([first], rows):
                numbers.extend(float(row[place]) for place in places)
        except (ValueError, IndexError):
            what = f"column {term.time!r} or {term.value!r}"
            raise SceneError(f"{path}: a row lacks a number in {what}; mend it") from None
    table = np.array(numbers).reshape(-1, 2)
    return table[:, 0].copy(), table[:, 1].copy()


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _place(path: Path, names: list[str], width: int, column: int | str) -> int:
    if isinstance(column, int):
        if column > width:
            raise SceneError(f"{path}: has no column {column}; it has {width}")
        return column - 1
    if column not in names:
        known = f"it has {', '.join(names)}" if names else "it has no header, give the column's number"
        raise SceneError(f"{path}: has no column {column!r}; {known}")
    return names.index(column)


def _netcdf(path: Path, term: Table) -> tuple[Floats, Floats]:
    from data_schemas.reading import load

    try:
        variables = load(path)[""].variables
    except FileError as fault:
        raise SceneError(str(fault)) from None
    names = list(variables)
    found = [names[_place(path, names, len(names), column)] for column in (term.time, term.value)]
    seconds, values = (np.asarray(variables[name].values, dtype=np.float64) for name in found)
    return seconds, values
