"""The kinds of file: which groups and which attributes each must and may hold."""

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

    schema: str  # value of the root attribute of that name
    groups: Mapping[str, bool]  # those that it knows, and whether each must be there
    attrs: Mapping[str, bool]  # of the root, and whether each must be there
    one_of: tuple[str, ...] = ()  # groups of which at least one must be there
    json_attrs: tuple[str, ...] = ()  # root attributes whose text is JSON
    root: str = ""  # group of the table of variables whose rows stand at the root, in place of a time
    version: str = VERSION  # of the root attribute schema_version; older files are brought up to it as they are read


def root_attributes(kind: Kind, record_id: str, **words: str) -> dict[str, str]:
    """What every file says at its root, and further words: title, history, source."""
    layout = LAYOUTS[kind]
    named = {"Conventions": CONVENTIONS, "schema": layout.schema, "schema_version": layout.version}
    return {**named, "record_id": record_id, **words}


def _known(required: str = "", optional: str = "") -> dict[str, bool]:
    """Names apart by blanks, and whether each must be there."""
    return dict.fromkeys(required.split(), True) | dict.fromkeys(optional.split(), False)


_COMMON = _known("schema schema_version record_id", "Conventions title history source")

LAYOUTS: Mapping[Kind, Layout] = {
    # the instrument may be absent only from a record with a single trace: checking says so
    "record": Layout("isochrony-record", _known("record", "instrument film"), _COMMON),
    "truth": Layout("isochrony-truth", _known("truth"), _COMMON | _known("scene seed"), json_attrs=("scene",)),
    "result": Layout(
        "isochrony-result",
        _known("", "gravity phases correction course ship difference spectrum pendulums period synchrony"),
        _COMMON | _known("input_sha256 configuration versions", "command elapsed_s numbers_sha256"),
        one_of=("gravity", "period", "synchrony"),
        json_attrs=("configuration", "versions"),
        version="2",
    ),
    "film-truth": Layout(
        "isochrony-film-truth",
        _known("slices marks"),
        _COMMON | _known("film seed", "scene"),
        json_attrs=("film", "scene"),
    ),
    "summary": Layout("isochrony-summary", {}, _known("schema schema_version", "Conventions"), root="summary"),
}
