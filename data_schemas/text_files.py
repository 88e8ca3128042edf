"""Files of anybody's making: ordinary ones of a bounded size alone, for a pipe, a device, /proc may never end."""

import hashlib
import os
import re
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .contents import shown
from .errors import FileError, IsochronyError

MOST_BYTES = 1 << 35  # of any file: an hour of film in the finest scan has a thirtieth
MOST_TEXT = 1 << 28  # bytes of a table: a day at 25 Hz has half of them
MOST_LINE = 1 << 16  # bytes of a line of it
MOST_TOML, MOST_PARTS = 1 << 24, 100  # bytes, parts of a key
_LONG_KEY = re.compile(rb"(?<![\w\"'-])(?:[\w\"'-]++[ \t]*+\.[ \t]*+){%d}" % MOST_PARTS)


def ordinary_size(path: str | os.PathLike[str], most: int, remedy: str, error: type[IsochronyError] = FileError) -> int:
    """Bytes of a file that may be opened; `error`, with `remedy`: missing, not ordinary, empty, beyond `most` bytes."""
    name = shown(path, 400)
    try:
        status = os.stat(path)
    except (OSError, ValueError) as fault:  # a name with a null character is a ValueError
        why = getattr(fault, "strerror", None) or fault
        raise error(f"{name}: cannot be read ({why}); give the path of an existing file") from None
    if not stat.S_ISREG(status.st_mode):
        kind = "a folder" if stat.S_ISDIR(status.st_mode) else "not an ordinary file"
        raise error(f"{name}: is {kind}; {remedy}")
    if not status.st_size:
        raise error(f"{name}: is empty; {remedy}")
    if status.st_size > most:
        raise error(f"{name}: has {status.st_size} bytes, more than {most}; {remedy}")
    return status.st_size


def file_sha256(path: str | os.PathLike[str]) -> str:
    """Hexadecimal SHA-256 of an ordinary file; `FileError`: missing, unreadable, too large, a folder, a FIFO."""
    ordinary_size(path, MOST_BYTES, "give one")
    try:
        with open(path, "rb", buffering=0) as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise FileError(f"{shown(path, 400)}: {error.strerror}; give the path of a file that can be read") from None


def text_of(path: str | os.PathLike[str], remedy: str, error: type[IsochronyError] = FileError) -> str:
    """UTF-8 text of a table; `error`: as `ordinary_size`, no text, or a line of more than `MOST_LINE` bytes."""
    ordinary_size(path, MOST_TEXT, remedy, error)
    name = shown(path, 400)
    try:
        raw = Path(path).read_bytes()
        for number, line in enumerate(raw.splitlines(), start=1):
            if len(line) > MOST_LINE:
                raise error(f"{name}: line {number} has {len(line)} bytes, more than {MOST_LINE}; {remedy}")
        if b"\0" not in raw:
            return raw.decode("utf-8-sig")
    except OSError as fault:
        raise error(f"{name}: cannot be read ({fault.strerror}); make the file readable") from None
    except UnicodeDecodeError:
        pass  # as text with a null character, it is of another kind
    raise error(f"{name}: is not UTF-8 text; export it as CSV (UTF-8)")


def load_toml(path: str | os.PathLike[str], what: str, error: type[IsochronyError]) -> dict[str, Any]:
    """Content of a TOML file that should hold `what` ("a scene"); `error`: the file, what is wrong and the remedy."""
    import tomllib

    path = Path(path)
    remedy = f"give the path of {what} in TOML"
    ordinary_size(path, MOST_TOML, remedy, error)
    try:
        raw = path.read_bytes()
        if not _LONG_KEY.search(raw):  # each part is looked up from the first on
            return tomllib.loads(raw.decode("utf-8"))
        fault = f"is not TOML of {what}: a key of more than {MOST_PARTS} parts; {remedy}"
    except OSError as failure:
        fault = f"cannot be read ({failure.strerror}); {remedy}"
    except UnicodeDecodeError:
        fault = f"is not text in UTF-8; {remedy}"
    except RecursionError:
        fault = f"is not TOML of {what}: nested too deeply; {remedy}"
    except ValueError as failure:  # of TOML, or a number too long to be one
        fault = f"is not TOML: {' '.join(str(failure).split())}"
    raise error(f"{path}: {fault}")


def toml_text(content: Mapping[str, Any]) -> str:
    """A mapping of plain values, lists and tables as TOML; None is left out."""
    import tomli_w

    return tomli_w.dumps(_without_none(content))


def _without_none(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _without_none(each) for name, each in value.items() if each is not None}
    return [_without_none(each) for each in value] if isinstance(value, list | tuple) else value
