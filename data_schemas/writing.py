"""Writes a tree to a file that is either whole or not there.

Made in memory with checksums on every array, written under a temporary name in the same folder, flushed, read back,
compared, and only then given its name: a full disk, a kill or a fault of the library leaves the folder as it was.
"""

import contextlib
import os
import secrets
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import h5py
import numpy as np
from h5py import h5a, h5ds, h5s, h5t
from numpy.typing import NDArray

from .checksum import ATTRIBUTE, digest
from .contents import Contents, Entry, Group, from_tree, key, shown, type_name
from .errors import FileError
from .guard import BOOKKEEPING, Budget, survey
from .unpacking import PACKING

if TYPE_CHECKING:
    import xarray as xr

CHUNK = 1 << 16  # elements: half a MiB of float64, a fraction of a second of record to lose to one damaged byte
PLACEHOLDER = "This is a netCDF dimension but not a netCDF variable."  # as all programs write it
NOT_COORDINATE = "_nc4_non_coord_"
LIBRARY = ("v110", "v110")  # the first format whose metadata carry checksums, and no later one than readers know
_TEXT = np.empty((), dtype=h5py.string_dtype())
_TEXTS, _SCALAR = h5t.py_create(_TEXT.dtype, logical=True), h5s.create(h5s.SCALAR)
_BLOCK = 1 << 22  # bytes


def write(tree: "xr.DataTree", path: str | os.PathLike[str], *, overwrite: bool = False, owner: str = "") -> None:
    """Write a record, truth or result; what it means is not looked at: that is `check`.

    Parameters
    ----------
    tree : xarray.DataTree
        Variables of plain numbers or text.
    path : path
        Of the file to make; its folder must exist.
    overwrite : bool
        Whether an existing file may be replaced.
    owner : str
        Of the temporary file, part of its name.

    Raises
    ------
    FileError
        The file exists, the folder does not or cannot be written, the disk is full, or a variable has a type
        or name that no file can hold. Nothing is left behind, and an older file stays as it was.
    """
    with Placed(path, overwrite=overwrite, owner=owner) as place, place.named():
        try:
            contents = from_tree(tree)
            contents[""].attrs.pop(ATTRIBUTE, None)
            contents[""].attrs[ATTRIBUTE] = digest(contents)
            image = encoded(contents)
        except FileError as error:
            raise FileError(f"{shown(path, 400)}: {error}") from None
        _flushed(place.temporary, image)
        if not _verified(place.temporary, image):
            raise FileError(f"{shown(path, 400)}: was not written, the disk gives other bytes back; check the disk")
        place.publish()


def write_text(text: str, path: str | os.PathLike[str], *, overwrite: bool = False, owner: str = "") -> None:
    """Write a text file that is either whole or not there, UTF-8; raises as `write`."""
    with Placed(path, overwrite=overwrite, owner=owner) as place, place.named():
        _flushed(place.temporary, memoryview(text.encode()))
        place.publish()


class Placed:
    """A file made under a `temporary` name beside its own, removed at the end of the block if it got no name.

    `FileError`, at once, where no file can be or one is that may not be replaced.
    """

    def __init__(self, path: str | os.PathLike[str], *, overwrite: bool = False, owner: str = "") -> None:
        self.path, self.overwrite, self.target = path, overwrite, place_of(path)
        self.temporary = beside(self.target, owner)

    def __enter__(self) -> Self:
        with self.named():
            if not self.target.parent.is_dir():
                raise FileError(f"{shown(self.path, 400)}: its folder does not exist; make the folder first")
            if os.path.lexists(self.target):
                if self.target.is_dir() or not (self.target.is_file() or self.target.is_symlink()):
                    raise FileError(f"{shown(self.path, 400)}: is not an ordinary file; give the path of a file")
                if not self.overwrite:
                    raise _exists(self.path)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        with contextlib.suppress(OSError):  # it has its name, or was never made, or went away with its folder
            self.temporary.unlink()

    def publish(self) -> None:
        """Give the finished file its name, in one step."""
        with self.named():
            give_name(self.temporary, self.target, self.path, self.overwrite)

    @contextlib.contextmanager
    def named(self) -> Iterator[None]:
        """Faults of the disk in one line that names the file."""
        try:
            yield
        except OSError as error:
            raise FileError(f"{shown(self.path, 400)}: cannot be written, {reason(error)}") from error


def place_of(path: str | os.PathLike[str]) -> Path:
    """Where a file of that name goes: folders may be links, a link of the name itself is replaced, not followed."""
    folder, name = os.path.split(os.fspath(path))
    return Path(os.path.realpath(folder or os.curdir), name)


def beside(target: Path, owner: str = "") -> Path:
    """A temporary name of its own in the folder of the target."""
    return target.with_name(f".isochrony-{owner}{secrets.token_hex(8)}.part")


