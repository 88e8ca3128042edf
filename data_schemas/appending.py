"""Writes a tree to a file portion by portion, in bounded memory; the file is whole or not there.

As `writing`: under a temporary name in the same folder, flushed to the disk, read back and compared with what was
meant, and only then given its name.
"""

from __future__ import annotations

import contextlib
import os
import zlib
from collections.abc import Iterator
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import h5py
import numpy as np

from .checksum import ATTRIBUTE
from .contents import Contents, Entry, Group, key, shown, type_name
from .encoding import LIBRARY, array, lay_out, node, write_attributes
from .errors import FileError
from .joining import samples
from .reading import CHUNK_CACHE
from .shield import shielded
from .sink import Sink
from .slabs import skim
from .writing import beside, give_name, may_write, place_of, reason

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Appended:
    """A file that grows along one dimension; a context manager, whose end without `publish` leaves nothing behind.

    Parameters
    ----------
    path : path
        Of the file to make; its folder must exist.
    length : int
        Of the whole along `along`.
    along : str
        The dimension that grows. Variables without it are those of the first portion, attributes those of the last.
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    FileError
        As `write`, from any method.

    Examples
    --------
    >>> import tempfile
    >>> portion = {"": Group({}, {"a": Entry(("time",), np.array([1.0, 2.0]))})}
    >>> with tempfile.TemporaryDirectory() as folder, Appended(f"{folder}/a.nc", 4) as file:
    ...     file.append(portion)
    ...     file.append(portion)
    ...     file.finish()
    ...     file.publish()
    """

    def __init__(
        self, path: str | os.PathLike[str], length: int, *, along: str = "time", overwrite: bool = False
    ) -> None:
        self._path, self._length, self._along, self._overwrite = path, length, along, overwrite
        self._target = place_of(path)
        self._temporary = beside(self._target)
        self._sink: Sink | None = None
        self._file: h5py.File | None = None
        self._attrs: dict[str, dict[str, Any]] = {}
        self._done = 0
        self._meant: dict[str, RowSums] = {}

    def __enter__(self) -> Self:
        with self._told():
            may_write(self._target, self._path, self._overwrite)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        with shielded():
            if self._sink is not None:
                self._sink.fault = OSError("thrown away")  # so that no more is written
            with contextlib.suppress(Exception):  # what counts was raised already
                self._close()
            with contextlib.suppress(OSError):  # renamed already, or never made
                self._temporary.unlink()

    def append(self, contents: Contents) -> None:
        """Write the next portion: of the same groups, variables and types as the first."""
        with shielded(), self._told():
            first = self._file is None
            if self._file is None:
                self._open("x+", "w")
                lay_out(self._file, self._whole(contents))
            begin, self._done = self._done, self._done + samples(contents, self._along)
            for path, group in contents.items():
                self._attrs[path] = group.attrs
                for name, entry in group.variables.items():
                    grows = self._along in entry.dims
                    if (first or grows) and entry.values.size:
                        place = (..., slice(begin, self._done)) if grows else ...
                        text = type_name(entry.values) == "str"
                        stored = entry.values.astype(object) if text else entry.values
                        array(self._file, path, name)[place] = stored
                    if grows:
                        self._meant.setdefault(key(path, name), RowSums(self._length)).add(entry.values)
            self._check()

    def finish(self) -> None:
        """Bring the file to the disk and verify it, so that `publish` only gives it its name.

        Raises
        ------
        ValueError
            If samples are missing.
        """
        if self._file is None or self._done != self._length:
            raise ValueError(f"{self._done} of {self._length} samples were appended")
        with shielded(), self._told():
            for path, attrs in self._attrs.items():
                attrs.pop(ATTRIBUTE, None)
                write_attributes(node(self._file, path).attrs, attrs, path or "root")
            self._close()
        with self._told():
            digest = self._verified()
        with shielded(), self._told():
            self._open("r+", "r+")
            self._file.attrs[ATTRIBUTE] = digest
            self._close(lasting=True)

    def publish(self) -> None:
        """Give the finished file its name, in one step."""
        with self._told():
            give_name(self._temporary, self._target, self._path, self._overwrite)

    def _open(self, mode: str, file_mode: str) -> None:
        self._sink = Sink(self._temporary, mode)
        self._file = h5py.File(self._sink, file_mode, libver=LIBRARY, rdcc_nbytes=CHUNK_CACHE, track_order=True)

    def _check(self) -> None:
        if self._sink is not None:
            self._sink.check()

    def _close(self, *, lasting: bool = False) -> None:
        """Close the file; if it is to be `lasting`, wait until it is on the disk.

        Raises
        ------
        BaseException
            Whatever went wrong since the last check.
        """
        file, sink, self._file, self._sink = self._file, self._sink, None, None
        if sink is None:
            return
        with sink:
            if file is not None:
                file.close()
            sink.check()
            if lasting:
                os.fsync(sink.fileno())

    def _whole(self, first: Contents) -> Contents:
        """The content with its final shapes; values that grow take no memory."""
        whole = {}
        for path, group in first.items():
            entries = {}
            for name, entry in group.variables.items():
                if self._along in entry.dims[:-1]:
                    raise FileError(f"{key(path, name)}: grows along {self._along!r}; make that its last dimension")
                shape = (*entry.values.shape[:-1], self._length) if self._along in entry.dims else entry.values.shape
                entries[name] = Entry(entry.dims, np.broadcast_to(np.zeros((), entry.values.dtype), shape), entry.attrs)
            whole[path] = Group({}, entries)
        return whole

    def _verified(self) -> str:
        """The checksum of the file as it is on the disk, every value that was appended compared with what was meant."""
        seen = {where: RowSums(self._length) for where in self._meant}

        def watch(where: str, numbers: NDArray[Any]) -> None:
            if where in seen:
                seen[where].add_flat(numbers)

        try:
            _, digest = skim(self._temporary, watch)
        except FileError as error:
            told = str(error).removeprefix(f"{shown(self._temporary, 400)}: ")
            raise FileError(f"was not written, it would not read back: {told}") from error
        for where, sums in seen.items():
            if sums != self._meant[where]:
                raise FileError(f"was not written, {where} reads back differently; try again, or check the disk")
        return digest

    @contextlib.contextmanager
    def _told(self) -> Iterator[None]:
        """Faults of the disk and of HDF5 in one line that names the file."""
        name = shown(self._path, 400)
        try:
            yield
        except FileError as error:
            told = str(error)
            raise error if told.startswith(f"{name}: ") else FileError(f"{name}: {told}") from None
        except Exception as error:
            # HDF5 stumbles over what the sink kept from it: then that is what went wrong
            cause = error if self._sink is None or self._sink.fault is None else self._sink.fault
            if isinstance(cause, OSError):
                raise FileError(f"{name}: cannot be written, {reason(cause)}") from error
            raise cause from None


