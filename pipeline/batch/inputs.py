"""Which files a command line means, of which kind each is, and what its result is called."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from data_schemas.errors import UsageError
from pipeline.batch.config import Kind


class Input(NamedTuple):
    """One file to work on."""

    path: Path
    kind: Kind
    name: str
    """Its path below the inputs' common folder, without the ending of its kind."""


def find_inputs(words: Sequence[str], kinds: Sequence[Kind]) -> list[Input]:
    """Files, glob patterns and folders, which are searched with all below them; each file once, in order of name.

    Parameters
    ----------
    words : sequence of str
    kinds : sequence of Kind

    Raises
    ------
    UsageError
        A pattern or folder without any file, a file of no known kind.
    """
    found: dict[Path, Kind] = {}
    for word in words:
        paths = list(_meant(word, kinds))
        if not paths:
            endings = ", ".join(kind.endings[0] for kind in kinds if kind.searched)
            raise UsageError(f"{word}: there is no {endings} file; name files, a pattern in quotes, or a folder")
        for path in paths:
            found[Path(os.path.abspath(path))] = kind_of(path, kinds)
    base = Path(os.path.commonpath([path.parent for path in found]))
    return [Input(path, kind, _name(path.relative_to(base), kind)) for path, kind in found.items()]


def kind_of(path: Path, kinds: Sequence[Kind]) -> Kind:
    """Kind of a file by its ending; the longest that fits.

    Raises
    ------
    UsageError
        None fits.
    """
    fits = [(len(ending), kind) for kind in kinds for ending in kind.endings if path.name.endswith(ending)]
    if not fits:
        known = "; ".join(f"{kind.name} ({', '.join(kind.endings)})" for kind in kinds)
        raise UsageError(f"{path}: is of no kind that batch knows by its ending; it knows {known}")
    return max(fits, key=lambda fit: fit[0])[1]


def _meant(word: str, kinds: Sequence[Kind]) -> Iterator[Path]:
    path = Path(word)
    endings = tuple(kind.endings[0] for kind in kinds if kind.searched)
    if path.is_dir():
        for folder, below, names in os.walk(path):
            below.sort()
            yield from (Path(folder, name) for name in sorted(names) if name.endswith(endings))
    elif glob.has_magic(word) and not path.exists():
        yield from (Path(one) for one in sorted(glob.glob(word, recursive=True)))
    else:
        yield path  # also one that is not there: told as the outcome of that input


def _name(path: Path, kind: Kind) -> str:
    ending = next(one for one in sorted(kind.endings, key=len, reverse=True) if path.name.endswith(one))
    return path.as_posix().removesuffix(ending)
