"""A group of a record from plain arrays: dimensions, units and meanings come from the one table of variables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from data_schemas.variables import VARIABLES, attributes

if TYPE_CHECKING:
    import xarray as xr


def dataset(group: str, variables: Mapping[str, Any], labels: Mapping[str, list[str]]) -> xr.Dataset:
    """A group's dataset, its dimensions and attributes from the table of variables."""
    import xarray as xr

    def entry(name: str, value: Any) -> tuple[tuple[str, ...], Any, dict[str, Any]]:
        key = f"{group}/{name}"
        dims = VARIABLES[key].dims
        also = [each for each in VARIABLES[key].also if len(each) == np.ndim(value)]
        return dims if len(dims) == np.ndim(value) else also[0], value, attributes(key)

    return xr.Dataset(
        {name: entry(name, value) for name, value in variables.items()},
        coords={name: entry(name, np.array(values)) for name, values in labels.items()},
    )
