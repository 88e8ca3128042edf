"""Text tables of numbers: find delimiter, header and missing values; name the line of every fault."""

import csv
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from data_schemas.contents import shown
from data_schemas.errors import RecordError, UsageError
from data_schemas.text_files import text_of

MOST_COLUMNS = 1000
_MISSING = frozenset({"", "-", "nan", "na", "n/a", "null", "none"})
_UNIT = re.compile(r"\(([^()]+)\)\s*$|\[([^\[\]]+)\]\s*$|_([a-zµ]+)$")
_BRACKET = re.compile(r"(?<!\s)\s*[(\[].*$")
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
_DATE = re.compile(r"\d{4}-\d\d-\d\d([T ].*)?")
_NUMBERED_TRACE = re.compile(r"\d+(-\d+)*")


@dataclass(frozen=True)
class Table:
    """Cells of a text table as they were written."""

    source: str  # the file, for messages
    names: tuple[str, ...]  # of each column; "" where the table has no header
    lines: tuple[int, ...]  # number in the file of each row, from 1
    rows: tuple[tuple[str, ...], ...]  # stripped cells; every row has as many as there are names

    def title(self, column: int) -> str:
        """What to call a column in a message: its name, or its number from 1."""
        return f"'{shown(self.names[column])}'" if self.names[column] else str(column + 1)

    def numbers(self, column: int) -> list[float]:
        """Values of one column, NaN where missing; `RecordError` names the line of a cell that is no finite number."""
        values = []
        for line, row in zip(self.lines, self.rows, strict=True):
            value = number(row[column])
            if value is None or value in (float("inf"), float("-inf")):
                told = f"line {line}, column {self.title(column)}: '{shown(row[column])}' is not a finite number"
                raise RecordError(f"{self.source}: {told}; correct it, or leave the cell empty if missing")
            values.append(value)
        return values


def unit_in(name: str, known: Mapping[str, str]) -> str:
    """Unit that a column's header ends with, "angle (deg)", "angle [deg]" or "angle_deg", as `known` calls it.

    >>> unit_in("theta [mrad]", {"mrad": "mrad"}), unit_in("t_ms", {"ms": "ms"}), unit_in("rad", {"rad": "rad"})
    ('mrad', 'ms', '')
    """
    found = _UNIT.search(name)
    return known.get(next(filter(None, found.groups())).strip(), "") if found else ""


def read_columns(path: str | os.PathLike[str]) -> Table:
    """A netCDF file's variables over time, as a text table has them; `FileError`, `RecordError`: none, or no time."""
    from data_schemas.reading import load

    source = os.fspath(path)
    variables = load(source)[""].variables
    if "time" not in variables or variables["time"].dims != ("time",) or variables["time"].values.dtype.kind == "U":
        raise RecordError(f"{source}: has no numbers time(time); name its dimension so, with the times, or export CSV")
    names = ["time", *(name for name in variables if name != "time")]
    columns = {name: variables[name] for name in names if variables[name].dims == ("time",)}
    numbers = {name: each for name, each in columns.items() if each.values.dtype.kind in "iuf"}
    units = {name: str(each.attrs.get("units", "")) for name, each in numbers.items()}
    heads = tuple(name if "since" in unit or not unit else f"{name} ({unit})" for name, unit in units.items())
    rows = tuple(zip(*(map(repr, each.values.tolist()) for each in numbers.values()), strict=True))
    return Table(source, heads, tuple(range(1, len(rows) + 1)), rows)


def number(cell: str) -> float | None:
    """Value of a cell: NaN if it says missing, None if it is no number.

    >>> number("3,5"), number("-"), number("angle")
    (3.5, nan, None)
    """
    if cell.lower() in _MISSING:
        return float("nan")
    if _DECIMAL_COMMA.fullmatch(cell):
        cell = cell.replace(",", ".")
    try:
        return float(cell) if "_" not in cell else None  # Python alone reads 1_000
    except ValueError:
        return None


def is_date(cell: str) -> bool:
    """Whether a cell looks like an ISO 8601 date or time of a day."""
    return _DATE.fullmatch(cell) is not None


