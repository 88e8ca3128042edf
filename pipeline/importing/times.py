"""The time column of a text table: numbers of seconds or ISO dates, made seconds from the first row."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from decimal import Decimal

import numpy as np
from numpy.typing import NDArray

from data_schemas.contents import shown
from data_schemas.errors import RecordError
from pipeline.importing.table import Table, is_date

_NO_DATE = "2000-01-01T00:00:00Z"
_COARSE = 1e6  # s; from here on a float64 of the time itself is coarser than 0.1 ns


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
