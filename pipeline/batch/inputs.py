"""Which files a command line means, of which kind each is, and what its result is called."""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from data_schemas.errors import UsageError
from pipeline.batch.config import Kind

_SEPARATOR = f"/{re.escape(os.sep)}"
_DEEP = re.compile(rf"(?<![^{_SEPARATOR}])\*\*[{_SEPARATOR}]")
"""The ``**/`` of a pattern that means any folders."""


class Input(NamedTuple):
    """One file to work on."""

    path: Path
    kind: Kind
    name: str
    """Its path below the inputs' common folder, without the ending of its kind."""


def find_inputs(words: Sequence[str], kinds: Sequence[Kind]) -> list[Input]:
    """Files, glob patterns and folders, which are searched with all below them; each file once, in order of name.

    `UsageError` for an empty word, a pattern or folder without any file or that cannot be searched, a file of no known
    kind.
    """
    found: dict[Path, Kind] = {}
    for word in words:
        if not word:
            raise UsageError("an input has an empty name; name files, a pattern in quotes, or a folder")
        paths = list(_meant(word, kinds))
        if not paths:
            endings = ", ".join(kind.endings[0] for kind in kinds if kind.searched)
            raise UsageError(f"{word}: there is no {endings} file; name files, a pattern in quotes, or a folder")
        for path in paths:
            found[Path(os.path.abspath(path))] = kind_of(path, kinds)
    base = Path(os.path.commonpath([path.parent for path in found]))
    return [Input(path, kind, _name(path.relative_to(base), kind)) for path, kind in found.items()]


def kind_of(path: Path, kinds: Sequence[Kind]) -> Kind:
    """Kind of a file by its ending, the longest that fits; `UsageError` where none does."""
    fits = [(len(ending), kind) for kind in kinds for ending in kind.endings if path.name.endswith(ending)]
    if not fits:
        known = "; ".join(f"{kind.name} ({', '.join(kind.endings)})" for kind in kinds)
        raise UsageError(f"{path}: is of no kind that batch knows by its ending; it knows {known}")
    return max(fits, key=lambda fit: fit[0])[1]


def _meant(word: str, kinds: Sequence[Kind]) -> Iterator[Path]:
    endings = tuple(kind.endings[0] for kind in kinds if kind.searched)
    if os.path.isdir(word):
        for folder, below, names in os.walk(word, onerror=_unsearchable):
            below.sort()
            yield from (Path(folder, name) for name in sorted(names) if name.endswith(endings))
    elif glob.has_magic(word) and not os.path.exists(word):
        yield from (Path(one) for one in sorted(set(_matches(word))))
    else:
        yield Path(word)  # also one that is not there: told as the outcome of that input


def _matches(pattern: str) -> Iterator[str]:
    """What fits a pattern; below ``**`` links to folders are not followed, which could lead round and round."""
    before, *after = _DEEP.split(pattern, maxsplit=1)
    if not after:
        yield from glob.iglob(pattern)
        return
    for top in glob.iglob(before) if before else [os.curdir]:
        for folder, below, _ in os.walk(top, onerror=_unsearchable):
            below[:] = [name for name in below if not name.startswith(".")]
            yield from _matches(os.path.join(glob.escape(folder), after[0]))


def _unsearchable(error: OSError) -> None:
    raise UsageError(f"{error.filename}: cannot be searched ({error.strerror}); make it readable, or name its files")


def _name(path: Path, kind: Kind) -> str:
    ending = next(one for one in sorted(kind.endings, key=len, reverse=True) if path.name.endswith(one))
    return path.as_posix().removesuffix(ending)