def read_table(path: str | os.PathLike[str]) -> Table:
    """Read a text table.

    Comma, semicolon, tab or blanks separate the cells; a decimal comma is understood unless the comma
    separates. Lines that start with `#` are comments; the last of them before the numbers names the columns
    if the table has no other header.

    `FileError`: the file cannot be read or is no text. `RecordError`: it has no rows, or a row has too few or too many
    cells.
    """
    source = os.fspath(path)
    numbered: list[tuple[int, str]] = []
    comment = ""
    for index, line in enumerate(text_of(source, "give a table of numbers as CSV").splitlines(), start=1):
        if line.lstrip().startswith("#"):
            if not numbered:
                comment = line.lstrip("# \t")
        elif line.strip():
            numbered.append((index, line))
    if not numbered:
        raise RecordError(f"{source}: holds no rows; a table of times and angles is needed")
    if len(numbered) > 2 and _only_a_title(numbered[0][1], numbered[1][1]):
        numbered.pop(0)
    split = _splitter(numbered[0][1])
    if (width := len(split(numbered[0][1]))) > MOST_COLUMNS:
        raise RecordError(f"{source}: has {width} columns; give times and the traces alone, {MOST_COLUMNS} at most")
    lines = [index for index, _ in numbered]
    rows = [split(line) for _, line in numbered]
    if all(len(row) == len(rows[0]) and not row[-1] for row in rows):
        rows = [row[:-1] for row in rows]  # every line ends with a delimiter
    width = len(rows[0])
    names = split(comment) if comment else []
    if _is_header(rows[0]):
        names = rows.pop(0)
        lines.pop(0)
    elif len(names) != width or not _is_header(names):
        names = [""] * width
    for index, row in zip(lines, rows, strict=True):
        if len(row) != width:
            told = f"line {index} has {len(row)} cells where the first row has {width}"
            raise RecordError(f"{source}: {told}; write every row with the same delimiters")
    return Table(source, tuple(names), tuple(lines), tuple(tuple(row) for row in rows))


def _splitter(line: str) -> Callable[[str], list[str]]:
    """How to cut lines into stripped cells, told by the first line."""
    for delimiter in (";", "\t", ","):
        if delimiter in line and not (delimiter == "," and _all_decimal_commas(line)):
            return lambda text: [cell.strip() for cell in next(csv.reader([text], delimiter=delimiter, strict=False))]
    return str.split


def _all_decimal_commas(line: str) -> bool:
    """Whether blanks separate and each comma is a decimal one: "0,00 0,15" but not "0, 0.15" nor "0,1"."""
    cells = line.split()
    return len(cells) > 1 and all(_DECIMAL_COMMA.fullmatch(cell) for cell in cells if "," in cell)


def _only_a_title(first: str, second: str) -> bool:
    """Whether a line names masses above the line that names columns, as Tracker writes: "mass_A,,"."""
    one, two = (_splitter(second)(line) for line in (first, second))
    return sum(bool(cell) for cell in one) == 1 < sum(bool(cell) for cell in two) and _is_header(two)


def _is_header(cells: list[str]) -> bool:
    return any(number(cell) is None and not is_date(cell) for cell in cells)


def find_column(table: Table, name: str) -> int:
    """Index of the column of that name, or number from 1; `UsageError`: there is none, or the name stands twice."""
    bare = [_BRACKET.sub("", each) for each in table.names]  # a header may say its unit
    for names in (list(table.names), bare):
        if names.count(name) > 1:
            raise UsageError(f"{table.source}: two columns are named '{name}'; give the number of the one you mean")
        if name in names:
            return names.index(name)
    width = len(table.names)
    if name.isascii() and name.isdigit() and 1 <= int(name) <= width:
        return int(name) - 1
    known = shown(", ".join(filter(None, table.names)), 400) or "none, there is no header"
    raise UsageError(f"{table.source}: has no column '{name}'; its names: {known}; or a number from 1 to {width}")


def choose_columns(table: Table, beside: set[int], wanted: Sequence[str]) -> dict[str, int]:
    """Trace label -> column, in the order of the request, or of the table if nothing is requested.

    A column without a requested label takes its header where that reads like a trace ("2", "1-2"), its order
    from 1 among the traces otherwise.

    `RecordError`: the table has no column beside the time. `UsageError`: a request that names no column, the time, or a
    label twice.
    """
    given = [_split(table, text) for text in wanted]
    given = given or [(column, "") for column in range(len(table.names)) if column not in beside]
    if not given:
        raise RecordError(f"{table.source}: has a single column; times and at least one column of angles are needed")
    chosen: dict[str, int] = {}
    for order, (column, requested) in enumerate(given, start=1):
        if column in beside:
            what = f"{table.source}: column {table.title(column)} is the time, or an acceleration"
            raise UsageError(f"{what}; name another with --column")
        name = _BRACKET.sub("", table.names[column])
        label = requested or (name if _NUMBERED_TRACE.fullmatch(name) else str(order))
        if label in chosen:
            raise UsageError(f"{table.source}: two columns become trace '{label}'; label them with --column NAME:TRACE")
        chosen[label] = column
    return chosen


def _split(table: Table, text: str) -> tuple[int, str]:
    """Column and label of NAME or NAME:TRACE; a column's name may itself hold a colon."""
    name, colon, label = text.rpartition(":")
    if not colon or text in table.names:
        return find_column(table, text), ""
    if not label:
        raise UsageError(f"--column {text}: a trace label must follow the colon, such as {name}:1-2")
    return find_column(table, name), label
