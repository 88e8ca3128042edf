"""Examples of every kind of file, made from the table of variables itself: complete, small and good."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr

from data_schemas.layouts import LAYOUTS
from data_schemas.variables import VARIABLES, attributes

_LABELS = {
    "trace": ["1", "1-2"],
    "pendulum": ["1", "2"],
    "component": ["1", "2", "1-2"],
    "estimator": ["panteleev", "projection"],
    "formula": ["(27)", "(38)"],
    "entry": ["non_isochronism", "finite_arc"],
    "base": ["before", "after"],
    "pair": ["1-2", "2-3"],
    "clock": ["1", "2"],
    "flag": ["beats through zero"],
}
_LENGTHS = {
    "time": 40,
    "mark": 3,
    "event": 2,
    "source": 2,
    "row": 2,
    "cycle": 4,
    "slip": 3,
    "averaging": 5,
    "record_time": 40,
    "frequency": 9,
} | {name: len(labels) for name, labels in _LABELS.items()}


def complete(kind: str) -> xr.DataTree:
    """A good file of a kind with every variable the table knows."""
    groups: dict[str, dict[str, object]] = {}
    for name, row in VARIABLES.items():
        group, _, short = name.rpartition("/")
        layout = LAYOUTS[kind]
        if group not in (*layout.groups, layout.root):
            continue
        shape = tuple(_LENGTHS[dim] for dim in row.dims)
        if row.dims == (short,) and short in _LABELS:
            values = np.array(_LABELS[short])
        elif row.dtype == "str":
            values = np.full(shape, "measured")
        elif name == "time" or short == "record_time":
            values = np.arange(40) * 0.5
        elif name == "record/combination":
            values = np.array([[1.0, 0.0], [1.0, -1.0]])
        else:
            values = np.ones(shape, dtype=row.dtype)
        groups.setdefault("" if group == layout.root else group, {})[short] = (row.dims, values, attributes(name))
    tree = xr.DataTree.from_dict({"/" + group: xr.Dataset(members) for group, members in groups.items()})
    tree.attrs = dict.fromkeys(LAYOUTS[kind].attrs, "{}") | {
        "Conventions": "CF-1.11",
        "schema": LAYOUTS[kind].schema,
        "schema_version": LAYOUTS[kind].version,
        "record_id": "example",
        "title": "an example",
        "history": "made by a test",
        "source": "model",
    }
    return tree


@pytest.fixture
def example() -> Callable[[str], xr.DataTree]:
    return complete


@pytest.fixture
def record() -> xr.DataTree:
    """The least record that gives gravity."""
    full = complete("record")
    keep = {"record": ["combination", "elongation"], "instrument": ["period", "reference_gravity"]}
    groups = {"/": full.to_dataset()} | {
        f"/{group}": full[group].to_dataset(inherit=False)[names] for group, names in keep.items()
    }
    least = xr.DataTree.from_dict(groups)
    least["instrument"]["period"][:] = [1.0100, 1.0101]
    least["record"]["elongation"][:] = 0.02 * np.sin(np.arange(80.0).reshape(2, 40))
    return least
