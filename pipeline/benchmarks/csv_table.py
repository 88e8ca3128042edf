"""A suite's table as a file."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any


def write(path: Path, table: Sequence[Mapping[str, Any]]) -> None:
    """Write rows that share their keys as CSV; no rows give an empty file."""
    with path.open("w", newline="", encoding="utf-8") as stream:
        if table:
            writer = csv.DictWriter(stream, list(table[0]))
            writer.writeheader()
            writer.writerows(table)
