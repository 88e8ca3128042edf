"""Files of anybody's making: ordinary ones of a bounded size alone, for a pipe, a device, /proc may never end."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from .contents import shown
from .errors import FileError, IsochronyError

MOST_BYTES = 1 << 35  # of any file: an hour of film in the finest scan has a thirtieth
MOST_TEXT = 1 << 28  # bytes of a table: a day at 25 Hz has half of them
MOST_LINE = 1 << 16  # bytes of a line of it


def ordinary_size(path: str | os.PathLike[str], most: int, remedy: str, error: type[IsochronyError] = FileError) -> int:
    """Bytes of a file that may be opened.

    Parameters
    ----------
    path : path
    most : int
        Bytes that such a file has at most.
    remedy : str
        What to give instead.
    error : type
        Of the exception.

    Raises
    ------
    IsochronyError
        As `error`: it is not there, no ordinary file, empty, or too large.
    """
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


def text_of(path: str | os.PathLike[str], remedy: str, error: type[IsochronyError] = FileError) -> str:
    """Text of a table in UTF-8, whose lines no reader chokes on.

    Raises
    ------
    IsochronyError
        As `error`: see `ordinary_size`; it is no text, or has a line of more than `MOST_LINE` bytes.
    """
    ordinary_size(path, MOST_TEXT, remedy, error)
    name = shown(path, 400)
    try:
        raw = Path(path).read_bytes()
    except OSError as fault:
        raise error(f"{name}: cannot be read ({fault.strerror}); make the file readable") from None
    for number, line in enumerate(raw.splitlines(), start=1):
        if len(line) > MOST_LINE:
            raise error(f"{name}: line {number} has {len(line)} bytes, more than {MOST_LINE}; {remedy}")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise error(f"{name}: is not UTF-8 text; export it as CSV (UTF-8)")
    return text
