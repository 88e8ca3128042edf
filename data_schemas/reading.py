"""Reads a file into memory: looked over first, read by HDF5 alone, checked against its checksum."""

from __future__ import annotations

import contextlib
import errno
import os
import zlib
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from h5py import h5a, h5d, h5s

from .checksum import ATTRIBUTE, digest
from .contents import Contents, Entry, Group, key, shown, to_tree
from .dimensions import named
from .errors import FileError
from .guard import Found, Survey, full_chunks, ordinary, survey
from .guard_types import Budget, is_text
from .heaps import Heaps, sound_heaps, text_bytes
from .layouts import REWRITTEN
from .upgrading import current, unpacked

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

CHUNK_CACHE = 1 << 20
"""Bytes of an array that HDF5 keeps unpacked while the file is open; its own choice of 8 MiB adds up."""

_ROOM = 1 << 23
"""Bytes that must be free when a file is opened: where HDF5 finds none for its own it ends the process."""

NumbersReader = Callable[[h5d.DatasetID, str], "NDArray[Any]"]
"""Reads an array of numbers, given with its ``group/name``."""

# what h5py raises on a damaged file, by the place where it stumbles
_DAMAGE = (OSError, RuntimeError, KeyError, ValueError, TypeError, OverflowError, SystemError, MemoryError, zlib.error)


def read(path: str | os.PathLike[str], *, declared: Callable[[int], object] | None = None) -> xr.DataTree:
    """Read a record, truth or result.

    Parameters
    ----------
    path : path
        A netCDF-4 file, of this or another program.
    declared : callable, optional
        Told how many bytes of values the file declares, after it was looked over and before they are read.

    Returns
    -------
    xarray.DataTree
        All read, the file closed. ``time`` stays float64 seconds. Packed values (``scale_factor``, ``add_offset``,
        ``_FillValue``) of other programs are unpacked, missing ones NaN. The checksum attribute is verified and left
        out.

    Raises
    ------
    FileError
        The file is missing, damaged, hostile, or does not match its checksum. What it means is not looked at:
        that is `validate`.
    """
    contents = load(path, declared=declared)
    try:
        return to_tree(contents)
    except FileError as error:
        raise FileError(f"{shown(path, 400)}: {error}") from error


@np.errstate(all="ignore")  # what becomes infinite is a fault of values, which the check tells
def load(
    path: str | os.PathLike[str], budget: Budget | None = None, *, declared: Callable[[int], object] | None = None
) -> Contents:
    """The plain content of a file, looked over and verified; what `read` and `validate` share.

    Raises
    ------
    FileError
        As `read`.
    """
    contents = load_raw(path, budget or Budget(), declared=declared)
    stored = contents[""].attrs.pop(ATTRIBUTE, None)
    if stored is not None and stored != digest(contents):
        if _as_written(path, contents):
            raise FileError(
                f"{shown(path, 400)}: {ATTRIBUTE} does not match the content, the file was damaged or edited; "
                f"restore it, or delete that attribute if the edit was meant"
            )
        contents[""].attrs[REWRITTEN] = f"by other software: {ATTRIBUTE} did not fit and was left out"
    try:
        return current(unpacked(contents))
    except FileError as error:
        raise FileError(f"{shown(path, 400)}: {error}") from None


def _as_written(path: str | os.PathLike[str], contents: Contents) -> bool:
    """Whether a file is as `write` makes them: checksums on all arrays of numbers, and no fill values.

    xarray's `to_netcdf` carries checksums over from a file that has them, but gives every array of floats a fill value.
    """
    if any("_FillValue" in entry.attrs for group in contents.values() for entry in group.variables.values()):
        return False
    found: list[bool] = []

    def note(_name: str, node: Any) -> None:
        if isinstance(node, h5py.Dataset) and node.shape and node.dtype.kind in "iuf":
            found.append(node.fletcher32 or bool(h5py.h5ds.is_scale(node.id)))

    with h5py.File(path, "r") as file:
        file.visititems(note)
    return all(found)


def load_raw(
    path: str | os.PathLike[str], budget: Budget, *, declared: Callable[[int], object] | None = None
) -> Contents:
    """The content as stored: checksum not verified, nothing unpacked.

    Raises
    ------
    FileError
        The file is missing, damaged or hostile.
    """
    with opened(path, budget, declared=declared) as contents_by:
        return contents_by(_numbers)


