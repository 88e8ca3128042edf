"""Brings what an older version, other software or a user has into the form of the layouts.

Files of older versions, packing (CF 2.5.1, 8.1), trees with dates or edited by hand, datasets of traces.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np

from .contents import Contents, Entry, from_tree, identifier, key, shown, to_tree
from .errors import FileError, RecordError
from .layouts import LAYOUTS, root_attributes
from .variables import attributes, rows_of

if TYPE_CHECKING:
    import xarray as xr

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


_WORDS = ("restoring", "reference", "acceleration_frame")


def adopted(given: xr.DataTree | xr.Dataset | str | os.PathLike[str]) -> xr.DataTree:
    """A record as the pipeline takes it: of a file, of a tree with dates or edited by hand, of a dataset of traces.

    Parameters
    ----------
    given : path, DataTree or Dataset
        Dates become seconds. A dataset holds variables of /record and /instrument side by side; without
        `combination`, the traces' labels say it ("1", "1-2").

    Raises
    ------
    FileError
        A file that cannot be read, or a variable that no file can hold.
    RecordError
        Labels that do not say which pendulums a trace records.
    """
    import xarray as xr

    from .reading import read

    if isinstance(given, str | os.PathLike):
        return read(given)
    if isinstance(given, xr.Dataset):
        given = _laid_out(given)
    dated = any(
        one.dtype.kind == "M" for node in given.subtree for one in node.to_dataset(inherit=False).variables.values()
    )
    # a tree as it is stored needs no copy of its times
    return to_tree(current(from_tree(given))) if dated else given


def _laid_out(traces: xr.Dataset) -> xr.DataTree:
    import xarray as xr

    if "trace" not in traces.dims or "time" not in traces.coords:
        raise RecordError(
            "record/trace: a dataset of traces has dimensions trace and time; name them, with coordinates"
        )
    labels = [str(label) for label in traces["trace"].values]
    pendulums = list(dict.fromkeys(part for label in labels for part in label.split("-")))
    if "pendulum" in traces.coords:
        pendulums = [str(label) for label in traces["pendulum"].values]
    given = {str(n): each for n, each in traces.variables.items() if n not in ("time", "trace", "pendulum")}
    if "combination" not in given:
        given["combination"] = xr.Variable(("trace", "pendulum"), [_combination(label, pendulums) for label in labels])
    words = {name: traces.attrs[name] for name in _WORDS if name in traces.attrs}
    root = root_attributes("record", identifier(str(traces.attrs.get("record_id", "traces"))))
    time = traces["time"].variable
    stamps = xr.Variable(("time",), time.values, attributes("time") | time.attrs, time.encoding)
    groups = {"/": xr.Dataset(coords={"time": stamps}, attrs=root)}
    for group in ("record", "instrument"):
        known = {n: each for n, each in given.items() if n in rows_of(group)}
        if group == "record" or any("trace" in each.dims for each in known.values()):
            known["trace"] = xr.Variable("trace", np.array(labels, dtype=object))
        known["pendulum"] = xr.Variable("pendulum", np.array(pendulums, dtype=object))
        filled = {n: (each.dims, each.values, attributes(f"{group}/{n}") | each.attrs) for n, each in known.items()}
        groups[f"/{group}"] = xr.Dataset(filled, attrs=words)
    return xr.DataTree.from_dict(groups)


def _combination(label: str, pendulums: list[str]) -> list[float]:
    parts = label.split("-")
    if not set(parts) <= set(pendulums) or len(parts) > 2:
        raise RecordError(
            f"record/combination: missing, and trace {shown(repr(label))} does not say it; give combination, or labels "
            "such as 1 and 1-2"
        )
    return [float((name == parts[0]) - (name in parts[1:])) for name in pendulums]
