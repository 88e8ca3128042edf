"""Reads TOML of anybody's making: ordinary files of a bounded size, every fault one line."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

from .errors import IsochronyError
from .ordinary import ordinary_size

MOST_BYTES, MOST_PARTS = 1 << 24, 100
_LONG_KEY = re.compile(rb"(?<![\w\"'-])(?:[\w\"'-]++[ \t]*+\.[ \t]*+){%d}" % MOST_PARTS)


def load_toml(path: str | os.PathLike[str], what: str, error: type[IsochronyError]) -> dict[str, Any]:
    """Content of a TOML file: nothing that could hang, or fill the memory.

    Parameters
    ----------
    path
        The file.
    what : str
        What it should hold, such as "a scene", for the remedy.
    error : type
        Of the exception.

    Raises
    ------
    error
        With one line that names the file, what is wrong and the remedy.
    """
    import tomllib

    path = Path(path)
    remedy = f"give the path of {what} in TOML"
    try:
        ordinary_size(path, MOST_BYTES, remedy, error)
        raw = path.read_bytes()
        if _LONG_KEY.search(raw):  # each part is looked up from the first on
            raise error(f"{path}: is not TOML of {what}: a key of more than {MOST_PARTS} parts; {remedy}")
        return tomllib.loads(raw.decode("utf-8"))
    except OSError as failure:
        raise error(f"{path}: cannot be read ({failure.strerror}); {remedy}") from None
    except UnicodeDecodeError:
        raise error(f"{path}: is not text in UTF-8; {remedy}") from None
    except RecursionError:
        raise error(f"{path}: is not TOML of {what}: nested too deeply; {remedy}") from None
    except ValueError as failure:  # of TOML, a number too long to be one, or a path that cannot be
        raise error(f"{path}: is not TOML: {' '.join(str(failure).split())}") from None
