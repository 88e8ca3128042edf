"""Older and packed content brought to the layouts of today; packing is that of CF 2.5.1 and 8.1."""

from typing import Any

import numpy as np

from .contents import Contents, Entry, key, shown
from .errors import FileError
from .layouts import LAYOUTS

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
    """The content with packed values, but flags and counts, unpacked in place to float64, missing ones NaN.

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
