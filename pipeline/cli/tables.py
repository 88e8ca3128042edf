"""Rows on stdout, a table for people or JSON Lines; faults and progress bars on stderr."""

import contextlib
import json
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from textwrap import TextWrapper
from typing import Any, NamedTuple, TextIO

LINE = 80  # columns
SPACE = 2  # between columns


class Column(NamedTuple):
    """One column: its heading, its width, and whether its cells stand right (``>``, numbers) or left (``<``)."""

    heading: str
    width: int
    side: str


def columns(*texts: str) -> tuple[Column, ...]:
    """Columns from texts such as ``"gravity m/s2 >12"``: heading, side on which the cells stand, least width."""
    parts = (text.rpartition(" ") for text in texts)
    return tuple(Column(heading, max(len(heading), int(place[1:])), place[0]) for heading, _, place in parts)


def print_header(columns: Sequence[Column]) -> None:
    """Print the headings of a table."""
    print_row(columns, [column.heading for column in columns])


def print_row(columns: Sequence[Column], cells: Sequence[str]) -> None:
    """Print one line of a table at once: a long run shows each row when it is done."""
    padded = (f"{text:{column.side}{column.width}}" for column, text in zip(columns, cells, strict=False))
    print((" " * SPACE).join(padded).rstrip(), flush=True)


def print_text(text: str, indent: int = 4, more: int = 0) -> None:
    """Print a sentence below a row, in lines that no terminal breaks; those after the first stand `more` deeper."""
    first, others = " " * indent, " " * (indent + more)
    words = TextWrapper(LINE, first, others, break_long_words=False, break_on_hyphens=False)
    print(words.fill(text), flush=True)


def width_of(columns: Sequence[Column]) -> int:
    """Of a table."""
    return sum(column.width + SPACE for column in columns) - SPACE


def blocks(columns: Sequence[Column]) -> list[list[int]]:
    """Places of the columns of each part of a table that a line of a terminal holds; the first column leads each."""
    found, part = [], [0]
    for place in range(1, len(columns)):
        if len(part) > 1 and width_of([columns[each] for each in (*part, place)]) > LINE:
            found.append(part)
            part = [0]
        part.append(place)
    return [*found, part]


def complain(text: object) -> None:
    """Say in one line on stderr what is wrong; nothing of it reaches the terminal as a command."""
    print(f"isochrony: {printable(' '.join(str(text).split()))}", file=sys.stderr, flush=True)


def printable(text: str, kept: str = "") -> str:
    r"""Text whose control characters are question marks; those to be kept are named, as are bytes that are no UTF-8.

    >>> printable("a\x1b[31m\n", kept="\n")
    'a?[31m\n'
    """
    escaped = range(0xD800, 0xE000)  # by the stream
    return "".join(each if each.isprintable() or each in kept or ord(each) in escaped else "?" for each in text)


class Printable:
    """A stream for people: letters and lines pass, commands to the terminal do not."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write what can be printed."""
        return self._stream.write(printable(text, "\n\t"))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def print_table(rows: Sequence[Mapping[str, Any]]) -> None:
    """Print rows that share their keys as a table whose columns are as wide as they need be, in parts if need be."""
    keys = list(dict.fromkeys(key for row in rows for key in row))
    cells = {key: [text(row.get(key)) for row in rows] for key in keys}
    sides = [">" if _are_numbers(row.get(key) for row in rows) else "<" for key in keys]
    shown = [Column(key, max(map(len, (key, *cells[key]))), side) for key, side in zip(keys, sides, strict=True)]
    for number, places in enumerate(blocks(shown) if rows else []):
        print("\n" * (number > 0), end="")
        part = [shown[each] for each in places]
        print_header(part)
        for line in zip(*(cells[column.heading] for column in part), strict=True):
            print_row(part, line)


def print_json(row: Mapping[str, Any]) -> None:
    """Print one JSON object on one line; not-a-number and infinite become null."""
    text = json.dumps(plain(row), ensure_ascii=False, allow_nan=False)
    print("".join(each if each.isprintable() else json.dumps(each)[1:-1] for each in text), flush=True)


def plain(value: Any) -> Any:
    """Turn a nest of mappings, sequences and NumPy scalars into what JSON knows.

    >>> plain({"sigma": float("nan"), "flags": ("short_record",)})
    {'sigma': None, 'flags': ['short_record']}
    """
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if hasattr(value, "tolist"):  # a NumPy scalar or array, without importing NumPy
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def text(value: Any) -> str:
    """Show one value to a person: four significant digits, a dash where there is none.

    >>> text(0.0012345), text(None), text(True), text(12)
    ('0.001234', '-', 'yes', '12')
    """
    value = plain(value)
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}"
    return str(value)


def _are_numbers(values: Iterable[Any]) -> bool:
    known = [value for value in map(plain, values) if value is not None]
    return all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in known)


@contextlib.contextmanager
def progress(what: str, unit: str) -> Iterator[Callable[..., None] | None]:
    """A function of stage, if any, done and total that draws a bar on stderr after half a second; None: no terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    from tqdm import tqdm

    with tqdm(desc=what, unit=unit, unit_scale=True, file=sys.stderr, leave=False, delay=0.5) as bar:

        def draw(*told: str | int, note: str = "") -> None:
            *stage, done, total = told
            name = ": ".join([what, *map(str, stage)])
            if stage and (bar.desc != f"{name}: " or total != bar.total):
                bar.reset(total)
                bar.set_description(name, refresh=False)
            bar.total = total
            bar.set_postfix_str(note, refresh=False)
            bar.update(done - bar.n)

        yield draw
