"""Takes a record in whatever form a user has it: a file, a tree with dates or edited by hand, a dataset of traces."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from .contents import from_tree, identifier, shown, to_tree
from .errors import RecordError
from .layouts import root_attributes
from .reading import read
from .upgrading import current
from .variables import attributes, rows_of

if TYPE_CHECKING:
    import xarray as xr

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
    given = {str(name): each for name, each in traces.variables.items() if name not in ("time", "trace", "pendulum")}
    pendulums = list(dict.fromkeys(part for label in labels for part in label.split("-")))
    if "pendulum" in traces.coords:
        pendulums = [str(label) for label in traces["pendulum"].values]
    if "combination" not in given:
        given["combination"] = xr.Variable(("trace", "pendulum"), [_combination(label, pendulums) for label in labels])
    coordinates = {"trace": labels, "pendulum": pendulums}
    groups = {}
    for group in ("record", "instrument"):
        known = {name: each for name, each in given.items() if name in rows_of(group)}
        has_traces = group == "record" or any("trace" in each.dims for each in known.values())
        of = {n: (each.dims, each.values, attributes(f"{group}/{n}") | each.attrs) for n, each in known.items()}
        of |= {
            name: ((name,), np.array(values, dtype=object), attributes(f"{group}/{name}"))
            for name, values in coordinates.items()
            if name == "pendulum" or has_traces
        }
        words = {name: traces.attrs[name] for name in _WORDS if name in traces.attrs}
        groups[f"/{group}"] = xr.Dataset(of, attrs=words)
    time = traces["time"]
    root = root_attributes("record", identifier(str(traces.attrs.get("record_id", "traces"))))
    stamps = xr.Variable(("time",), time.values, attributes("time") | time.attrs, time.encoding)
    return xr.DataTree.from_dict({"/": xr.Dataset(coords={"time": stamps}, attrs=root), **groups})


def _combination(label: str, pendulums: list[str]) -> list[float]:
    parts = label.split("-")
    if not set(parts) <= set(pendulums) or len(parts) > 2:
        raise RecordError(
            f"record/combination: missing, and trace {shown(repr(label))} does not say it; give combination, or labels "
            "such as 1 and 1-2"
        )
    return [float((name == parts[0]) - (name in parts[1:])) for name in pendulums]
