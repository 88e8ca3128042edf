"""Makes the bytes of a netCDF-4 file from a plain content, every array protected by its own checksums."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import h5py
import numpy as np
from h5py import h5a, h5ds, h5s, h5t
from numpy.typing import NDArray

from .contents import Contents, Entry, Group, key, shown, type_name
from .errors import FileError
from .guard import BOOKKEEPING, Budget, survey
from .upgrading import PACKING

CHUNK = 1 << 16  # elements: half a MiB of float64, a fraction of a second of record to lose to one damaged byte
PLACEHOLDER = "This is a netCDF dimension but not a netCDF variable."  # as all programs write it
NOT_COORDINATE = "_nc4_non_coord_"
LIBRARY = ("v110", "v110")  # the first format whose metadata carry checksums, and no later one than readers know
_TEXT = np.empty((), dtype=h5py.string_dtype())
_TEXTS, _SCALAR = h5t.py_create(_TEXT.dtype, logical=True), h5s.create(h5s.SCALAR)


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
        A name or attribute that netCDF reserves or cannot hold, or more than `read` takes.
    """
    with h5py.File("memory", "w", driver="core", backing_store=False, libver=LIBRARY, track_order=True) as file:
        arrays = lay_out(file, contents)
        for path, group in contents.items():
            write_attributes(file["/" + path], group.attrs, path or "root")
            for name, entry in group.variables.items():
                if entry.values.size:
                    _put(arrays[key(path, name)], entry.values, key(path, name))
        file.flush()
        image = memoryview(file.id.get_file_image())
        try:
            survey(file, image.nbytes, Budget())
        except FileError as error:
            raise FileError(f"was not written, it would not read back: {error}") from None
        return image


def _put(array: h5py.Dataset, values: NDArray[Any], where: str) -> None:
    """Write all values of an array, and read them back."""
    if type_name(values) == "str":
        array[...] = values.astype(object)
        same = array.asstr()[...].tolist() == values.tolist()
    else:
        meant = np.ascontiguousarray(values)
        array.id.write(h5s.ALL, h5s.ALL, meant)
        stored = np.empty_like(meant)
        array.id.read(h5s.ALL, h5s.ALL, stored)
        same = stored.tobytes() == meant.tobytes()
    if not same:
        raise FileError(f"{where}: was not written, it would not read back: other values come back")


def lay_out(file: h5py.File, contents: Contents) -> dict[str, h5py.Dataset]:
    """Make all groups, dimensions and variables with their attributes, but no values and no attributes of groups.

    Gives the arrays of the variables, by ``group/name``.

    Dimensions are HDF5 dimension scales, as netCDF-4 has them: a coordinate is its own, others have a placeholder.

    Raises
    ------
    FileError
        As `encoded`.
    """
    scales: dict[str, dict[str, h5py.Dataset]] = {}
    arrays: dict[str, h5py.Dataset] = {}
    number = 0
    for path in sorted(contents, key=lambda one: (one.count("/"), one)):
        made = file.create_group("/" + path, track_order=True) if path else file
        scales[path] = known = dict(scales[path.rpartition("/")[0]]) if path else {}
        variables = contents[path].variables
        for dim, length in _lengths(contents[path], path).items():
            if dim in known and known[dim].shape == (length,):
                continue
            if dim in variables and variables[dim].dims == (dim,):
                known[dim] = arrays[key(path, dim)] = _variable(made, dim, variables[dim])
                known[dim].make_scale(dim)
            else:
                chunks = (1,) if not length else None
                known[dim] = made.create_dataset(dim, (length,), ">f4", maxshape=(length or None,), chunks=chunks)
                known[dim].make_scale(f"{PLACEHOLDER}{length:10d}")
            known[dim].attrs.create("_Netcdf4Dimid", number, dtype=np.int32)
            number += 1
        for name, entry in variables.items():
            where = key(path, name)
            _usable(name, where)
            if where not in arrays:
                # what is called as a dimension, and is not its coordinate, has another name
                stored = _variable(made, f"{NOT_COORDINATE}{name}" if name in known else name, entry)
                write_attributes(stored, entry.attrs, where)
                for axis, dim in enumerate(entry.dims):
                    h5ds.attach_scale(stored.id, known[dim].id, axis)
                arrays[where] = stored
            else:
                write_attributes(arrays[where], entry.attrs, where)
    return arrays


def _lengths(group: Group, path: str) -> dict[str, int]:
    """Length of each dimension of the group's variables, by name."""
    lengths: dict[str, int] = {}
    for name, entry in group.variables.items():
        for dim, length in zip(entry.dims, entry.values.shape, strict=True):
            _usable(dim, f"{key(path, name)}, dimension {shown(dim)}")
            lengths[dim] = length
    return dict(sorted(lengths.items()))


def _variable(group: Any, name: str, entry: Entry) -> h5py.Dataset:
    text, shape = type_name(entry.values) == "str", entry.values.shape
    made: dict[str, Any] = {"dtype": h5py.string_dtype() if text else entry.values.dtype}
    if not entry.values.size:
        made |= {"maxshape": tuple(length or None for length in shape), "chunks": chunk_shape(shape)}
    if entry.dims and not text:
        made |= {"chunks": chunk_shape(shape), "fletcher32": True}
    return group.create_dataset(name, shape, **made)


def write_attributes(target: Any, attrs: Mapping[str, Any], where: str) -> None:
    """Give attributes to a group or variable; raises as `encoded`."""
    for name, value in attrs.items():
        if name.encode() in BOOKKEEPING or name in PACKING:
            raise FileError(f"{where}, attribute {shown(name)}: is reserved by netCDF; remove it")
        _usable(name, f"{where}, attribute {shown(name)}")
        if isinstance(value, str):
            _TEXT[()] = value
            h5a.create(target.id, name.encode(), _TEXTS, _SCALAR).write(_TEXT)
        else:
            target.attrs[name] = np.array(value, dtype=object) if isinstance(value, list) else value


def _usable(name: str, where: str) -> None:
    odd = name in ("", ".", "..") or "/" in name or name.startswith("_nc4_")
    if odd or not name.isprintable() or len(name.encode()) > 255:
        raise FileError(f"{where}: is no name for netCDF; rename it")
