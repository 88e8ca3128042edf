"""The log of a batch for machines: one JSON object a line, what happened and when."""

from __future__ import annotations

import contextlib
import datetime
import json
import os
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from data_schemas.contents import shown
from data_schemas.errors import FileError
from data_schemas.writing import reason
from pipeline.batch.ledger import open_to_append

NAME = "batch.log.jsonl"


class Log:
    """Events appended to a file; a context manager. The ledger counts, the log only tells: nothing waits for the disk.

    `FileError` where it cannot be written, also from `event`.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / NAME
        try:
            self._file = os.fdopen(open_to_append(self._path), "a", encoding="utf-8")
        except OSError as error:
            raise FileError(f"{shown(self._path, 400)}: cannot be written, {reason(error)}") from None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        with contextlib.suppress(OSError):  # what could not be written, `event` told of
            self._file.close()

    def event(self, name: str, **fields: Any) -> None:
        """Tell of one event; the time is UTC."""
        now = datetime.datetime.now(datetime.UTC).isoformat(timespec="milliseconds")
        try:
            self._file.write(json.dumps({"time": now, "event": name, **fields}) + "\n")
            self._file.flush()
        except OSError as error:
            raise FileError(f"{shown(self._path, 400)}: cannot be written, {reason(error)}") from None
