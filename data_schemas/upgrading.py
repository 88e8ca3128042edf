"""Brings what an older version or other software wrote into the form of the layouts."""

from __future__ import annotations

import re

import numpy as np

from .contents import Contents, Entry
from .layouts import LAYOUTS

_UNITS = {
    "nanoseconds": 1e-9,
    "microseconds": 1e-6,
    "milliseconds": 1e-3,
    "minutes": 60.0,
    "hours": 3600.0,
    "days": 86400.0,
}
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
            _in_seconds(entry)
    return contents


def _in_seconds(entry: Entry) -> None:
    found = _SINCE.fullmatch(str(entry.attrs.get("units", "")))
    if found is not None and found[1] in _UNITS and entry.values.dtype.kind in "iuf":
        entry.values = entry.values * _UNITS[found[1]]
        entry.attrs["units"] = f"seconds since {found[2]}"
    elif found is not None and entry.values.dtype.kind in "iu":
        entry.values = entry.values.astype(np.float64)
