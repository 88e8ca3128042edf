"""Brings what an older version or other software wrote into the form of the layouts; undoes packing (CF 2.5.1, 8.1)."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from .contents import Contents, Entry, key, shown
from .errors import FileError
from .layouts import LAYOUTS

PACKING = ("scale_factor", "add_offset", "_FillValue", "missing_value")
_UNITS = {
    "nanoseconds": 1e-9, "microseconds": 1e-6, "milliseconds": 1e-3, "minutes": 60.0, "hours": 3600.0, "days": 86400.0,
}  # fmt: skip
_SINCE = re.compile(r"(\w+) since (.+)")


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
            since = _SINCE.fullmatch(str(entry.attrs.get("units", "")))
            if since is not None and since[1] in _UNITS and entry.values.dtype.kind in "iuf":
                entry.values = entry.values * _UNITS[since[1]]
                entry.attrs["units"] = f"seconds since {since[2]}"
            elif since is not None and entry.values.dtype.kind in "iu":
                entry.values = entry.values.astype(np.float64)
    return contents


def unpacked(contents: Contents) -> Contents:
    """The content with packed values unpacked in place to float64, and missing ones NaN.

    Integers without scale or offset stay as they are, whatever their fill value: they are flags and counts.

    Raises
    ------
    FileError
        A packing attribute is not a number.
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
    packed = "scale_factor" in packing or "add_offset" in packing
    if stored.dtype.kind != "f" and not packed:
        return
    values = stored.astype(np.float64) if packed else stored.copy()
    if packed:
        values *= packing.get("scale_factor", 1.0)
        values += packing.get("add_offset", 0.0)
    for name in ("_FillValue", "missing_value"):
        if name in packing:
            values[stored == packing[name]] = np.nan
    entry.values = values


def _number(value: Any, where: str) -> Any:
    number = np.asarray(value)
    if number.dtype.kind not in "iuf" or number.size != 1:
        raise FileError(f"{where}: is {shown(repr(value), 40)}, not a number; give one number or remove it")
    return number.ravel()[0]
