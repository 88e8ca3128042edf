"""The one table of every variable a file may hold: dimensions, number type, unit, meaning and allowed range.

A key is ``group/name`` (``record/elongation``); a variable of the root has its bare name (``time``). The rows
live in one file a kind (`variables_record`, `variables_truth` and so on); a new variable is one row there. Those of a
summary stand at the root of its file and under ``summary/`` here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from . import variables_record, variables_result, variables_truth
from .variable import Variable as Variable
from .variable import tables

if TYPE_CHECKING:
    import xarray as xr

_TIME = tables("time(time) epoch [required, cf time]: time of the sample, from the start of the record")[""]["time"]
_TIME = replace(_TIME, attrs={**_TIME.attrs, "axis": "T"})
_GROUPS = {"": {"time": _TIME}} | variables_record.GROUPS | variables_truth.GROUPS | variables_result.GROUPS
_ROWS = {f"{group}/{name}".lstrip("/"): row for group, rows in _GROUPS.items() for name, row in rows.items()}
VARIABLES: Mapping[str, Variable] = MappingProxyType(_ROWS)


def rows_of(group: str) -> Mapping[str, Variable]:
    """Rows of a group, or of the root, by the name within it."""
    return _GROUPS.get(group, {})


def add_constant(name: str, units: str, long_name: str) -> None:
    """Add a number of /instrument, and its standard deviation, to the table: a correction of one's own may need it."""
    for own, meaning in ((name, long_name), (f"{name}_uncertainty", f"standard deviation of {name}")):
        row = _ROWS.setdefault(f"instrument/{own}", Variable((), "f8", units, meaning))
        _GROUPS["instrument"].setdefault(own, row)


def attributes(key: str) -> dict[str, Any]:
    """Attributes to attach to a variable in memory: ``units``, ``long_name`` and what CF asks beside them.

    `key` is ``group/name``, or the bare name at the root. The dictionary is yours to change: set the epoch in ``units``
    of ``time`` to the record's own start. `KeyError`: the table has no such variable.

    Examples
    --------
    >>> attributes("record/elongation")["units"]
    'rad'
    """
    row = VARIABLES[key]
    named = {} if row.standard_name is None else {"standard_name": row.standard_name}
    return {"units": row.units, "long_name": row.long_name, **named, **row.attrs}


def dataset(
    group: str,
    values: Mapping[str, Any],
    coordinates: Mapping[str, Any] = MappingProxyType({}),
    extra: Mapping[str, tuple[str, str]] = MappingProxyType({}),
    dims: tuple[str, ...] = (),
) -> xr.Dataset:
    """A group of a file: dimensions, units and meaning of its values from the table.

    `extra` has units and meanings of values that the table does not know, all with the dimensions `dims`.
    """
    import xarray as xr

    def entry(name: str, value: Any) -> xr.Variable:
        data = np.asarray(value, dtype=object if isinstance(value, str) else None)
        if name in extra:
            units, long_name = extra[name]
            return xr.Variable(dims, data, {"units": units, "long_name": long_name}, fastpath=True)
        row = VARIABLES[f"{group}/{name}"]
        own = next((each for each in (row.dims, *row.also) if len(each) == data.ndim), row.dims)
        return xr.Variable(own, data, attributes(f"{group}/{name}"), fastpath=True)

    labels = {
        name: value if isinstance(value, np.ndarray) else np.array(list(value), dtype=object)
        for name, value in coordinates.items()
    }
    return xr.Dataset(*({name: entry(name, value) for name, value in each.items()} for each in (values, labels)))
