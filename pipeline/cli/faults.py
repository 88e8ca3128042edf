"""Faults told to the user: the line names the file it is about; a file that a verb is going to use must be good."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import data_schemas
from data_schemas.errors import IsochronyError, RecordError, RefusedError
from data_schemas.layouts import LAYOUTS, REWRITTEN
from pipeline.cli.tables import complain

if TYPE_CHECKING:
    from xarray import DataTree

    from data_schemas.layouts import Kind


_INSTEAD = {
    "record": "isochrony process reduces it",
    "truth": "it is what the pipeline must not see: give NAME.record.nc of the same name",
    "result": "isochrony plot draws it; give NAME.record.nc to reduce again",
    "film-truth": "it is what the reader must not see: give the film to isochrony digitise",
    "summary": "it is a table of a batch: open it with xarray, or give its records",
}  # What to do with a file of each kind


def outcome_of(fault: IsochronyError) -> str:
    """Status of an input that gave nothing, as summaries have it."""
    return "refused" if isinstance(fault, RefusedError) else "failed"


def exit_status(good: int, total: int) -> int:
    """Exit status of a verb of which some inputs were good."""
    return 0 if good == total else 1 if good else 3


def read_checked(path: Path, kind: Kind) -> DataTree:
    """Read a file and check it against the layout of its kind.

    `FileError` where it cannot be read; `RecordError` where it is of another kind, or breaks its layout: further faults
    are counted.
    """
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
    """Raise `RecordError` with the first fault and the number of the others, if there are any.

    A file of another kind has many faults of which only that one matters.
    """
    if not faults:
        return
    faults = [fault for fault in faults if fault.startswith("attribute schema:")] or faults
    more = f" (and {len(faults) - 1} more: isochrony validate {path})" if len(faults) > 1 else ""
    raise RecordError(f"{path}: {faults[0]}{more}")
