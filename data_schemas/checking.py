"""Checks a content against the layout of its kind and names every fault at once."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from .checking_record import record_faults, result_faults
from .contents import IDENTIFIER, Contents, Entry, from_tree, key, shown, type_name
from .errors import FileError
from .layouts import LAYOUTS, Kind
from .variable import same_unit
from .variables import VARIABLES, Variable

if TYPE_CHECKING:
    import xarray as xr


def check(tree: xr.DataTree, schema: Kind) -> list[str]:
    """Every fault of a tree in memory, one line each with its remedy; an empty list for a good one.

    Parameters
    ----------
    tree : xarray.DataTree
    schema : {"record", "truth", "result", "film-truth", "summary"}
        What it is meant to be.

    Returns
    -------
    list of str
        ``group/name: what is wrong; what to do``.
    """
    try:
        return faults(from_tree(tree), schema)
    except FileError as error:
        return [str(error)]


def faults(contents: Contents, schema: Kind) -> list[str]:
    """Every fault of a plain content; `check` and `validate` share it."""
    layout = LAYOUTS[schema]
    found = _attribute_faults(contents[""].attrs, schema)
    for path, required in layout.groups.items():
        if path in contents:
            found += _missing_variables(contents, path, path)
        elif required:
            found.append(f"{path}: the group is missing; add it with its variables")
    if layout.one_of and not any(path in contents for path in layout.one_of):
        found.append(f"{' or '.join(layout.one_of)}: the group is missing; add one of them")
    if layout.root:
        found += _missing_variables(contents, "", layout.root)
    elif "time" not in contents[""].variables:
        found.append("time: is missing at the root; add the time of each sample, float64 seconds")
    sizes = _sizes(contents, found)
    for path, group in contents.items():
        for name, entry in group.variables.items():
            found += _variable_faults(key(path, name), entry, schema)
    found += _time_faults(contents)
    if schema == "record":
        found += record_faults(contents, sizes)
    if schema == "result":
        found += result_faults(contents)
    return found


def _attribute_faults(attrs: dict[str, Any], schema: Kind) -> list[str]:
    layout, found = LAYOUTS[schema], []
    for name, required in layout.attrs.items():
        if name not in attrs and required:
            found.append(f"attribute {name}: is missing at the root; add it")
    own = attrs.get("record_id")
    if own is not None and not (isinstance(own, str) and IDENTIFIER.fullmatch(own)):
        found.append(f"attribute record_id: {shown(repr(own))} is no identifier; give 1 to 64 of A-Z a-z 0-9 . _ + -")
    for name, wanted, remedy in (
        ("schema", layout.schema, f"set it to {layout.schema!r} if this is a {schema}"),
        ("schema_version", layout.version, f"set it to {layout.version!r}, or use a newer isochrony"),
    ):
        given = attrs.get(name, wanted)
        if not isinstance(given, str) or given != wanted:
            found.append(f"attribute {name}: is {shown(repr(given))}, not {wanted!r}; {remedy}")
    for name in layout.json_attrs:
        if name in attrs:
            try:
                json.loads(attrs[name])
            except (TypeError, ValueError):
                found.append(f"attribute {name}: is not JSON; store the text of a JSON object")
    return found


def _missing_variables(contents: Contents, path: str, table: str) -> list[str]:
    there = contents[path].variables
    wanted = {name.rpartition("/")[2]: row for name, row in VARIABLES.items() if name.rpartition("/")[0] == table}
    return [
        f"{key(path, name)}: the variable is missing; add it with dimensions ({', '.join(row.dims)}) in {row.units}"
        for name, row in wanted.items()
        if row.required and name not in there
    ]


def _sizes(contents: Contents, found: list[str]) -> dict[tuple[str, str], int]:
    """Length of each dimension in each group; a group whose lengths differ from its own or the root's is a fault."""
    sizes: dict[tuple[str, str], int] = {}
    for path in sorted(contents):
        for name, entry in contents[path].variables.items():
            for dim, length in zip(entry.dims, entry.values.shape, strict=True):
                known = sizes.get((path, dim), sizes.get(("", dim), length))
                sizes.setdefault((path, dim), known)
                if length != known:
                    found.append(
                        f"{key(path, name)}: has {length} values along {shown(dim)} where others have {known}; "
                        f"make the dimension {shown(dim)} of one length"
                    )
    return sizes