def _exists(path: str | os.PathLike[str]) -> FileError:
    return FileError(f"{shown(path, 400)}: exists already; give --force (overwrite=True) to replace it")


def _flushed(temporary: Path, image: memoryview) -> None:
    """Write all bytes to a new file and wait until they are on the disk."""
    descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
    with os.fdopen(descriptor, "wb") as file:
        file.write(image)
        file.flush()
        os.fsync(file.fileno())


def _verified(temporary: Path, image: memoryview) -> bool:
    """Whether a file holds these bytes."""
    with open(temporary, "rb") as file:
        return all(file.read(_BLOCK) == image[at : at + _BLOCK] for at in range(0, len(image) + 1, _BLOCK))


def give_name(temporary: Path, target: Path, path: str | os.PathLike[str], overwrite: bool) -> None:
    """Give a file its name in one step, and make the folder remember it.

    `FileError`: a file of that name appeared in the meantime; `OSError`: the file system refuses.
    """
    if overwrite:
        os.replace(temporary, target)
    else:
        try:
            os.link(temporary, target)  # unlike a rename, refuses a file that appeared in the meantime
        except FileExistsError:
            raise _exists(path) from None
        except OSError:  # a file system without hard links
            os.replace(temporary, target)
    sync_folder(target.parent)


def sync_folder(folder: Path) -> None:
    """Make a folder remember the names in it, also through a power cut; `OSError` where the file system fails."""
    if os.name == "posix":
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def reason(error: OSError) -> str:
    """What the system says, and the remedy."""
    return f"{error.strerror or shown(error)}; free space, or choose a folder you may write to"


def chunk_shape(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Shape of a chunk of at most `CHUNK` elements, filled from the last dimension on."""
    left, chunk = CHUNK, []
    for length in reversed(shape):
        chunk.append(max(1, min(length, left)))
        left //= chunk[-1]
    return tuple(reversed(chunk))


def encoded(contents: Contents) -> memoryview:
    """The file as bytes: HDF5 1.10 format, numeric arrays chunked with fletcher32, text as variable-length UTF-8.

    A dimension of length zero becomes an unlimited one, the only kind that netCDF lets be empty. `FileError`: a name or
    attribute that netCDF reserves or cannot hold, or more than `read` takes.
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
        if not _modest(contents):
            try:
                survey(file, image.nbytes, Budget())
            except FileError as error:
                raise FileError(f"was not written, it would not read back: {error}") from None
        return image


def _modest(contents: Contents) -> bool:
    """Whether a content is so small that the guard cannot refuse its file: a survey takes a third of the writing."""
    entries = [entry for group in contents.values() for entry in group.variables.values()]
    attrs = [*(group.attrs for group in contents.values()), *(entry.attrs for entry in entries)]
    return (
        len(contents) < 32
        and max(path.count("/") for path in contents) < 4
        and sum(1 + len(entry.dims) for entry in entries) < 400
        and max((len(entry.dims) for entry in entries), default=0) < 5
        and sum(entry.values.nbytes for entry in entries) < 1 << 26
        and sum(entry.values.size for entry in entries if entry.values.dtype.kind == "U") < 4096
        and max(map(len, attrs)) < 128
        and max((np.size(value) for one in attrs for value in one.values()), default=0) < 256
        and sum(len(str(value)) for one in attrs for value in one.values()) < 1 << 22
    )


def _put(array: h5py.Dataset, values: NDArray[Any], where: str) -> None:
    """Write all values of an array, and read them back."""
    text = type_name(values) == "str"
    meant = np.array(values, dtype=_TEXT.dtype) if text else np.ascontiguousarray(values)
    array.id.write(h5s.ALL, h5s.ALL, meant)
    stored = np.empty_like(meant)
    array.id.read(h5s.ALL, h5s.ALL, stored)
    if text:
        same = b"\0".join(stored.ravel().tolist()) == "\0".join(values.ravel().tolist()).encode()
    else:
        same = stored.tobytes() == meant.tobytes()
    if not same:
        raise FileError(f"{where}: was not written, it would not read back: other values come back")


def lay_out(file: h5py.File, contents: Contents) -> dict[str, h5py.Dataset]:
    """Make all groups, dimensions and variables with their attributes, but no values and no attributes of groups.

    Gives the arrays by ``group/name``; raises as `encoded`. Dimensions are HDF5 dimension scales, as in netCDF-4.
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
            coordinate = where in arrays
            if not coordinate:  # what is called as a dimension, and is not its coordinate, has another name
                arrays[where] = _variable(made, f"{NOT_COORDINATE}{name}" if name in known else name, entry)
            write_attributes(arrays[where], entry.attrs, where)
            for axis, dim in enumerate(() if coordinate else entry.dims):
                h5ds.attach_scale(arrays[where].id, known[dim].id, axis)
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
