"""The ledger of a batch, one line of JSON an outcome, appended and brought to the disk by the parent alone; its log.

A line that tells of versions comes before those that refer to it. Every line ends with the CRC-32 of what stands before
it. A kill leaves at most one torn line, the last, which is cut off when the ledger is opened; a line that was damaged
counts as not there, and its input is done again. Of several lines of one key the last one holds.
"""

import contextlib
import datetime
import json
import os
import stat
import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, get_args

from data_schemas.contents import shown
from data_schemas.errors import FileError, UsageError
from data_schemas.variables import rows_of
from data_schemas.writing import reason, sync_folder
from pipeline.batch.job import Config, Outcome, Status

NAME, LOG = "ledger.jsonl", "batch.log.jsonl"
_CRC = ', "crc32": "'
_FIRST = b'{"versions": "'  # How a ledger begins
_TEXTS = ("key", "status", "configuration_sha256", "versions")
_MAY = ("error_class", "error", "input_sha256", "output_sha256")
_CELLS = {name: float | int | None if row.dtype == "f8" else str | None for name, row in rows_of("summary").items()}
MOST_LINE = 1 << 20  # bytes
_STRANGE = "is no ledger of a batch; move it away, or choose another -o"
_UNWRITABLE = "cannot be written, {}; then go on with --resume"


class Place(NamedTuple):
    """What is remembered of a line: enough to decide whether its result may be kept, and where to read the rest."""

    offset: int
    status: str
    input_sha256: str | None
    output_sha256: str | None
    configuration_sha256: str
    versions: str

    @classmethod
    def of(cls, offset: int, content: Mapping[str, Any]) -> "Place":
        """That of a line that begins at an offset."""
        return cls(offset, *(content[name] for name in cls._fields[1:]))

    def fits(self, config: Config, versions: str) -> bool:
        """Whether it was made with these settings and versions."""
        return self.versions == versions and self.configuration_sha256 == config.sha256


class Index:
    """What a ledger knows, as it is on the disk now; `FileError` where it cannot be read.

    `versions` is the JSON of what makes the numbers now; kept is its short name, as lines give it. `places` has a
    `Place` for each key.
    """

    def __init__(self, folder: Path, versions: str) -> None:
        self.path = folder / NAME
        self.versions = f"{zlib.crc32(versions.encode()):08x}"
        self.places: dict[str, Place] = {}
        self._told: set[str] = set()
        self._size = 0  # of the lines that are whole
        try:
            _own(self.path)
            with self.path.open("rb") as file:
                begun = line = file.readline(MOST_LINE)
                while line:
                    self._see(line)
                    line = file.readline(MOST_LINE)
        except OSError as error:
            raise _fault(self.path, f"{error.strerror}; make it readable") from None
        torn = not begun.endswith(b"\n") and _FIRST.startswith(begun.rstrip(b"\0")[: len(_FIRST)])
        torn = torn or (begun.startswith(b"\0") and begun.endswith(b'"}\n'))  # what a disk that failed left of a line
        if begun and not (self.places or self._told or torn):
            raise _fault(self.path, _STRANGE)

    def line(self, key: str) -> dict[str, Any]:
        """What the ledger says of a key; `FileError` where it cannot be read any more."""
        try:
            with self.path.open("rb") as file:
                file.seek(self.places[key].offset)
                content = content_of(file.readline())
        except OSError as error:
            raise _fault(self.path, f"{error.strerror}; make it readable") from None
        if content is None or not _is_outcome(content):
            raise _fault(self.path, f"the line of {shown(key)} was damaged meanwhile; use --resume")
        return content

    def _see(self, line: bytes) -> None:
        content = content_of(line)
        if content is not None and _is_outcome(content):
            self.places[content["key"]] = Place.of(self._size, content)
        elif content is not None and "key" not in content:
            self._told.add(str(content.get("versions")))
        if line.endswith(b"\n"):  # the last may be torn
            self._size += len(line)
        elif len(line) == MOST_LINE:
            raise _fault(self.path, _STRANGE)


def _own(path: Path) -> None:
    """Refuse what is no ordinary file, or a link to one."""
    if not stat.S_ISREG(os.lstat(path).st_mode):
        raise _fault(path, _STRANGE)


def _fault(path: Path, words: str) -> FileError:
    return FileError(f"{shown(path, 400)}: {words}")


def _is_outcome(content: dict[str, Any]) -> bool:
    """Whether a line tells of an outcome, with all that is asked of it later."""
    texts = all(isinstance(content.get(name), str) for name in _TEXTS)
    texts = texts and all(isinstance(content.get(name, 0), str | None) for name in _MAY)
    rows = content.get("rows")
    return texts and content["status"] in get_args(Status) and isinstance(rows, list) and all(map(_is_row, rows))


