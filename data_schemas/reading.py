"""Reads a file into memory, or its shapes and checksum alone: looked over first, read by HDF5, verified.

netCDF-4 keeps names of dimensions as references to *dimension scales*. Files of plain HDF5 have none; then the table
of variables gives the names by position, and failing that ``phony_dim_N`` by length, as netCDF does.
"""

import contextlib
import errno
import os
import zlib
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from h5py import h5a, h5d, h5o, h5r, h5s, h5t

from .checksum import ATTRIBUTE, digest
from .contents import Contents, Entry, Group, as_attribute, key, shown, to_tree
from .errors import FileError
from .guard import Budget, Found, Heaps, Survey, full_chunks, is_text, ordinary, sound_heaps, survey, text_bytes
from .layouts import REWRITTEN
from .unpacking import current, unpacked
from .variables import VARIABLES
from .writing import NOT_COORDINATE, PLACEHOLDER

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

CHUNK_CACHE = 1 << 20
"""Bytes of an array that HDF5 keeps unpacked while the file is open; its own choice of 8 MiB adds up."""
_RESERVE = 1 << 23
"""Bytes that must be free when a file is opened: where HDF5 finds none for its own it ends the process."""

Path = str | os.PathLike[str]
Declared = Callable[[int], object]
NumbersReader = Callable[[h5d.DatasetID], Any]  # gives the numbers of an array, or what reads them block by block

_MISMATCH = f"{ATTRIBUTE} does not match the content, the file was damaged or edited"
_REFERENCES = h5t.vlen_create(h5t.STD_REF_OBJ).encode()  # HDF5 also takes kinds of list that do not exist
_LISTS = h5py.vlen_dtype(h5py.ref_dtype)

# what h5py raises on a damaged file, by the place where it stumbles
_DAMAGE = (OSError, RuntimeError, KeyError, ValueError, TypeError, OverflowError, SystemError, MemoryError, zlib.error)


def read(path: Path, *, declared: Declared | None = None) -> "xr.DataTree":
    """Read a record, truth or result whole; ``time`` stays float64 seconds.

    Packed values (``scale_factor``, ``add_offset``, ``_FillValue``) of other programs are unpacked, missing ones NaN.
    The checksum attribute is verified and left out.

    Parameters
    ----------
    path : path
        A netCDF-4 file, of this or another program.
    declared : callable, optional
        Told how many bytes of values the file declares, after it was looked over and before they are read.

    Raises
    ------
    FileError
        The file is missing, damaged, hostile, or does not match its checksum. Its meaning is left to `validate`.
    """
    contents = load(path, declared=declared)
    try:
        return to_tree(contents)
    except FileError as error:
        raise FileError(f"{shown(path, 400)}: {error}") from error


@np.errstate(all="ignore")  # what becomes infinite is a fault of values, which the check reports
def load(path: Path, budget: Budget | None = None, *, declared: Declared | None = None) -> Contents:
    """The plain content of a file, looked over and verified; what `read` and `validate` share; raises as `read`."""
    with _opened(path, budget or Budget(), _numbers, declared) as (contents, found):
        stored = contents[""].attrs.pop(ATTRIBUTE, None)
        if stored is not None and stored != digest(contents):
            if _as_written(contents, found):
                raise FileError(f"{_MISMATCH}; restore it, or delete that attribute if the edit was meant")
            contents[""].attrs[REWRITTEN] = f"by other software: {ATTRIBUTE} did not fit and was left out"
        return current(unpacked(contents))


def _as_written(contents: Contents, found: Survey) -> bool:
    """Whether a file is as `write` makes them: checksums on all arrays of numbers, no fill values (as xarray gives)."""
    if any("_FillValue" in entry.attrs for group in contents.values() for entry in group.variables.values()):
        return False
    arrays = (h5py.Dataset(one.id) for one in found.arrays if one.id.shape)
    return all(one.fletcher32 or one.is_scale for one in arrays if one.dtype.kind in "iuf")


