"""What a verb reads must be good, where its outputs go is decided before any work, and nothing is overwritten.

An orderly end when the system asks for one (SIGTERM), as after Ctrl-C: nothing half-written stays.
"""

import contextlib
import os
import signal
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

import data_schemas
from data_schemas.errors import IsochronyError, RecordError, RefusedError, UsageError, naming
from data_schemas.layouts import LAYOUTS, REWRITTEN
from pipeline.cli.tables import complain

if TYPE_CHECKING:
    from xarray import DataTree

    from data_schemas.layouts import Kind

_IMAGES = (".tif", ".tiff", ".png", ".jpg", ".jpeg")
_ENDINGS = (
    ".record.nc", ".result.nc", ".truth.nc", ".nc", ".toml", ".csv", ".tsv", ".txt", ".dat",
    *(f".film{image}" for image in _IMAGES), *_IMAGES,
)  # fmt: skip
STATUS = 128 + signal.SIGTERM  # exit status of a program that was asked to end, as shells count
_INSTEAD = {
    "record": "isochrony process reduces it",
    "truth": "it is what the pipeline must not see: give NAME.record.nc of the same name",
    "result": "isochrony plot draws it; give NAME.record.nc to reduce again",
    "film-truth": "it is what the reader must not see: give the film to isochrony digitise",
    "summary": "it is a table of a batch: open it with xarray, or give its records",
}  # What to do with a file of each kind


def outcome_of(fault: IsochronyError, path: Path, *, alone: bool) -> tuple[str, str]:
    """Status of an input that gave nothing, as summaries have it, and why; a wrong use of the only input is raised."""
    told = naming(path, str(fault))
    if alone and isinstance(fault, UsageError):
        raise type(fault)(told) from fault
    return "refused" if isinstance(fault, RefusedError) else "failed", told


def exit_status(good: int, total: int) -> int:
    """Exit status of a verb of which some inputs were good."""
    return 0 if good == total else 1 if good else 3


def read_checked(path: Path, kind: "Kind") -> "DataTree":
    """Read a file of a kind; `FileError`: it cannot be read; `RecordError`: another kind, or a broken layout."""
    tree = data_schemas.read(path)
    if REWRITTEN in tree.attrs:
        complain(f"{path}: was written again {tree.attrs[REWRITTEN]}")
    for other, layout in LAYOUTS.items():
        if other != kind and tree.attrs.get("schema") == layout.schema:
            wanted = f"a {kind} ({LAYOUTS[kind].schema!r})"
            raise RecordError(f"{path}: attribute schema: says a {other}, not {wanted}; {_INSTEAD[other]}")
    refuse_faults(path, data_schemas.check(tree, kind))
    return tree


def refuse_faults(path: Path, faults: list[str]) -> None:
    """Raise `RecordError` with the first fault and the number of the others; of another kind of file that one alone."""
    if faults:
        faults = [fault for fault in faults if fault.startswith("attribute schema:")] or faults
        more = f" (and {len(faults) - 1} more: isochrony validate {path})" if len(faults) > 1 else ""
        raise RecordError(f"{path}: {faults[0]}{more}")


def stem(path: Path) -> str:
    """File name without its folder and its kind.

    >>> stem(Path("a/ship.record.nc")), stem(Path("ship.v2.toml")), stem(Path("ship")), stem(Path("ship.film.tif"))
    ('ship', 'ship.v2', 'ship', 'ship')
    """
    fitting = (ending for ending in _ENDINGS if path.name.endswith(ending) and path.name != ending)
    return path.name.removesuffix(next(fitting, ""))


def place(inputs: Sequence[Path], out: str | None, ending: str) -> list[Path]:
    """Output path of each input: its stem with an ending such as ".result.nc".

    `out` is `-o`: a file for one input; a folder for several, if it ends with `/`, or if it is one already. None puts
    each output beside its input. `UsageError` where the folder is a file, or the file's folder is not there.
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

    told = []

    def leave(number: int, _frame: FrameType | None) -> None:
        told.append(number)
        sys.exit(STATUS)

    before = signal.signal(signal.SIGTERM, leave)
    try:
        yield
    except Exception:
        if told:  # some libraries make an error of their own of it
            sys.exit(STATUS)
        raise
    finally:
        signal.signal(signal.SIGTERM, before)


def store(tree: "DataTree", output: Path, *, force: bool) -> None:
    """Write a tree into a folder that is made for it if need be."""
    make_folder(output)
    data_schemas.write(tree, output, overwrite=force)
