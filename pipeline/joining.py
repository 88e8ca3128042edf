"""Part records of one film or cruise put together: one after the other, on the clock of the first."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from xarray import Dataset, DataTree

from data_schemas.errors import RecordError, UsageError
from pipeline.observation import epoch_of

UNCERTAIN = "_uncertainty"


def join_records(records: Sequence[DataTree], names: Sequence[str]) -> DataTree:
    """Join valid records of the same pendulums and instrument, in any order; faults call them by `names`.

    The result is a record in the time of the earliest. Of constants' uncertainties the largest counts; a variable over
    time that a part lacks is missing there; flags of all films are flags of it.

    `UsageError`: fewer than two records; `RecordError`: they overlap in time, or differ in traces, pendulums or a
    constant.
    """
    if len(records) < 2:
        raise UsageError("join wants two part records or more")
    epochs = [epoch_of(record).get("epoch", 0.0) for record in records]
    begins = [epoch + float(record.dataset["time"].values[0]) for epoch, record in zip(epochs, records, strict=True)]
    order = [int(k) for k in np.argsort(begins, kind="stable")]
    parts, named = [records[k] for k in order], [names[k] for k in order]
    first = parts[0]
    shifts = [epochs[k] - epochs[order[0]] for k in order]
    times = [part.dataset["time"].values + shift for part, shift in zip(parts, shifts, strict=True)]
    for k in range(1, len(parts)):
        if times[k][0] <= times[k - 1][-1]:
            raise RecordError(
                f"{named[k]}: begins {times[k - 1][-1] - times[k][0]:.3f} s before {named[k - 1]} ends; say when each "
                "began: start_time in the film's TOML, or the date in the units of time"
            )
    groups: dict[str, Any] = {}
    for group in ("record", "instrument", "film"):
        own = [part.children[group].to_dataset(inherit=False) for part in parts if group in part.children]
        if own and len(own) < len(parts) and group == "instrument":
            raise RecordError(f"{named[0]} and others: some have no /instrument; give each part the same constants")
        if own:
            groups[f"/{group}"] = _joined(group, own, [time.size for time in times], named)
    attributes = dict(first.attrs) | {"history": f"joined by isochrony from {', '.join(named)}"}
    attributes.pop("content_sha256", None)
    whole = ("time", np.concatenate(times), dict(first.dataset["time"].attrs))
    groups["/"] = Dataset(coords={"time": whole}, attrs=attributes)
    return DataTree.from_dict(groups)


def _joined(group: str, parts: list[Dataset], sizes: list[int], names: Sequence[str]) -> Dataset:
    """One group of all parts."""
    first = parts[0]
    found: dict[str, Any] = {}
    for name in dict.fromkeys(str(name) for part in parts for name in part.variables):
        rows = [part[name] if name in part.variables else None for part in parts]
        pattern = next(row for row in rows if row is not None)
        given = [np.asarray(row.values) for row in rows if row is not None]
        same = all(np.array_equal(each, given[0]) for each in given[1:])
        if "time" in pattern.dims or (name == "elongation_uncertainty" and not same):
            found[name] = _along_time(name, rows, pattern, sizes, group, names)
            continue
        if group != "film" and not name.endswith(UNCERTAIN) and (not same or len(given) < len(rows)):
            other = next(k for k, row in enumerate(rows) if row is None or not np.array_equal(row.values, given[0]))
            raise RecordError(f"{names[other]}: {group}/{name} is not that of {names[0]}; state the same in both")
        value = np.max(given, axis=0) if not same and pattern.dtype.kind == "f" else given[0]
        if not same and pattern.dtype.kind not in "fiu":
            value = np.array(", ".join(dict.fromkeys(str(each) for each in given)))
        found[name] = (pattern.dims, value, dict(pattern.attrs))
    attributes = dict(first.attrs)
    if group == "film":
        flags = [flag for part in parts for flag in str(part.attrs.get("flags", "")).split(", ") if flag]
        attributes["flags"] = ", ".join(dict.fromkeys(flags))
    elif any(part.attrs != first.attrs for part in parts):
        raise RecordError(f"{names[0]} and others: the attributes of /{group} differ; state the same in all")
    labels = {name: found.pop(name) for name in list(found) if name in first.coords}
    return Dataset(found, coords=labels, attrs=attributes)


def _along_time(
    name: str, rows: list[Any], pattern: Any, sizes: list[int], group: str, names: Sequence[str]
) -> tuple[tuple[str, ...], Any, dict[str, Any]]:
    """A variable over time; one that was a number in each part becomes one where the parts differ."""
    dims = pattern.dims if "time" in pattern.dims else (*pattern.dims, "time")
    shape = pattern.shape[:-1] if "time" in pattern.dims else pattern.shape
    missing = 0 if pattern.dtype.kind in "iu" else np.nan
    pieces = []
    for row, size, part in zip(rows, sizes, names, strict=True):
        if row is None and group == "instrument":
            raise RecordError(f"{part}: {group}/{name} is missing, which others state; state it in all")
        if row is None:
            pieces.append(np.full((*shape, size), missing, dtype=pattern.dtype))
        else:
            values = np.asarray(row.values)
            pieces.append(values if "time" in row.dims else np.repeat(values[..., None], size, axis=-1))
    if name == "time_uncertainty":  # a part that states none has none
        pieces = [np.nan_to_num(piece) for piece in pieces]
    return dims, np.concatenate(pieces, axis=-1), dict(pattern.attrs)