def skim(path: Path) -> tuple[Contents, str]:
    """The content of a file, without values of numbers, and the checksum of what is stored; in bounded memory.

    `FileError`: as `read`.
    """
    with _opened(path, Budget(), h5py.Dataset) as (contents, _):
        stored, found = contents[""].attrs.pop(ATTRIBUTE, None), digest(contents)
        if stored not in (None, found):
            raise FileError(_MISMATCH)
        return contents, found


@contextlib.contextmanager
def _opened(
    path: Path, budget: Budget, numbers: NumbersReader, declared: Declared | None = None
) -> Iterator[tuple[Contents, Survey]]:
    """The content as stored, of a file that passed the survey and stays open; `numbers` reads its arrays of numbers."""
    size = ordinary(path)
    try:
        heaps = sound_heaps(path)
        bytearray(_RESERVE)
        with h5py.File(path, "r", rdcc_nbytes=CHUNK_CACHE) as file:
            found = survey(file, size, budget)
            if declared is not None:
                declared(found.declared)
            yield _Reader(path, found, heaps, numbers).contents(), found
    except FileError as error:
        raise FileError(f"{shown(path, 400)}: {error}") from None
    except _DAMAGE as error:
        damage = "cannot be read, it is truncated, damaged or being written ({}); restore it"
        raise FileError(f"{shown(path, 400)}: {_cause(error, damage)}") from error


def _cause(error: Exception, damage: str) -> str:
    """What stopped the reading: a lack of memory, or the given words of damage with the reason put in."""
    lacking = isinstance(error, MemoryError) or getattr(error, "errno", None) == errno.ENOMEM
    if lacking or "memory allocation failed" in str(error):
        return "takes more memory than this process may have; give it more"
    return damage.format(shown(" ".join(str(error).split()), 120))


def _numbers(array: h5d.DatasetID) -> "NDArray[Any]":
    numbers: NDArray[Any] = np.empty(array.shape, array.get_type().dtype.newbyteorder("="))
    if numbers.size:
        array.read(h5s.ALL, h5s.ALL, numbers)
    return numbers


class _Reader:
    """Reads everything that passed the survey."""

    def __init__(self, path: Path, found: Survey, heaps: Heaps, numbers: NumbersReader) -> None:
        self._path, self._found, self._heaps, self._numbers = path, found, heaps, numbers

    def contents(self) -> Contents:
        groups = self._found.groups
        contents = {group.path: Group(self._attributes(group, group.path or "root")) for group in groups}
        for one, name, dims in list(_named(self._found)):  # all first: values push metadata out of HDF5's cache
            where, array, variables = key(one.path, name), one.id, contents[one.path].variables
            if name in variables:
                raise FileError(f"{where}: is there twice; keep one")
            try:
                full_chunks(array)
                values = self._text(array, where) if is_text(array.get_type()) else self._numbers(array)
            except _DAMAGE as error:
                raise FileError(f"{where}: {_cause(error, 'its values are damaged ({}); restore the file')}") from error
            variables[name] = Entry(dims, values, self._attributes(one, where))
        return contents

    def _text(self, array: h5d.DatasetID, where: str) -> "NDArray[Any]":
        kind = array.get_type()
        size = text_bytes(self._path, array, self._heaps, where) if kind.is_variable_str() else 0
        self._count(size, where)
        texts = np.empty(array.shape, dtype=kind.dtype)
        if texts.size:
            array.read(h5s.ALL, h5s.ALL, texts)
        decoded = [_decoded(one, where) for one in texts.ravel().tolist()]
        # each takes the longest one's length
        self._count(len(decoded) * max(map(len, decoded), default=0) - size, where)
        return np.array(decoded, dtype=np.str_).reshape(array.shape)

    def _count(self, size: int, where: str) -> None:
        """Text is counted over the whole file."""
        self._found.text += max(size, 0)
        most = self._found.budget.text_bytes
        if self._found.text > most:
            raise FileError(f"{where}: more than {most} bytes of text; shorten it")

    def _attributes(self, owner: Found, where: str) -> dict[str, Any]:
        attributes = owner.attributes.items()
        return {name: self._attribute(one, f"{where}, attribute {shown(name)}") for name, one in attributes}

    def _attribute(self, attribute: h5a.AttrID, where: str) -> Any:
        kind, space = attribute.get_type(), attribute.get_space()
        if space.get_simple_extent_type() == h5s.NULL:
            return "" if is_text(kind) else np.empty(0, dtype=kind.dtype.newbyteorder("="))
        values = np.empty(space.shape, dtype=kind.dtype if is_text(kind) else kind.dtype.newbyteorder("="))
        if is_text(kind):
            count, most = space.get_simple_extent_npoints(), 4 * self._found.budget.text_bytes
            if kind.is_variable_str() and count * self._found.heap > most:
                raise FileError(f"{where}: too many texts; join them into one")
            attribute.read(values)
            decoded = [_decoded(one, where) for one in values.ravel().tolist()]
            self._count(sum(map(len, decoded)), where)
            return decoded[0] if len(decoded) == 1 else decoded
        attribute.read(values)
        return as_attribute(values)


