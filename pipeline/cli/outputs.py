"""Where results go: `-o` as a file or a folder, and refusing to overwrite, decided before any work starts.

An orderly end when the system asks for one (SIGTERM), as after Ctrl-C: nothing half-written stays.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import FrameType

from data_schemas.errors import UsageError

_ENDINGS = (".record.nc", ".result.nc", ".truth.nc", ".nc", ".toml", ".csv", ".tsv", ".txt", ".dat")
_IMAGES = (".tif", ".tiff", ".png", ".jpg", ".jpeg")
STATUS = 128 + signal.SIGTERM  # exit status of a program that was asked to end, as shells count


def stem(path: Path) -> str:
    """File name without its folder and its kind.

    >>> stem(Path("a/ship.record.nc")), stem(Path("ship.v2.toml")), stem(Path("ship")), stem(Path("ship.film.tif"))
    ('ship', 'ship.v2', 'ship', 'ship')
    """
    name = path.name
    for ending in (*_ENDINGS, *(f".film{image}" for image in _IMAGES), *_IMAGES):
        if name.endswith(ending) and len(name) > len(ending):
            return name[: -len(ending)]
    return name


def place(inputs: Sequence[Path], out: str | None, ending: str) -> list[Path]:
    """Output path of each input.

    Parameters
    ----------
    inputs : sequence of Path
        The files named on the command line.
    out : str or None
        `-o`: a file for one input; a folder for several inputs, if it ends with `/`, or if it is one already.
        None puts each output beside its input.
    ending : str
        Ending of the outputs, such as ".result.nc".

    `UsageError` where the folder is a file, or the file's folder is not there.
    """
    if out is None:
        return [path.with_name(stem(path) + ending) for path in inputs]
    if not out:
        raise UsageError("-o wants a file or a folder, not an empty name")
    target = Path(out)
    if out.endswith(("/", os.sep)) or len(inputs) > 1 or os.path.isdir(target):
        if os.path.exists(target) and not os.path.isdir(target):
            raise UsageError(f"{target}: is a file, but -o must be a folder here; name another")
        return [target / (stem(path) + ending) for path in inputs]
    if not os.path.isdir(target.parent):
        raise UsageError(f"{target}: there is no folder '{target.parent}'; create it, or end -o with / for a folder")
    return [target]


def refuse_clashes(inputs: Sequence[Path], outputs: Sequence[Path], *, force: bool) -> None:
    """Raise `UsageError` where an output would destroy an input, another output, or, unforced, any file."""
    from data_schemas.writing import place_of

    # of os.path, which takes a name too long, or links in a circle, for a file that is not there
    taken: set[str] = set()
    sources = {place for path in inputs for place in (os.path.realpath(path), os.fspath(place_of(path)))}
    for output in outputs:
        resolved = os.fspath(place_of(output))
        if resolved in sources or os.path.realpath(output) in sources:
            raise UsageError(f"{output}: is an input and would be overwritten; name another output with -o")
        if resolved in taken:
            raise UsageError(f"{output}: two inputs would be written to it; name each input once, or rename one")
        taken.add(resolved)
        if os.path.isdir(output):
            raise UsageError(f"{output}: is a folder; name a file, or another folder, with -o")
        if os.path.lexists(output) and not force:
            raise UsageError(f"{output}: exists already; add --force to overwrite it, or choose another with -o")


def make_folder(output: Path) -> None:
    """Create the folder of an output just before it is written: a failed input leaves no empty folder."""
    from data_schemas.writing import sync_folder

    missing = [each for each in output.parents if not os.path.exists(each)]
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        for each in missing:
            sync_folder(each.parent)
    except OSError as fault:
        raise UsageError(f"{output.parent}: cannot be created ({fault.strerror}); choose another with -o") from fault


@contextlib.contextmanager
def folder_for_output(folder: Path) -> Iterator[None]:
    """Create a folder, with those above it, for what is written inside; what stays empty goes again."""
    missing = [each for each in (folder, *folder.parents) if not os.path.exists(each)]
    make_folder(folder / "output")
    try:
        yield
    finally:
        for each in missing:  # the deepest first
            with contextlib.suppress(OSError):  # not empty: something was written
                each.rmdir()


@contextlib.contextmanager
def orderly() -> Iterator[None]:
    """Turn SIGTERM into an exception for as long as files are being written."""

    def leave(_number: int, _frame: FrameType | None) -> None:
        sys.exit(STATUS)

    before = signal.signal(signal.SIGTERM, leave)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
