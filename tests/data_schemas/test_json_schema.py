"""The JSON Schemas are valid, describe the headers of good files, and refuse those of bad ones."""

from __future__ import annotations

import json
from typing import Any

import jsonschema
import numpy as np
import pytest
import xarray as xr

from data_schemas import json_schema, read, write
from data_schemas.contents import Group, from_tree, type_name
from data_schemas.errors import UsageError
from data_schemas.layouts import LAYOUTS
from data_schemas.variables import VARIABLES


def header(tree: xr.DataTree) -> dict[str, Any]:
    """The header of a file in memory as plain JSON values: what `json_schema` describes."""
    contents = from_tree(tree)
    groups = {path: _group_header(group) for path, group in contents.items() if path}
    return {**_group_header(contents[""]), "groups": groups}


def _group_header(group: Group) -> dict[str, Any]:
    variables = {
        name: {
            "dimensions": list(entry.dims),
            "type": type_name(entry.values),
            "attributes": {label: _json(value) for label, value in entry.attrs.items()},
        }
        for name, entry in group.variables.items()
    }
    return {"attributes": {name: _json(value) for name, value in group.attrs.items()}, "variables": variables}


def _json(value: Any) -> Any:
    plain = value.tolist() if isinstance(value, np.ndarray | np.generic) else value
    many = plain if isinstance(plain, list) else [plain]
    finite = [one if isinstance(one, str) or np.isfinite(one) else None for one in many]
    return finite if isinstance(plain, list) else finite[0]


@pytest.mark.parametrize("kind", ["scene", *LAYOUTS])
def test_it_is_a_json_schema(kind):
    schema = json.loads(json.dumps(json_schema(kind), allow_nan=False))
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    jsonschema.Draft202012Validator.check_schema(schema)


@pytest.mark.parametrize("kind", LAYOUTS)
def test_it_describes_a_written_file(tmp_path, example, kind):
    write(example(kind), tmp_path / "file.nc")
    jsonschema.validate(header(read(tmp_path / "file.nc")), json_schema(kind))


@pytest.mark.parametrize("kind", LAYOUTS)
def test_it_names_every_variable(kind):
    schema = json_schema(kind)
    for name, row in VARIABLES.items():
        group, _, short = name.rpartition("/")
        if group in LAYOUTS[kind].groups:
            told = schema["properties"]["groups"]["properties"][group]["properties"]["variables"]
            assert f"[{row.units}]" in told["properties"][short]["description"]
            assert (short in told["required"]) is row.required


SPOIL = {
    "schema": lambda h: h["attributes"].update(schema="other"),
    "no version": lambda h: h["attributes"].pop("schema_version"),
    "no group": lambda h: h["groups"].pop("record"),
    "no variable": lambda h: h["groups"]["record"]["variables"].pop("elongation"),
    "no time": lambda h: h["variables"].pop("time"),
    "dimensions": lambda h: h["groups"]["record"]["variables"]["elongation"].update(dimensions=["time", "trace"]),
    "type": lambda h: h["groups"]["record"]["variables"]["elongation"].update(type="f4"),
    "no units": lambda h: h["groups"]["instrument"]["variables"]["period"]["attributes"].pop("units"),
    "restoring": lambda h: h["groups"]["instrument"].update(attributes={"restoring": "cubic"}),
    "flags": lambda h: h["groups"]["record"]["variables"]["elongation_qc"]["attributes"].update(flag_masks=[1]),
}


@pytest.mark.parametrize("spoil", SPOIL.values(), ids=SPOIL)
def test_it_refuses_a_spoilt_header(example, spoil):
    good = header(example("record"))
    spoil(good)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(good, json_schema("record"))


def test_a_header_is_plain_json(example):
    tree = example("record")
    tree.attrs |= {"odd": float("nan"), "odds": np.array([1.0, np.inf])}
    assert json.loads(json.dumps(header(tree), allow_nan=False))["attributes"]["odds"] == [1.0, None]


def test_an_unknown_name_is_refused():
    with pytest.raises(UsageError, match="schema 'film' is not known; give scene, record, truth, result"):
        json_schema("film")  # type: ignore[arg-type]  # the point of the test
