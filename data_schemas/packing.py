"""Undoes the packing of other programs: scale, offset, fill and missing values (CF 2.5.1 and 8.1)."""

from __future__ import annotations

from typing import Any

import numpy as np

from .contents import Contents, Entry, key, shown
from .errors import FileError

PACKING = ("scale_factor", "add_offset", "_FillValue", "missing_value")


def unpacked(contents: Contents) -> Contents:
    """The content with packed values unpacked in place to float64, and missing ones NaN.

    Integers without scale or offset stay as they are, whatever their fill value: they are flags and counts.

    Raises
    ------
    FileError
        A packing attribute is not a number.
    """
    for path, group in contents.items():
        for name, entry in group.variables.items():
            if any(attribute in entry.attrs for attribute in PACKING):
                _unpack(entry, key(path, name))
    return contents


def _unpack(entry: Entry, where: str) -> None:
    found = {name: entry.attrs.pop(name) for name in PACKING if name in entry.attrs}
    stored = entry.values
    if stored.dtype.kind == "U":
        return
    numbers = {name: _number(value, f"{where}, attribute {name}") for name, value in found.items()}
    packed = "scale_factor" in numbers or "add_offset" in numbers
    if stored.dtype.kind != "f" and not packed:
        return
    values = stored.astype(np.float64) if packed else stored.copy()
    if packed:
        values *= numbers.get("scale_factor", 1.0)
        values += numbers.get("add_offset", 0.0)
    for name in ("_FillValue", "missing_value"):
        if name in numbers:
            values[stored == numbers[name]] = np.nan
    entry.values = values


def _number(value: Any, where: str) -> Any:
    number = np.asarray(value)
    if number.dtype.kind not in "iuf" or number.size != 1:
        raise FileError(f"{where}: is {shown(repr(value), 40)}, not a number; give one number or remove it")
    return number.ravel()[0]
