"""The kinds of file: which groups and which attributes each must and may hold; older and foreign content brought to it.

Packing is that of CF 2.5.1 and 8.1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from .contents import Contents, Entry, key, shown
from .errors import FileError

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

PACKING = ("scale_factor", "add_offset", "_FillValue", "missing_value")
_UNITS = {
    "nanoseconds": 1e-9, "microseconds": 1e-6, "milliseconds": 1e-3, "minutes": 60.0, "hours": 3600.0, "days": 86400.0,
}  # fmt: skip


def current(contents: Contents) -> Contents:
    """In place: results of version 1 get the dimension `estimator`, times other than seconds become seconds."""
    root = contents[""].attrs
    if [str(root.get(name)) for name in ("schema", "schema_version")] == [LAYOUTS["result"].schema, "1"]:
        root["schema_version"] = LAYOUTS["result"].version
        for path in {"gravity", "correction"} & contents.keys():
            variables = contents[path].variables
            for entry in variables.values():
                entry.dims = tuple("estimator" if dim == "method" else dim for dim in entry.dims)
            if "method" in variables:
                variables["estimator"] = variables.pop("method")
    for group in contents.values():
        for entry in group.variables.values():
            unit, since, epoch = str(entry.attrs.get("units", "")).partition(" since ")
            if since and unit in _UNITS and entry.values.dtype.kind in "iuf":
                entry.values = np.asarray(entry.values * _UNITS[unit])
                entry.attrs["units"] = f"seconds since {epoch}"
            elif since and entry.values.dtype.kind in "iu":
                entry.values = entry.values.astype(np.float64)
    return contents


def unpacked(contents: Contents) -> Contents:
    """The content with packed values unpacked in place to float64, and missing ones NaN.

    Integers without scale or offset stay as they are, whatever their fill value: they are flags and counts.
    `FileError`: a packing attribute is not a number.
    """
    for path, group in contents.items():
        for name, entry in group.variables.items():
            packing = {one: entry.attrs.pop(one) for one in PACKING if one in entry.attrs}
            if packing and entry.values.dtype.kind != "U":
                where = key(path, name)
                _unpack(entry, {one: _number(value, f"{where}, attribute {one}") for one, value in packing.items()})
    return contents


def _unpack(entry: Entry, packing: dict[str, Any]) -> None:
    stored = entry.values
    if not packing.keys().isdisjoint(PACKING[:2]):
        entry.values = stored.astype(np.float64)
        entry.values *= packing.get("scale_factor", 1.0)
        entry.values += packing.get("add_offset", 0.0)
    elif stored.dtype.kind == "f":
        entry.values = stored.copy()
    else:
        return
    for name in PACKING[2:]:
        if name in packing:
            entry.values[stored == packing[name]] = np.nan


def _number(value: Any, where: str) -> Any:
    number = np.asarray(value)
    if number.dtype.kind not in "iuf" or number.size != 1:
        raise FileError(f"{where}: is {shown(repr(value), 40)}, not a number; give one number or remove it")
    return number.ravel()[0]
