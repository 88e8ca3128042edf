"""Checks a content, or a whole file, against the layout of its kind and names every fault at once."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .checking_record import record_faults, result_faults
from .contents import IDENTIFIER, Contents, Entry, from_tree, key, shown, type_name
from .errors import FileError, RecordError, SceneError
from .layouts import LAYOUTS, Kind
from .reading import load
from .variable import same_unit
from .variables import VARIABLES, Variable, rows_of

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


def validate(path: str | os.PathLike[str]) -> list[str]:
    """Every fault of a file at once, one line each; an empty list for a good one. Bad content never raises.

    Parameters
    ----------
    path : path
        A record, truth or result; or, told by its suffix ``.toml``, a scene, the description of a film or edits of one.

    Returns
    -------
    list of str
        ``path: group/name: what is wrong; what to do``.
    """
    try:
        if Path(path).suffix == ".toml":
            _load_toml(path)
            return []
        contents = load(path)
    except (SceneError, RecordError, FileError) as error:
        return [str(error)]
    kind, found = _kind(contents)
    found += [] if kind is None else faults(contents, kind)
    return [f"{shown(path, 400)}: {fault}" for fault in dict.fromkeys(found)]


def _load_toml(path: str | os.PathLike[str]) -> None:
    """Read a TOML file as what its key `kind` says; a scene has none."""
    from . import film_description, film_edits
    from .scene import load_scene
    from .text_files import load_toml

    match load_toml(path, "a scene", SceneError).get("kind"):
        case film_description.KIND:
            film_description.load_description(path)
        case film_edits.KIND:
            film_edits.load_edits(path)
        case _:
            load_scene(path)


def _kind(contents: Contents) -> tuple[Kind | None, list[str]]:
    """What the file says it is, or failing that looks like, with the fault of not saying it well."""
    schema = contents[""].attrs.get("schema")
    for kind, layout in LAYOUTS.items():
        if isinstance(schema, str) and schema == layout.schema:
            return kind, []
    for kind, layout in LAYOUTS.items():
        if not layout.groups.keys().isdisjoint(contents):
            return kind, []  # the check of this kind says what is wrong with the attribute
    known = ", ".join(layout.schema for layout in LAYOUTS.values())
    stated = "is missing at the root" if schema is None else f"is {shown(repr(schema))}"
    return None, [f"attribute schema: {stated} and no group is known; set it to one of {known}"]


def faults(contents: Contents, schema: Kind) -> list[str]:
    """Every fault of a plain content; `check` and `validate` share it."""
    layout = LAYOUTS[schema]
    found = [*_attribute_faults(contents[""].attrs, schema)]
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


def _attribute_faults(attrs: dict[str, Any], schema: Kind) -> Iterator[str]:
    layout = LAYOUTS[schema]
    for name, required in layout.attrs.items():
        if name not in attrs and required:
            yield f"attribute {name}: is missing at the root; add it"
    own = attrs.get("record_id")
    if own is not None and not (isinstance(own, str) and IDENTIFIER.fullmatch(own)):
        yield f"attribute record_id: {shown(repr(own))} is no identifier; give 1 to 64 of A-Z a-z 0-9 . _ + -"
    for name, wanted, remedy in (
        ("schema", layout.schema, f" if this is a {schema}"),
        ("schema_version", layout.version, ", or use a newer isochrony"),
    ):
        given = attrs.get(name, wanted)
        if not isinstance(given, str) or given != wanted:
            yield f"attribute {name}: is {shown(repr(given))}, not {wanted!r}; set it to {wanted!r}{remedy}"
    for name in layout.json_attrs:
        try:
            json.loads(attrs.get(name, "{}"))
        except (TypeError, ValueError):
            yield f"attribute {name}: is not JSON; store the text of a JSON object"


def _missing_variables(contents: Contents, path: str, table: str) -> Iterator[str]:
    for name, row in rows_of(table).items():
        if row.required and name not in contents[path].variables:
            dims = ", ".join(row.dims)
            yield f"{key(path, name)}: the variable is missing; add it with dimensions ({dims}) in {row.units}"


def _sizes(contents: Contents, found: list[str]) -> dict[tuple[str, str], int]:
    """Length of each dimension in each group; a group whose lengths differ from its own or the root's is a fault."""
    sizes: dict[tuple[str, str], int] = {}
    for path in sorted(contents):
        for name, entry in contents[path].variables.items():
            for dim, length in zip(entry.dims, entry.values.shape, strict=True):
                known = sizes.setdefault((path, dim), sizes.get(("", dim), length))
                if length != known:
                    found.append(
                        f"{key(path, name)}: has {length} values along {shown(dim)} where others have {known}; "
                        f"make the dimension {shown(dim)} of one length"
                    )
    return sizes


