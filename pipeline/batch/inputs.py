"""Which files a command line means, of which kind each is, what its result is called; grids of values for scenes."""

import glob
import itertools
import math
import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from data_schemas.errors import UsageError
from pipeline.batch.job import Kind

_SEPARATOR = f"/{re.escape(os.sep)}"
_DEEP = re.compile(rf"(?<![^{_SEPARATOR}])\*\*[{_SEPARATOR}]")  # The ``**/`` of a pattern that means any folders


class Input(NamedTuple):
    """One file to work on."""

    path: Path
    kind: Kind
    name: str  # Its path below the inputs' common folder, without the ending of its kind


def find_inputs(words: Sequence[str], kinds: Sequence[Kind]) -> list[Input]:
    """Files, patterns, folders with all below them, each file once, by name; `UsageError` for words that mean none."""
    found: dict[Path, tuple[Kind, str]] = {}
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
    return [
        Input(path, kind, path.relative_to(base).as_posix().removesuffix(ending))
        for path, (kind, ending) in found.items()
    ]


def kind_of(path: Path, kinds: Sequence[Kind]) -> tuple[Kind, str]:
    """Kind of a file by its ending, the longest that fits, and this ending; `UsageError` where none does."""
    fits = [(len(ending), kind, ending) for kind in kinds for ending in kind.endings if path.name.endswith(ending)]
    if not fits:
        known = "; ".join(f"{kind.name} ({', '.join(kind.endings)})" for kind in kinds)
        raise UsageError(f"{path}: is of no kind that batch knows by its ending; it knows {known}")
    return max(fits, key=lambda fit: fit[0])[1:]


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


MOST = 1_000_000  # Points of a grid

Variant = tuple[tuple[str, Any], ...]  # One point: keys of the scene by dotted path, each with its value


def parse_sweep(word: str) -> tuple[str, list[Any]]:
    """A key and its values from ``KEY=A,B,C`` or ``KEY=LOW:HIGH:COUNT`` (evenly spaced, both ends included).

    `UsageError` for neither form, or no number where one must be.

    Examples
    --------
    >>> parse_sweep("gravity=9.7:9.9:3")
    ('gravity', [9.7, 9.8, 9.9])
    >>> parse_sweep("recording.sampling_rate=10,25")
    ('recording.sampling_rate', [10, 25])
    """
    key, given, text = word.partition("=")
    values = _values(text) if key and given else None
    if not values:
        raise UsageError(f"--sweep wants KEY=A,B,C or KEY=LOW:HIGH:COUNT, such as gravity=9.7:9.9:5, not '{word}'")
    return key, values


def grid(sweeps: Sequence[tuple[str, list[Any]]]) -> list[Variant]:
    """All points, the last key changing fastest; one empty point without any sweep.

    `UsageError` for a key twice, or too many points.

    Examples
    --------
    >>> grid([("a", [1, 2]), ("b", [3])])
    [(('a', 1), ('b', 3)), (('a', 2), ('b', 3))]
    """
    keys = [key for key, _ in sweeps]
    if len(set(keys)) < len(keys):
        raise UsageError("--sweep names a key twice; name each once")
    if math.prod(len(values) for _, values in sweeps) > MOST:
        raise UsageError(f"--sweep makes more than {MOST} points; make the grid smaller")
    return [tuple(zip(keys, point, strict=True)) for point in itertools.product(*(values for _, values in sweeps))]


def _values(text: str) -> list[Any] | None:
    ends = text.split(":")
    if len(ends) == 1:
        return [_value(word) for word in text.split(",")] if text else None
    try:
        low, high, count = float(ends[0]), float(ends[1]), int(ends[2])
    except (ValueError, IndexError):
        return None
    if len(ends) > 3 or not (math.isfinite(low) and math.isfinite(high) and 2 <= count <= MOST):
        return None
    # rounded in the fifteenth digit, as a person would write them
    return [float(f"{low + (high - low) * step / (count - 1):.15g}") for step in range(count)]


def _value(word: str) -> Any:
    for kind in (int, float):
        try:
            return kind(word)
        except ValueError:
            continue
    return word
