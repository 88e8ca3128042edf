"""The kinds of file: which groups and which attributes each must and may hold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

VERSION = "1"  # of layouts that name no other, as stored in the attribute schema_version
CONVENTIONS = "CF-1.11"
REWRITTEN = "rewritten"
"""Root attribute, in memory, of a file that other software wrote again: its checksum no longer said anything."""

Kind = Literal["record", "truth", "result", "film-truth", "summary"]


@dataclass(frozen=True)
class Layout:
    """One kind of file."""

    schema: str
    """Value of the root attribute of that name."""
    groups: Mapping[str, bool]
    """The groups it knows, and whether each must be there."""
    attrs: Mapping[str, bool]
    """Root attributes it knows, and whether each must be there."""
    one_of: tuple[str, ...] = ()
    """Groups of which at least one must be there."""
    json_attrs: tuple[str, ...] = ()
    """Root attributes whose text is JSON."""
    root: str = ""
    """Group of the table of variables whose rows stand at the root, in place of a time."""
    version: str = VERSION
    """Value of the root attribute schema_version; older ones are brought up to it as they are read."""


def root_attributes(kind: Kind, record_id: str, **words: str) -> dict[str, str]:
    """What every file says at its root, and further words: title, history, source."""
    layout = LAYOUTS[kind]
    named = {"Conventions": CONVENTIONS, "schema": layout.schema, "schema_version": layout.version}
    return {**named, "record_id": record_id, **words}


_COMMON = {
    "Conventions": False,
    "schema": True,
    "schema_version": True,
    "record_id": True,
    "title": False,
    "history": False,
    "source": False,
}

LAYOUTS: Mapping[Kind, Layout] = {
    # the instrument may be absent only from a record with a single trace: checking_record says so
    "record": Layout("isochrony-record", {"record": True, "instrument": False, "film": False}, _COMMON),
    "truth": Layout(
        "isochrony-truth",
        {"truth": True},
        {**_COMMON, "scene": True, "seed": True},
        json_attrs=("scene",),
    ),
    "result": Layout(
        "isochrony-result",
        {
            "gravity": False,
            "phases": False,
            "correction": False,
            "course": False,
            "ship": False,
            "difference": False,
            "spectrum": False,
            "pendulums": False,
            "period": False,
            "synchrony": False,
        },
        {
            **_COMMON,
            "input_sha256": True,
            "configuration": True,
            "versions": True,
            "command": False,
            "elapsed_s": False,
            "numbers_sha256": False,
        },
        one_of=("gravity", "period", "synchrony"),
        json_attrs=("configuration", "versions"),
        version="2",
    ),
    "film-truth": Layout(
        "isochrony-film-truth",
        {"slices": True, "marks": True},
        {**_COMMON, "film": True, "seed": True, "scene": False},
        json_attrs=("film", "scene"),
    ),
    "summary": Layout(
        "isochrony-summary", {}, {"Conventions": False, "schema": True, "schema_version": True}, root="summary"
    ),
}
