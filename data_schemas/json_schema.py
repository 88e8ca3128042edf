"""JSON Schema of a scene, from its model, and of each kind of file, from the table of variables.

Of a netCDF file it describes the *header*, as ``ncdump -h`` shows it; numbers that JSON lacks are null. What a header
cannot show (values, lengths, labels) is the business of `check`.
"""

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from .checking import WORDS
from .errors import UsageError
from .layouts import LAYOUTS, Kind
from .variables import Variable, rows_of

DIALECT = "https://json-schema.org/draft/2020-12/schema"
_VALUE = {"type": ["string", "number", "null"]}
_ATTRIBUTE = {"oneOf": [_VALUE, {"type": "array", "items": _VALUE}]}


def json_schema(name: Literal["scene", "record", "truth", "result", "film-truth", "summary"]) -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a scene, or of a file's header; `UsageError`: no schema has that name."""
    if name == "scene":
        from .scene import Scene

        return {"$schema": DIALECT, **Scene.model_json_schema()}
    if name in LAYOUTS:
        return _file_schema(name)
    raise UsageError(f"schema {name!r} is not known; give scene, {', '.join(LAYOUTS)}")


def _object(properties: dict[str, Any], required: list[str], **more: Any) -> dict[str, Any]:
    return {"type": "object", "properties": properties, "required": required, **more}


def _required(known: Mapping[str, bool]) -> list[str]:
    return [name for name, required in known.items() if required]


def _file_schema(kind: Kind) -> dict[str, Any]:
    layout = LAYOUTS[kind]
    attributes: dict[str, Any] = {name: {} for name in layout.attrs}
    attributes |= {name: {"type": "string", "contentMediaType": "application/json"} for name in layout.json_attrs}
    attributes |= {"schema": {"const": layout.schema}, "schema_version": {"const": layout.version}}
    groups = _object({path: _group_schema(path) for path in layout.groups}, _required(layout.groups))
    if layout.one_of:
        groups["anyOf"] = [{"required": [path]} for path in layout.one_of]
    parts = {
        "attributes": _object(attributes, _required(layout.attrs), additionalProperties=_ATTRIBUTE),
        "variables": _variables_schema(layout.root),
        "groups": groups,
    }
    return {
        "$schema": DIALECT,
        "title": layout.schema,
        "description": f"Header of a netCDF-4 file of kind {kind}: attributes, variables and groups.",
        **_object(parts, list(parts)),
    }


def _group_schema(path: str) -> dict[str, Any]:
    words = {name: {"enum": [*said], "default": said[0]} for (group, name), said in WORDS.items() if group == path}
    attributes = _object(words, [], additionalProperties=_ATTRIBUTE)
    return _object({"attributes": attributes, "variables": _variables_schema(path)}, ["variables"])


def _variables_schema(path: str) -> dict[str, Any]:
    rows = rows_of(path)
    schemas = {name: _variable_schema(row) for name, row in rows.items()}
    return _object(schemas, _required({name: row.required for name, row in rows.items()}))


def _variable_schema(row: Variable) -> dict[str, Any]:
    # an equivalent spelling of a unit is accepted too, so the unit is described and not demanded
    attributes: dict[str, Any] = {"units": {"type": ["string", "number"], "default": row.units}}
    if row.standard_name is not None:
        attributes["standard_name"] = {"const": row.standard_name}
    attributes |= {
        name: {"const": np.asarray(value).tolist()} for name, value in row.attrs.items() if name.startswith("flag_")
    }
    limit = f"; {row.limit}" if row.limit else ""
    parts = {
        "dimensions": {"enum": [list(dims) for dims in (row.dims, *row.also)]},
        "type": {"const": row.dtype},
        "attributes": _object(attributes, [] if row.units == "1" else ["units"], additionalProperties=_ATTRIBUTE),
    }
    description = f"{row.long_name} [{row.units}]{limit}{'; NaN where missing' if row.missing else ''}"
    return _object(parts, ["dimensions", "type"], description=description)