def _variable_faults(where: str, entry: Entry, schema: Kind) -> list[str]:
    row = VARIABLES.get(where if "/" in where else key(LAYOUTS[schema].root, where))
    if row is None:
        return [] if schema != "result" else _extra_faults(where, entry)
    found = []
    if entry.dims not in (row.dims, *row.also):
        wanted = " or ".join(f"({', '.join(dims)})" for dims in (row.dims, *row.also))
        found.append(f"{where}: has dimensions ({shown(', '.join(entry.dims))}); give it {wanted}")
    units = entry.attrs.get("units", "1" if row.units == "1" else None)
    if units is None:
        found.append(f"{where}: has no units; set its attribute units to {row.units!r}")
    elif not same_unit(units, row.units):
        found.append(f"{where}: has units {shown(repr(units))}; convert it to {row.units!r}")
    if type_name(entry.values) != row.dtype:
        found.append(f"{where}: has type {type_name(entry.values)}; store it as {row.dtype}")
    else:
        found += _flag_faults(where, entry, row) + _value_faults(where, entry, row)
    return found


def _extra_faults(where: str, entry: Entry) -> list[str]:
    missing = [name for name in ("units", "long_name") if name not in entry.attrs]
    return [f"{shown(where)}: is not in the table and has no {name}; add it" for name in missing]


def _flag_faults(where: str, entry: Entry, row: Variable) -> list[str]:
    found = []
    for name in ("flag_masks", "flag_meanings"):
        if name in row.attrs and name in entry.attrs and not np.array_equal(row.attrs[name], entry.attrs[name]):
            wanted = " ".join(str(one) for one in np.atleast_1d(row.attrs[name]))
            found.append(f"{where}, attribute {name}: differs from the table; set it to {wanted}")
    return found


def _value_faults(where: str, entry: Entry, row: Variable) -> list[str]:
    if row.dtype != "f8" or not entry.values.size or where == "time":
        return []
    values, found = entry.values, []
    lowest, highest = np.fmin.reduce(values, axis=None), np.fmax.reduce(values, axis=None)
    if not row.missing and np.isnan(values).any():
        found.append(f"{where}: holds NaN; give every value, or leave the variable out")
    if np.isinf(lowest) or np.isinf(highest):
        remedy = "mark missing values as NaN" if row.missing else "give finite values"
        found.append(f"{where}: holds infinite values; {remedy}")
    if (row.limit == "positive" and lowest <= 0) or (row.limit == "not negative" and lowest < 0):
        wanted = "greater than zero" if row.limit == "positive" else "zero or more"
        found.append(f"{where}: holds {lowest:g}; give values {wanted}")
    return found


def _time_faults(contents: Contents) -> list[str]:
    time = contents[""].variables.get("time")
    if time is None or time.dims != ("time",) or type_name(time.values) != "f8":
        return []
    values = time.values
    if values.size < 2:
        return [f"time: holds {values.size} sample{'s' * (values.size != 1)}; a record needs 2 or more"]
    if not np.isfinite(values).all():
        return ["time: holds NaN or infinite values; give every sample its time in seconds"]
    falls = np.flatnonzero(values[1:] <= values[:-1]) + 1
    if falls.size:
        at = falls[0]
        return [
            f"time: does not increase at sample {at} ({values[at - 1]:g} s, then {values[at]:g} s; {falls.size} such "
            f"places); sort the samples and drop repeated ones"
        ]
    return []