def _is_row(row: Any) -> bool:
    return isinstance(row, dict) and all(isinstance(row.get(name), kind) for name, kind in _CELLS.items())


def line_of(content: Mapping[str, Any]) -> bytes:
    """A content as a line with its CRC-32.

    Examples
    --------
    >>> line_of({"key": "a"})
    b'{"key": "a", "crc32": "5169b140"}\\n'
    >>> content_of(line_of({"key": "a"}))
    {'key': 'a'}
    """
    text = json.dumps(content, allow_nan=False).removesuffix("}")
    return f'{text}{_CRC}{zlib.crc32(text.encode()):08x}"}}\n'.encode()


def content_of(line: bytes) -> dict[str, Any] | None:
    """The content of a line; None if it is torn, damaged, or never was one."""
    text, mark, crc = line.lstrip(b"\0").rpartition(_CRC.encode())  # a disk that failed has these for a line before it
    if not mark or crc != f'{zlib.crc32(text):08x}"}}\n'.encode():
        return None
    try:
        content = json.loads(text + b"}")
    except (ValueError, RecursionError):
        return None
    return content if isinstance(content, dict) else None


def outcome_content(one: Outcome, configuration: str, versions: str) -> dict[str, Any]:
    """What the line of an outcome says."""
    told = {name: getattr(one, name) for name in ("key", "status", *_MAY)}
    made = {"configuration_sha256": configuration, "versions": versions}
    return told | made | {"seconds": one.seconds, "rows": list(one.rows)}


class Ledger(Index, contextlib.AbstractContextManager["Ledger"]):
    """The ledger of one folder, held by this process alone; a context manager.

    `UsageError` where another process writes to it, `FileError` where it cannot be read or written.

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
        with contextlib.ExitStack() as fault:
            try:
                if os.path.lexists(path):
                    _own(path)
                self._file = open_to_append(path)
                fault.callback(os.close, self._file)
                _hold(self._file, path)
                super().__init__(folder, versions)
                os.ftruncate(self._file, self._size)
                known = self.versions in self._told
                self._write([] if known else [line_of({"versions": self.versions, "of": json.loads(versions)})])
                sync_folder(folder)  # as the lines above: whoever wrote may have been killed before it did this
            except OSError as error:
                raise _fault(path, _UNWRITABLE.format(reason(error))) from None
            fault.pop_all()

    def __exit__(self, *_: object) -> None:
        os.close(self._file)

    def append(self, outcomes: Iterable[Outcome], configurations: Mapping[str, str]) -> None:
        """Write outcomes, each with its configuration's SHA-256, and wait for the disk; `FileError` if it fails."""
        lines, places, offset = [], {}, self._size
        for one in outcomes:
            content = outcome_content(one, configurations[one.key], self.versions)
            lines.append(line_of(content))
            places[one.key] = Place.of(offset, content)
            offset += len(lines[-1])
        try:
            self._write(lines)
        except OSError as error:
            raise _fault(self.path, _UNWRITABLE.format(reason(error))) from error
        self.places |= places

    def _write(self, lines: list[bytes]) -> None:
        left = b"".join(lines)
        size = len(left)
        while left:
            left = left[os.write(self._file, left) :]
        os.fsync(self._file)
        self._size += size


def open_to_append(path: Path) -> int:
    """A descriptor of a file, made where there is none; never what a link points to, nor a pipe that nobody reads."""
    how = os.O_WRONLY | os.O_CREAT | os.O_APPEND | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    return os.open(path, how, 0o666)


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


class Log(contextlib.AbstractContextManager["Log"]):
    """The log for machines, an object an event; nothing waits for the disk; `FileError` where it cannot be written."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / LOG
        try:
            self._file = os.fdopen(open_to_append(self._path), "a", encoding="utf-8")
        except OSError as error:
            raise _fault(self._path, f"cannot be written, {reason(error)}") from None

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(OSError):  # what could not be written, `event` told of
            self._file.close()

    def event(self, name: str, **fields: Any) -> None:
        """Tell of one event; the time is UTC."""
        now = datetime.datetime.now(datetime.UTC).isoformat(timespec="milliseconds")
        try:
            self._file.write(json.dumps({"time": now, "event": name, **fields}) + "\n")
            self._file.flush()
        except OSError as error:
            raise _fault(self._path, f"cannot be written, {reason(error)}") from None