@contextlib.contextmanager
def opened(
    path: str | os.PathLike[str], budget: Budget, *, declared: Callable[[int], object] | None = None
) -> Iterator[Callable[[NumbersReader], Contents]]:
    """A file that passed the survey, open for reading: give a reader of arrays of numbers, get the content.

    Raises
    ------
    FileError
        The file is missing, damaged or hostile, on opening or while it is read.
    """
    size = ordinary(path)
    try:
        heaps = sound_heaps(path)
        bytearray(_ROOM)
        with h5py.File(path, "r", rdcc_nbytes=CHUNK_CACHE) as file:
            found = survey(file, size, budget)
            if declared is not None:
                declared(found.declared)
            yield lambda numbers: _contents(found, lambda one, where: _text(path, one, heaps, where, found), numbers)
    except FileError as error:
        raise FileError(f"{shown(path, 400)}: {error}") from None
    except _DAMAGE as error:
        damage = "cannot be read, it is truncated, damaged or being written ({}); restore it"
        raise FileError(f"{shown(path, 400)}: {_told(error, damage)}") from error


def _told(error: Exception, damage: str) -> str:
    """What stopped the reading: a lack of memory, or the given words of damage with the reason put in."""
    lacking = isinstance(error, MemoryError) or getattr(error, "errno", None) == errno.ENOMEM
    if lacking or "memory allocation failed" in str(error):
        return "takes more memory than this process may have; give it more"
    return damage.format(shown(" ".join(str(error).split()), 120))


def _contents(
    found: Survey,
    text: Callable[[h5d.DatasetID, str], NDArray[Any]],
    numbers: NumbersReader,
) -> Contents:
    """Everything that passed the survey; `text` reads the arrays of text, `numbers` the others."""
    contents = {group.path: Group(_attributes(group, group.path or "root", found)) for group in found.groups}
    for one in named(found):
        where = key(one.array.path, one.name)
        variables = contents[one.array.path].variables
        if one.name in variables:
            raise FileError(f"{where}: is there twice; keep one")
        try:
            full_chunks(one.array.id)
            values = (text if is_text(one.array.id.get_type()) else numbers)(one.array.id, where)
        except _DAMAGE as error:
            raise FileError(f"{where}: {_told(error, 'its values are damaged ({}); restore the file')}") from error
        variables[one.name] = Entry(one.dims, values, _attributes(one.array, where, found))
    return contents


def _numbers(array: h5d.DatasetID, _where: str) -> NDArray[Any]:
    numbers: NDArray[Any] = np.empty(array.shape, array.get_type().dtype.newbyteorder("="))
    if numbers.size:
        array.read(h5s.ALL, h5s.ALL, numbers)
    return numbers


def _text(path: str | os.PathLike[str], array: h5d.DatasetID, heaps: Heaps, where: str, found: Survey) -> NDArray[Any]:
    kind = array.get_type()
    size = text_bytes(path, array, heaps, where) if kind.is_variable_str() else 0
    _counted(size, where, found)
    texts = np.empty(array.shape, dtype=kind.dtype)
    if texts.size:
        array.read(h5s.ALL, h5s.ALL, texts)
    decoded = [_decoded(one, where) for one in texts.ravel().tolist()]
    _counted(len(decoded) * max(map(len, decoded), default=0) - size, where, found)  # each takes the longest one's room
    return np.array(decoded, dtype=np.str_).reshape(array.shape)


def _counted(size: int, where: str, found: Survey) -> None:
    """Text is counted over the whole file."""
    found.text += max(size, 0)
    if found.text > found.budget.text_bytes:
        raise FileError(f"{where}: more than {found.budget.text_bytes} bytes of text; shorten it")


def _attributes(owner: Found, where: str, found: Survey) -> dict[str, Any]:
    attrs = {}
    for attribute in owner.attributes:
        name = attribute.name.decode("utf-8", "replace")
        attrs[name] = _attribute(attribute, f"{where}, attribute {shown(name)}", found)
    return attrs


def _attribute(attribute: h5a.AttrID, where: str, found: Survey) -> Any:
    kind, space = attribute.get_type(), attribute.get_space()
    if space.get_simple_extent_type() == h5s.NULL:
        return "" if is_text(kind) else np.empty(0, dtype=kind.dtype.newbyteorder("="))
    shape = space.shape
    if is_text(kind):
        if kind.is_variable_str() and space.get_simple_extent_npoints() * found.heap > 4 * found.budget.text_bytes:
            raise FileError(f"{where}: too many texts; join them into one")
        texts = np.empty(shape, dtype=kind.dtype)
        attribute.read(texts)
        decoded = [_decoded(one, where) for one in texts.ravel().tolist()]
        _counted(sum(map(len, decoded)), where, found)
        return decoded[0] if len(decoded) == 1 else decoded
    numbers: NDArray[Any] = np.empty(shape, dtype=kind.dtype.newbyteorder("="))
    attribute.read(numbers)
    if numbers.size != 1:
        return numbers
    number = numbers.ravel()[0]
    return number.item() if number.dtype.str[1:] in ("i8", "f8") else number


def _decoded(raw: bytes | str, where: str) -> str:
    try:
        return raw if isinstance(raw, str) else raw.decode("utf-8")
    except UnicodeDecodeError:
        raise FileError(f"{where}: its text is not UTF-8; write it again as UTF-8") from None
