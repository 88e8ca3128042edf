"""Which columns of a table become which traces."""

from __future__ import annotations

import re
from collections.abc import Sequence

from data_schemas.contents import shown
from data_schemas.errors import RecordError, UsageError
from pipeline.importing.table import Table

_NUMBERED_TRACE = re.compile(r"\d+(-\d+)*")


def find_column(table: Table, name: str) -> int:
    """Index of the column of that name, or of that number from 1 if no column has the name.

    Raises
    ------
    UsageError
        There is no such column, or the name stands twice.
    """
    if name in table.names:
        if table.names.count(name) > 1:
            raise UsageError(f"{table.source}: two columns are named '{name}'; give the number of the one you mean")
        return table.names.index(name)
    width = len(table.names)
    if name.isascii() and name.isdigit() and 1 <= int(name) <= width:
        return int(name) - 1
    known = shown(", ".join(filter(None, table.names)), 400) or "none, there is no header"
    raise UsageError(f"{table.source}: has no column '{name}'; its names: {known}; or a number from 1 to {width}")


def choose_columns(table: Table, time_column: int, wanted: Sequence[str]) -> dict[str, int]:
    """Trace label -> column, in the order of the request, or of the table if nothing is requested.

    A column without a requested label takes its header where that reads like a trace ("2", "1-2"), its order
    from 1 among the traces otherwise.

    Raises
    ------
    RecordError
        The table has no column beside the time.
    UsageError
        A request that names no column, the time, or a label twice.
    """
    if wanted:
        given = [_split(table, text) for text in wanted]
    else:
        given = [(column, "") for column in range(len(table.names)) if column != time_column]
    if not given:
        raise RecordError(f"{table.source}: has a single column; times and at least one column of angles are needed")
    chosen: dict[str, int] = {}
    for order, (column, requested) in enumerate(given, start=1):
        if column == time_column:
            raise UsageError(f"{table.source}: column {table.title(column)} is the time; name another with --column")
        name = table.names[column]
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