class RowSums:
    """CRC-32 of every row of an array whose rows come in portions, or in one stream of elements.

    Examples
    --------
    >>> whole, cut = RowSums(4), RowSums(4)
    >>> values = np.arange(8.0).reshape(2, 4)
    >>> whole.add(values[:, :3])
    >>> whole.add(values[:, 3:])
    >>> cut.add_flat(values.ravel()[:5])
    >>> cut.add_flat(values.ravel()[5:])
    >>> whole == cut
    True
    """

    def __init__(self, length: int) -> None:
        self._length = length
        self._sums: list[int] = []
        self._passed = 0

    def add(self, values: NDArray[Any]) -> None:
        """Portion of all rows, (..., samples)."""
        rows = values.reshape(-1, values.shape[-1])
        self._sums = self._sums or [0] * len(rows)
        for number, row in enumerate(rows):
            self._sums[number] = zlib.crc32(row.tobytes(), self._sums[number])

    def add_flat(self, values: NDArray[Any]) -> None:
        """Elements in order, row after row."""
        flat = values.reshape(-1)
        while flat.size:
            left = self._length - self._passed % self._length
            if left == self._length:
                self._sums.append(0)
            part, flat = flat[:left], flat[left:]
            self._sums[-1] = zlib.crc32(part.tobytes(), self._sums[-1])
            self._passed += part.size

    def __eq__(self, other: object) -> bool:
        return isinstance(other, RowSums) and self._sums == other._sums

    __hash__ = None  # type: ignore[assignment]  # what changes is no key
