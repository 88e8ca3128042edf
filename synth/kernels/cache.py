"""Where compiled kernels are kept, and what they were made from; known without numba, whose import takes a second.

One folder for each installation and its versions. A kernel's file name holds a digest (`stamp`) of its own source and
of all of the project that its source imports, in turn, as read from the text: an edit recompiles what depends on it.
"""

import atexit
import contextlib
import functools
import hashlib
import os
import re
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from importlib.metadata import version
from pathlib import Path

_UNUSED = 30 * 86400.0  # s after which kernels are removed, so that upgrades do not fill the disk
_INHERITED = "ISOCHRONY_CACHE"  # variable of the environment: where the process that started this one keeps kernels
_RUNS_WITH = ("numba", "llvmlite", "numpy", "scipy")
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
WATCHERS: list[Callable[[str], None]] = []  # told the name of every kernel that is about to be compiled for Python


@functools.cache
def cache_folder() -> Path:
    """Folder for compiled kernels, of this installation; created on first use."""
    versions = " ".join([*map(version, _RUNS_WITH), str(sys.implementation.cache_tag)])
    digest = hashlib.sha256(f"{versions} {Path(__file__).parent}".encode())
    base = next((each for each in _bases() if _made(each)), None) or _fresh()
    folder = base / digest.hexdigest()[:16]
    if not folder.exists():
        _prune(base)
    with contextlib.suppress(OSError):
        os.utime(folder)  # in use
    if not _made(folder) or not all(_is_own(each.lstat()) for each in folder.rglob("*")):
        folder = _fresh() / folder.name
        folder.mkdir(mode=0o700, exist_ok=True)
    return folder


def _bases() -> Iterator[Path]:
    """Where kernels may be kept: what is loaded from there is run, so never a place that others may make."""
    own = os.path.expanduser("~/.cache") if os.environ.get("HOME", "unset") else ""
    for home in (os.environ.get(_INHERITED), os.environ.get("XDG_CACHE_HOME"), own):
        if home and os.path.isabs(home):
            yield Path(os.path.realpath(home)) / "isochrony"


def _made(folder: Path) -> bool:
    """Whether a folder is there, or can be made, that nobody else can write to or replace and this process can use."""
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
        status = folder.lstat()
        if not (stat.S_ISDIR(status.st_mode) and _is_own(status) and all(map(_keeps, [folder, *folder.parents]))):
            return False
        folder.chmod(0o700)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _is_own(status: os.stat_result) -> bool:
    """Whether it is this user's, and neither a link nor open to all for writing."""
    mine = not hasattr(os, "getuid") or (status.st_uid == os.getuid() and not status.st_mode & stat.S_IWOTH)
    return mine and not stat.S_ISLNK(status.st_mode)


def _keeps(folder: Path) -> bool:
    """Whether no other user can replace what a folder holds."""
    status = folder.stat()
    safe = not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH) or bool(status.st_mode & stat.S_ISVTX)
    return not hasattr(os, "getuid") or (safe and status.st_uid in (0, os.getuid()))


def _fresh() -> Path:
    """A private folder for as long as this process lives, which those that it starts take too."""
    home = tempfile.mkdtemp(prefix="isochrony-")
    atexit.register(shutil.rmtree, home, ignore_errors=True)
    os.environ[_INHERITED] = home
    base = Path(home) / "isochrony"
    base.mkdir(mode=0o700)
    return base


def _prune(base: Path) -> None:
    """Remove what has not been used for long: an upgrade leaves kernels, another environment still needs its own."""
    for each in base.iterdir():
        if re.fullmatch("[0-9a-f]{16}", each.name) and time.time() - each.stat().st_mtime > _UNUSED:
            shutil.rmtree(each, ignore_errors=True)


def stamp(file: str, modules: Iterable[str] = ()) -> str | None:
    """Digest of all that a kernel in `file` was made from; None where a part changed after this process began."""
    found = closure([Path(file), *(path for name in modules for path in _files(name))])
    if any(_changed(path) >= _BEGUN for path in found):
        return None
    told = hashlib.sha256()
    for path in sorted(found):
        told.update(path.as_posix().encode() + b"\0" + found[path])
    return told.hexdigest()[:16]


def closure(begin: Iterable[Path]) -> dict[Path, bytes]:
    """Digests of files, and of the files of the project that they import, in turn."""
    found: dict[Path, bytes] = {}
    left = list(begin)
    while left:
        path = left.pop()
        if path in found:
            continue
        found[path], imports = _read(path, _changed(path))
        left += imports
        if path in _files(_REGISTRY):
            left += [other for other in (ROOT / "synth").rglob("*.py") if path in _read(other, _changed(other))[1]]
    return found


def _changed(path: Path) -> float:
    """When a file was last written or replaced."""
    status = path.stat()
    return max(status.st_mtime, status.st_ctime)


@functools.cache
def _read(path: Path, changed: float) -> tuple[bytes, list[Path]]:
    """Digest of a file as of some time, and what it imports of the project."""
    text = path.read_bytes()
    imports = (_named(*match.groups()) for match in _IMPORT.finditer(text.decode(errors="replace")))
    return hashlib.sha256(text).digest(), [each for paths in imports for each in paths]


def _named(package: str | None, names: str, modules: str | None) -> list[Path]:
    """Files of an import statement: the module itself and, of a package, those of its modules that it names."""
    if package is None:
        return [path for each in (modules or "").split(",") for path in _files(each.split()[0])]
    return _files(package) + [path for each in re.findall(r"\w+", names) for path in _files(f"{package}.{each}")]


@functools.cache
def _files(module: str) -> list[Path]:
    place = ROOT.joinpath(*module.split("."))
    return [path for path in (place.with_suffix(".py"), place / "__init__.py") if path.is_file()]
