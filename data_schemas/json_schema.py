"""JSON Schema of each kind of file, made from the table of variables; of a scene, from its model.

A netCDF file is no JSON: the schemas of record, truth and result describe its *header*, what ``ncdump -h``
shows: attributes, variables (dimensions, type, attributes) and groups; numbers that JSON lacks are null. What a
header cannot show (values, lengths, labels) is the business of `check`.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from .checking_record import WORDS
from .errors import UsageError
from .layouts import LAYOUTS, Kind
from .variables import Variable, rows_of

DIALECT = "https://json-schema.org/draft/2020-12/schema"
_ATTRIBUTE = {
    "oneOf": [
        {"type": ["string", "number", "null"]},
        {"type": "array", "items": {"type": ["string", "number", "null"]}},
    ]
}


def json_schema(name: Literal["scene", "record", "truth", "result", "film-truth", "summary"]) -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a scene, or of the header of a file of another kind.

    Parameters
    ----------
    name : {"scene", "record", "truth", "result", "film-truth", "summary"}

    Returns
    -------
    dict
        Plain JSON values.

    Raises
    ------
    UsageError
        No schema has that name.

    Examples
    --------
    >>> json_schema("record")["properties"]["attributes"]["properties"]["schema"]["const"]
    'isochrony-record'
    """
    if name == "scene":
        from .scene import Scene

        return {"$schema": DIALECT, **Scene.model_json_schema()}
    for kind in LAYOUTS:
        if name == kind:
            return _file_schema(kind)
    raise UsageError(f"schema {name!r} is not known; give scene, {', '.join(LAYOUTS)}")


def _file_schema(kind: Kind) -> dict[str, Any]:
    layout = LAYOUTS[kind]
    attributes: dict[str, Any] = {name: {} for name in layout.attrs}
    attributes |= {name: {"type": "string", "contentMediaType": "application/json"} for name in layout.json_attrs}
    attributes |= {"schema": {"const": layout.schema}, "schema_version": {"const": layout.version}}
    groups: dict[str, Any] = {
        "type": "object",
        "properties": {path: _group_schema(path) for path in layout.groups},
        "required": [path for path, required in layout.groups.items() if required],
    }
    if layout.one_of:
        groups["anyOf"] = [{"required": [path]} for path in layout.one_of]
    return {
        "$schema": DIALECT,
        "title": layout.schema,
        "description": f"Header of a netCDF-4 file of kind {kind}: attributes, variables and groups.",
        "type": "object",
        "properties": {
            "attributes": {
                "type": "object",
                "properties": attributes,
                "required": [name for name, required in layout.attrs.items() if required],
                "additionalProperties": _ATTRIBUTE,
            },
            "variables": _variables_schema(layout.root),
            "groups": groups,
        },
        "required": ["attributes", "variables", "groups"],
    }


def _group_schema(path: str) -> dict[str, Any]:
    attributes: dict[str, Any] = {"type": "object", "additionalProperties": _ATTRIBUTE}
    said = {name: words for (group, name), words in WORDS.items() if group == path}
    if said:
        attributes["properties"] = {name: {"enum": list(words), "default": words[0]} for name, words in said.items()}
    return {
        "type": "object",
        "properties": {"attributes": attributes, "variables": _variables_schema(path)},
        "required": ["variables"],
    }


def _variables_schema(path: str) -> dict[str, Any]:
    rows = rows_of(path)
    return {
        "type": "object",
        "properties": {name: _variable_schema(row) for name, row in rows.items()},
        "required": [name for name, row in rows.items() if row.required],
    }


def _variable_schema(row: Variable) -> dict[str, Any]:
    # an equivalent spelling of a unit is accepted too, so the unit is described and not demanded
    units = {"type": ["string", "number"], "default": row.units, "examples": [row.units]}
    attributes: dict[str, Any] = {"units": units}
    if row.standard_name is not None:
        attributes["standard_name"] = {"const": row.standard_name}
    attributes |= {
        name: {"const": np.asarray(value).tolist()} for name, value in row.attrs.items() if name.startswith("flag_")
    }
    limit = f"; {row.limit}" if row.limit else ""
    return {
        "type": "object",
        "description": f"{row.long_name} [{row.units}]{limit}{'; NaN where missing' if row.missing else ''}",
        "properties": {
            "dimensions": {"enum": [list(dims) for dims in (row.dims, *row.also)]},
            "type": {"const": row.dtype},
            "attributes": {
                "type": "object",
                "properties": attributes,
                "required": [] if row.units == "1" else ["units"],
                "additionalProperties": _ATTRIBUTE,
            },
        },
        "required": ["dimensions", "type"],
    }