def _variable_faults(where: str, entry: Entry, schema: Kind) -> Iterator[str]:
    row = VARIABLES.get(where if "/" in where else key(LAYOUTS[schema].root, where))
    if row is None:
        if schema == "result":
            missing = (name for name in ("units", "long_name") if name not in entry.attrs)
            yield from (f"{shown(where)}: is not in the table and has no {name}; add it" for name in missing)
        return
    if entry.dims not in (row.dims, *row.also):
        wanted = " or ".join(f"({', '.join(dims)})" for dims in (row.dims, *row.also))
        yield f"{where}: has dimensions ({shown(', '.join(entry.dims))}); give it {wanted}"
    units = entry.attrs.get("units", "1" if row.units == "1" else None)
    if units is None:
        yield f"{where}: has no units; set its attribute units to {row.units!r}"
    elif not same_unit(units, row.units):
        yield f"{where}: has units {shown(repr(units))}; convert it to {row.units!r}"
    if type_name(entry.values) != row.dtype:
        yield f"{where}: has type {type_name(entry.values)}; store it as {row.dtype}"
        return
    for name in ("flag_masks", "flag_meanings"):
        if name in row.attrs and name in entry.attrs and not np.array_equal(row.attrs[name], entry.attrs[name]):
            wanted = " ".join(str(one) for one in np.atleast_1d(row.attrs[name]))
            yield f"{where}, attribute {name}: differs from the table; set it to {wanted}"
    if row.dtype == "f8" and entry.values.size and where != "time":
        yield from _value_faults(where, entry, row)


def _value_faults(where: str, entry: Entry, row: Variable) -> Iterator[str]:
    lowest, highest = np.fmin.reduce(entry.values, axis=None), np.fmax.reduce(entry.values, axis=None)
    if not row.missing and np.isnan(entry.values).any():
        yield f"{where}: holds NaN; give every value, or leave the variable out"
    if np.isinf(lowest) or np.isinf(highest):
        remedy = "mark missing values as NaN" if row.missing else "give finite values"
        yield f"{where}: holds infinite values; {remedy}"
    if (row.limit == "positive" and lowest <= 0) or (row.limit == "not negative" and lowest < 0):
        wanted = "greater than zero" if row.limit == "positive" else "zero or more"
        yield f"{where}: holds {lowest:g}; give values {wanted}"


def _time_faults(contents: Contents) -> Iterator[str]:
    time = contents[""].variables.get("time")
    if time is None or time.dims != ("time",) or type_name(time.values) != "f8":
        return
    values = time.values
    if values.size < 2:
        yield f"time: holds {values.size} sample{'s' * (values.size != 1)}; a record needs 2 or more"
    elif not np.isfinite(values).all():
        yield "time: holds NaN or infinite values; give every sample its time in seconds"
    elif (falls := np.flatnonzero(values[1:] <= values[:-1]) + 1).size:
        at = falls[0]
        yield (
            f"time: does not increase at sample {at} ({values[at - 1]:g} s, then {values[at]:g} s; {falls.size} such "
            f"places); sort the samples and drop repeated ones"
        )
