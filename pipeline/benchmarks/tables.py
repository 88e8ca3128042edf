"""A suite's rows: as files, and a progress bar for as long as they are made."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pipeline.cli.tables import plain

Row = dict[str, Any]
Item = TypeVar("Item")


def write(path: Path, table: Sequence[Mapping[str, Any]]) -> None:
    """Write rows that share their keys as CSV; no rows give an empty file."""
    with path.open("w", newline="", encoding="utf-8") as stream:
        if table:
            writer = csv.DictWriter(stream, list(table[0]))
            writer.writeheader()
            writer.writerows(table)


def write_json(path: Path, tables: Mapping[str, Any]) -> None:
    """Write tables by name as one file; not-a-number becomes null."""
    path.write_text(json.dumps(plain(tables), indent=1, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")


def progress(items: Iterable[Item], what: str, total: int | None = None) -> Iterator[Item]:
    """Pass items on; draw a bar if stderr is a terminal."""
    from tqdm import tqdm

    yield from tqdm(items, desc=what, total=total, disable=None, leave=False)
