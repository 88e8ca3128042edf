"""Brings what a user has in memory into the form of a record: trees with dates, edited by hand, datasets of traces."""

import os
from typing import TYPE_CHECKING

import numpy as np

from .contents import from_tree, identifier, shown, to_tree
from .errors import RecordError
from .layouts import root_attributes
from .reading import read
from .unpacking import current
from .variables import attributes, rows_of

if TYPE_CHECKING:
    import xarray as xr

_WORDS = ("restoring", "reference", "acceleration_frame")


def adopted(given: "xr.DataTree | xr.Dataset | str | os.PathLike[str]") -> "xr.DataTree":
    """A record as the pipeline takes it: of a file, a DataTree with dates or edited by hand, or a Dataset of traces.

    Dates become seconds. A dataset holds variables of /record and /instrument side by side; without `combination`, the
    traces' labels say it ("1", "1-2"). `FileError`: a file that cannot be read, or a variable that no file can hold.
    `RecordError`: labels that do not say which pendulums a trace records.
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


def _laid_out(traces: "xr.Dataset") -> "xr.DataTree":
    import xarray as xr

    if "trace" not in traces.dims or "time" not in traces.coords:
        told = "a dataset of traces has dimensions trace and time; name them, with coordinates"
        raise RecordError(f"record/trace: {told}")
    labels = [str(label) for label in traces["trace"].values]
    parts = dict.fromkeys(part for label in labels for part in label.split("-"))
    pendulums = [str(each) for each in (traces["pendulum"].values if "pendulum" in traces.coords else parts)]
    given = {str(n): each for n, each in traces.variables.items() if n not in ("time", "trace", "pendulum")}
    if "combination" not in given:
        given["combination"] = xr.Variable(("trace", "pendulum"), [_combination(label, pendulums) for label in labels])
    words = {name: traces.attrs[name] for name in _WORDS if name in traces.attrs}
    root = root_attributes("record", identifier(str(traces.attrs.get("record_id", "traces"))))
    time = traces["time"].variable
    stamps = xr.Variable(("time",), time.values, attributes("time") | time.attrs, time.encoding)
    groups = {"/": xr.Dataset(coords={"time": stamps}, attrs=root)}
    for group in ("record", "instrument"):
        known = {n: each for n, each in given.items() if n in rows_of(group)}
        if group == "record" or any("trace" in each.dims for each in known.values()):
            known["trace"] = xr.Variable("trace", np.array(labels, dtype=object))
        known["pendulum"] = xr.Variable("pendulum", np.array(pendulums, dtype=object))
        filled = {n: (each.dims, each.values, attributes(f"{group}/{n}") | each.attrs) for n, each in known.items()}
        groups[f"/{group}"] = xr.Dataset(filled, attrs=words)
    return xr.DataTree.from_dict(groups)


def _combination(label: str, pendulums: list[str]) -> list[float]:
    parts = label.split("-")
    if not set(parts) <= set(pendulums) or len(parts) > 2:
        remedy = "give combination, or labels such as 1 and 1-2"
        raise RecordError(f"record/combination: missing, and trace {shown(repr(label))} does not say it; {remedy}")
    return [float((name == parts[0]) - (name in parts[1:])) for name in pendulums]
