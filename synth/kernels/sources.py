"""What a compiled kernel was made from: its own source and all of the project that its source imports, in turn.

An edit of one file then recompiles what depends on it, and nothing else. Imports are read from the text, also those
inside functions; more than what is compiled may be among them, never less.
"""

from __future__ import annotations

import functools
import hashlib
import re
import time
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

PACKAGES = ("synth", "pipeline", "data_schemas")
ROOT = Path(__file__).parents[2]
_IMPORT = re.compile(
    rf"^[ \t]*(?:from[ \t]+((?:{'|'.join(PACKAGES)})\b[\w.]*)[ \t]+import[ \t]+(\([^)]*\)|[^\n]*)"
    rf"|import[ \t]+((?:{'|'.join(PACKAGES)})\b[\w., \t]*))",
    re.MULTILINE,
)
_REGISTRY = "synth.systems.dispatch"
"""Kernels that go through it call what other modules registered there, which they need not import."""
_BEGUN = time.time() - 0.01  # s: clocks of file systems are coarser


class Source(NamedTuple):
    """A file as it stands, and what it imports of the project."""

    digest: bytes
    imports: tuple[Path, ...]
    changed: float
    """Time at which it was last written or replaced."""


def stamp(file: str, modules: Iterable[str] = ()) -> str | None:
    """Name for all that a kernel was made from; None where a part of it changed after this process began.

    What such a process has loaded may be from before or after the change, and what it compiles is nobody else's.

    Parameters
    ----------
    file : str
        Where the kernel stands.
    modules : iterable of str
        Where the types of its arguments are defined.
    """
    found = closure([Path(file), *(path for name in modules for path in _files(name))])
    if any(source.changed >= _BEGUN for source in found.values()):
        return None
    told = hashlib.sha256()
    for path in sorted(found):
        told.update(path.as_posix().encode() + b"\0" + found[path].digest)
    return told.hexdigest()[:16]


def closure(begin: Iterable[Path]) -> dict[Path, Source]:
    """Files, and the files of the project that they import, in turn."""
    found: dict[Path, Source] = {}
    left = list(begin)
    while left:
        path = left.pop()
        if path in found:
            continue
        found[path] = _read(path)
        left += found[path].imports
        if path in _files(_REGISTRY):
            left += [other for other in (ROOT / "synth").rglob("*.py") if path in _read(other).imports]
    return found


def _read(path: Path) -> Source:
    status = path.stat()
    return _read_as_of(path, max(status.st_mtime, status.st_ctime))


@functools.cache
def _read_as_of(path: Path, changed: float) -> Source:
    text = path.read_bytes()
    imported = [each for match in _IMPORT.finditer(text.decode(errors="replace")) for each in _named(*match.groups())]
    return Source(hashlib.sha256(text).digest(), tuple(imported), changed)


def _named(package: str | None, names: str, modules: str | None) -> list[Path]:
    """Files of an import statement: the module itself and, of a package, those of its modules that it names."""
    if package is None:
        return [path for each in (modules or "").split(",") for path in _files(each.split()[0])]
    return _files(package) + [path for each in re.findall(r"\w+", names) for path in _files(f"{package}.{each}")]


@functools.cache
def _files(module: str) -> list[Path]:
    place = ROOT.joinpath(*module.split("."))
    return [path for path in (place.with_suffix(".py"), place / "__init__.py") if path.is_file()]
