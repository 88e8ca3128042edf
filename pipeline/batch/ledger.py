"""The ledger of a batch: one line of JSON an outcome, appended and brought to the disk by the parent alone.

A line that tells of versions comes before those that refer to it. A torn end is cut off when the ledger is opened.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

from data_schemas.contents import shown
from data_schemas.errors import FileError, UsageError
from data_schemas.writing import reason, sync_folder
from pipeline.batch.ledger_index import NAME, Index, line_of, outcome_content, place
from pipeline.batch.outcome import Outcome


class Ledger(Index):
    """The ledger of one folder, held by this process alone; a context manager.

    Parameters
    ----------
    folder : Path
        Of the batch; it must exist.
    versions : str
        JSON of what makes the numbers now.

    Raises
    ------
    UsageError
        Another process writes to it.
    FileError
        It cannot be read or written.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder, Ledger(Path(folder), "{}") as ledger:
    ...     ledger.append([Outcome("a.result.nc", "ok")], {"a.result.nc": "f00d"})
    ...     ledger.places["a.result.nc"].status
    'ok'
    """

    def __init__(self, folder: Path, versions: str) -> None:
        path = folder / NAME
        try:
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
        except OSError as error:
            raise _fault(path, error) from None
        try:
            _hold(self._file, path)
            super().__init__(folder, versions)
            os.ftruncate(self._file, self._size)
            if self.versions not in self._told:
                self._write([line_of({"versions": self.versions, "of": json.loads(versions)})])
                sync_folder(folder)
        except OSError as error:
            os.close(self._file)
            raise _fault(path, error) from None
        except BaseException:
            os.close(self._file)
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        os.close(self._file)

    def append(self, outcomes: Iterable[Outcome], configurations: Mapping[str, str]) -> None:
        """Write outcomes, each a line, and wait until all are on the disk.

        Parameters
        ----------
        outcomes : iterable of Outcome
        configurations : mapping of str to str
            SHA-256 of each one's configuration by its key.

        Raises
        ------
        FileError
            The disk is full, or fails. What was written before stays good.
        """
        lines, places, offset = [], {}, self._size
        for one in outcomes:
            content = outcome_content(one, configurations[one.key], self.versions)
            lines.append(line_of(content))
            places[one.key] = place(offset, content)
            offset += len(lines[-1])
        try:
            self._write(lines)
        except OSError as error:
            raise _fault(self.path, error) from error
        self.places |= places

    def _write(self, lines: list[bytes]) -> None:
        left = b"".join(lines)
        size = len(left)
        while left:
            left = left[os.write(self._file, left) :]
        os.fsync(self._file)
        self._size += size


def _fault(path: Path, error: OSError) -> FileError:
    return FileError(f"{shown(path, 400)}: cannot be written, {reason(error)}; then go on with --resume")


def _hold(descriptor: int, path: Path) -> None:
    """Make sure that no other batch writes to the ledger; where the system has no locks, trust the user."""
    try:
        import fcntl
    except ImportError:
        return
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise UsageError(f"{shown(path, 400)}: another batch writes to it; wait for it, or choose another -o") from None