def _decoded(raw: bytes | str, where: str) -> str:
    try:
        return raw if isinstance(raw, str) else raw.decode("utf-8")
    except UnicodeDecodeError:
        raise FileError(f"{where}: its text is not UTF-8; write it again as UTF-8") from None


def _named(survey: Survey) -> Iterator[tuple[Found, str, tuple[str, ...]]]:
    """Every array that is a variable (placeholders are not), its name, and those of its dimensions."""
    scales = {one.address: one for one in survey.arrays if _fixed_text(one, b"CLASS") == b"DIMENSION_SCALE"}
    phony: dict[tuple[str, int, int], str] = {}
    for one in survey.arrays:
        scale = one.address in scales
        if scale and _fixed_text(one, b"NAME").startswith(PLACEHOLDER.encode()):
            continue
        name, rank = one.name.removeprefix(NOT_COORDINATE), len(one.id.shape)
        dims = (name,) if scale and rank == 1 else _attached(one, rank, scales)
        yield one, name, dims or _by_position(one, name, rank, phony)


def _attached(one: Found, rank: int, scales: dict[int, Found]) -> tuple[str, ...] | None:
    """Names of the scales that the array refers to; None unless each dimension has one of the file's own."""
    if rank == 0 or not h5a.exists(one.id, b"DIMENSION_LIST"):
        return None
    attribute = h5a.open(one.id, b"DIMENSION_LIST")
    if attribute.get_space().shape != (rank,) or attribute.get_type().encode() != _REFERENCES:
        return None
    references = np.empty(rank, dtype=_LISTS)
    attribute.read(references)
    names = dict[str, None]()
    for length, listed in zip(one.id.shape, references, strict=True):
        known = len(listed) and listed[0] and scales.get(h5o.get_info(h5r.dereference(listed[0], one.id)).addr)
        if known and known.id.shape == (length,):
            names[known.name] = None
    return tuple(names) if len(names) == rank else None


def _by_position(one: Found, name: str, rank: int, phony: dict[tuple[str, int, int], str]) -> tuple[str, ...]:
    row = VARIABLES.get(key(one.path, name))
    if row is not None:
        for dims in (row.dims, *row.also):
            if len(dims) == rank:
                return dims
    places = [(one.path, length, one.id.shape[:axis].count(length)) for axis, length in enumerate(one.id.shape)]
    return tuple(phony.setdefault(place, f"phony_dim_{len(phony)}") for place in places)


def _fixed_text(one: Found, name: bytes) -> bytes:
    """A short bookkeeping text of fixed length; empty if there is none."""
    if not h5a.exists(one.id, name):
        return b""
    attribute = h5a.open(one.id, name)
    kind = attribute.get_type()
    scalar = attribute.get_space().get_simple_extent_type() == h5s.SCALAR
    if not scalar or kind.get_class() != h5t.STRING or kind.is_variable_str() or kind.get_size() > 256:
        return b""
    text = np.empty((), dtype=f"S{kind.get_size()}")
    attribute.read(text)
    return bytes(text[()])
