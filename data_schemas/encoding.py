"""Makes the bytes of a netCDF-4 file from a plain content, every array protected by its own checksums."""

from __future__ import annotations

import io
from typing import Any

import h5netcdf
import h5py
import numpy as np

from .contents import Contents, Entry, Group, key, shown, type_name
from .errors import FileError
from .guard import BOOKKEEPING
from .packing import PACKING

CHUNK = 1 << 16  # elements: half a MiB of float64, a fraction of a second of record to lose to one damaged byte
LIBRARY = ("v110", "v110")  # the first format whose metadata carry checksums, and no later one than readers know


def chunk_shape(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Shape of a chunk of at most `CHUNK` elements, filled from the last dimension on.

    Examples
    --------
    >>> chunk_shape((2, 45001)), chunk_shape((8, 100)), chunk_shape((3, 10**6))
    ((1, 45001), (8, 100), (1, 65536))
    """
    left, chunk = CHUNK, []
    for length in reversed(shape):
        chunk.append(max(1, min(length, left)))
        left //= chunk[-1]
    return tuple(reversed(chunk))


def encoded(contents: Contents) -> memoryview:
    """The file as bytes: HDF5 1.10 format, numeric arrays chunked with fletcher32, text as variable-length UTF-8.

    A dimension of length zero becomes an unlimited one, the only kind that netCDF lets be empty.

    Raises
    ------
    FileError
        A name or attribute that netCDF reserves or cannot hold.
    """
    memory = io.BytesIO()
    with h5netcdf.File(memory, "w", libver=LIBRARY) as file:
        lay_out(file, contents)
        for path, group in contents.items():
            write_attributes(node(file, path).attrs, group.attrs, path or "root")
            for name, entry in group.variables.items():
                if entry.values.size:
                    text = type_name(entry.values) == "str"
                    node(file, path)[name][...] = entry.values.astype(object) if text else entry.values
    return memory.getbuffer()


def lay_out(file: h5netcdf.File, contents: Contents) -> None:
    """Make all groups, dimensions and variables with their attributes, but no values and no attributes of groups.

    Raises
    ------
    FileError
        As `encoded`.
    """
    dimensions: dict[str, set[str]] = {}
    for path in sorted(contents, key=lambda one: (one.count("/"), one)):
        made = file.create_group("/" + path) if path else file
        above = dimensions[path.rpartition("/")[0]] if path else set()
        dimensions[path] = above | _dimensions(made, contents[path], path, above)
        for name, entry in contents[path].variables.items():
            where = key(path, name)
            _usable(name, where)
            write_attributes(_variable(made, name, entry).attrs, entry.attrs, where)


def node(file: h5netcdf.File, path: str) -> Any:
    """A group of an open file by its path; the root for the empty one."""
    return file[path] if path else file


def _dimensions(made: Any, group: Group, path: str, above: set[str]) -> set[str]:
    """Make the dimensions that the group's variables have and no group above it has."""
    lengths: dict[str, int] = {}
    for name, entry in group.variables.items():
        for dim, length in zip(entry.dims, entry.values.shape, strict=True):
            _usable(dim, f"{key(path, name)}, dimension {shown(dim)}")
            lengths[dim] = length
    own = lengths.keys() - above
    for dim in sorted(own):
        made.dimensions[dim] = lengths[dim] or None
    return own


def _variable(group: Any, name: str, entry: Entry) -> Any:
    text = type_name(entry.values) == "str"
    made: dict[str, Any] = {"dtype": h5py.string_dtype() if text else entry.values.dtype}
    if entry.dims and not text:
        made |= {"chunks": chunk_shape(entry.values.shape), "fletcher32": True}
    elif entry.dims and not entry.values.size:
        made |= {"chunks": chunk_shape(entry.values.shape)}  # unlimited dimensions need chunks
    return group.create_variable(name, entry.dims, **made)


def write_attributes(target: Any, attrs: dict[str, Any], where: str) -> None:
    """Give attributes to a group or variable.

    Raises
    ------
    FileError
        As `encoded`.
    """
    for name, value in attrs.items():
        if name.encode() in BOOKKEEPING or name in PACKING:
            raise FileError(f"{where}, attribute {shown(name)}: is reserved by netCDF; remove it")
        _usable(name, f"{where}, attribute {shown(name)}")
        target[name] = np.array(value, dtype=object) if isinstance(value, list) else value


def _usable(name: str, where: str) -> None:
    odd = name in ("", ".", "..") or "/" in name or name.startswith("_nc4_")
    if odd or not name.isprintable() or len(name.encode()) > 255:
        raise FileError(f"{where}: is no name for netCDF; rename it")
