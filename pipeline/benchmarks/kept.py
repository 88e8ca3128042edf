"""Finished points of a suite, kept in a folder: an interrupted run goes on where it stopped.

A point is found again by what it is and by what computed it: the hash of its configuration and of every source that
may move its numbers. Changed code is computed anew, never mixed with old results.
"""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from data_schemas.writing import write_text

_PACKAGES = ("data_schemas", "synth", "pipeline")
_NO_NUMBERS = ("cli", "plots")  # parts of `pipeline` that present what others compute


class Kept:
    """Results by configuration: in memory while the suite runs, and in `points/` of a folder if one is named."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = None if folder is None else folder / "points"
        self._known: dict[str, list[dict[str, Any]]] = {}

    def get(self, configuration: Mapping[str, Any]) -> list[dict[str, Any]] | None:
        """Rows of a point that was finished before; None if it was not, or if its file cannot be understood."""
        name = _name(configuration)
        if self._folder is not None and name not in self._known:
            try:
                self._known[name] = json.loads((self._folder / name).read_text(encoding="utf-8"))["rows"]
            except (OSError, ValueError, KeyError):
                return None
        return self._known.get(name)

    def put(self, configuration: Mapping[str, Any], rows: list[dict[str, Any]]) -> None:
        """Keep a finished point: whole, or not at all."""
        name = _name(configuration)
        self._known[name] = rows
        if self._folder is None:
            return
        self._folder.mkdir(exist_ok=True)
        text = json.dumps({"configuration": configuration, "rows": rows}, indent=1)
        write_text(text, self._folder / name, overwrite=True)


def _name(configuration: Mapping[str, Any]) -> str:
    said = json.dumps([sources(), configuration], sort_keys=True)
    return f"{hashlib.sha256(said.encode()).hexdigest()[:24]}.json"


@functools.cache
def sources() -> str:
    """SHA-256 of the code that simulates and reduces."""
    digest = hashlib.sha256()
    root = Path(__file__).parents[2]
    for package in _PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            place = path.relative_to(root)
            if package == "pipeline" and place.parts[1] in _NO_NUMBERS:
                continue
            digest.update(place.as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()
