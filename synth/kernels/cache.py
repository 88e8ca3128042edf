"""Where compiled kernels are kept; known without numba, whose import takes a second.

One folder for each installation and the versions that it runs with; what a kernel in it was made from, its name tells
(`stored.py`).
"""

from __future__ import annotations

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
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path

_KEPT_GENERATIONS = 4  # older cache folders are removed, so that upgrades do not fill the disk
_INHERITED = "ISOCHRONY_CACHE"  # variable of the environment: where the process that started this one keeps kernels
_RUNS_WITH = ("numba", "llvmlite", "numpy", "scipy")
WATCHERS: list[Callable[[str], None]] = []
"""Told the name of every kernel that is about to be compiled for Python."""


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
    own = (each for each in base.iterdir() if re.fullmatch("[0-9a-f]{16}", each.name) and each.is_dir())
    generations = sorted(own, key=lambda each: each.stat().st_mtime)
    for stale in generations[: max(0, len(generations) - _KEPT_GENERATIONS + 1)]:
        shutil.rmtree(stale, ignore_errors=True)
