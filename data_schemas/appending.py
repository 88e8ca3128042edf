"""Writes a tree to a file portion by portion, in bounded memory; the file is whole or not there, as by `writing`."""

import contextlib
import io
import os
from collections.abc import Callable, Iterator
from functools import partial
from types import TracebackType
from typing import Any

import h5py
import numpy as np

from .checksum import ATTRIBUTE
from .contents import Contents, Entry, Group, key, shown, type_name
from .errors import FileError
from .reading import CHUNK_CACHE, skim
from .shield import shielded
from .writing import LIBRARY, Placed, lay_out, reason, write_attributes

_ALONG = "time"  # the dimension that grows


class Sink(io.FileIO):
    """A file of bytes; what goes wrong is kept in `fault`, and nothing is written after that.

    What could not be written is remembered and read back: HDF5 trusts what it reads, and crashes on what is not as it
    wrote it. Memory for that is bounded by what is written until `check` is called.
    """

    def __init__(self, path: Any, mode: str) -> None:
        super().__init__(path, mode)
        self.fault: BaseException | None = None
        self._lost: list[tuple[int, bytes]] = []

    def check(self) -> None:
        """Raise what went wrong, if anything did."""
        if self.fault is not None:
            raise self.fault

    def write(self, data: Any, /) -> int:
        """Write all bytes, at once or in parts."""
        view, at = memoryview(data).cast("B"), self.tell()
        while (done := self.tell() - at) < len(view) and self.fault is None:
            self._kept(partial(super().write, view[done:]))
        if self.fault is not None:
            self._lost.append((at, bytes(view)))
        return len(view)

    def readinto(self, buffer: Any, /) -> int:
        """Fill a buffer with what was written, to the disk or not; zeros beyond the end."""
        view = memoryview(buffer).cast("B")
        begin, known = self.tell(), 0
        while known < len(view) and (more := super().readinto(view[known:])):
            known += more
        view[known:] = bytes(len(view) - known)
        for at, data in self._lost:
            first, last = max(at, begin), min(at + len(data), begin + len(view))
            if first < last:
                view[first - begin : last - begin] = data[first - at : last - at]
        return len(view)

    def truncate(self, size: int | None = None, /) -> int:
        """Set the length of the file."""
        self._kept(lambda: super(Sink, self).truncate(size))
        return self.tell() if size is None else size

    def _kept(self, step: Callable[[], object]) -> None:
        if self.fault is None:
            try:
                step()
            except BaseException as fault:  # kept, not swallowed: `check` raises it
                self.fault = fault


class Appended(Placed):
    """A file of `length` samples that grows along time; a context, whose end without `publish` leaves nothing behind.

    Any method may raise the `FileError` of `write`. Variables without time are those of the first portion, attributes
    those of the last.
    """

    def __init__(self, path: str | os.PathLike[str], length: int, *, overwrite: bool = False) -> None:
        super().__init__(path, overwrite=overwrite)
        self._length, self._done = length, 0
        self._sink: Sink | None = None
        self._file: h5py.File | None = None
        self._arrays: dict[str, h5py.Dataset] = {}
        self._attrs: dict[str, dict[str, Any]] = {}

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        with shielded():
            if self._sink is not None:
                self._sink.fault = OSError("thrown away")  # so that no more is written
            with contextlib.suppress(Exception):  # what counts was raised already
                self._close()
            super().__exit__(kind, error, at)

    def append(self, contents: Contents) -> None:
        """Write the next portion: of the same groups, variables and types as the first."""
        with shielded(), self.named():
            first = self._file is None
            if first:
                self._open("x+", "w")
                self._arrays = lay_out(self._file, self._whole(contents))
            growing = next(one for one in contents[""].variables.values() if _ALONG in one.dims)
            begin, self._done = self._done, self._done + growing.values.shape[growing.dims.index(_ALONG)]
            for path, group in contents.items():
                self._attrs[path] = group.attrs
                for name, entry in group.variables.items():
                    grows, text = _ALONG in entry.dims, type_name(entry.values) == "str"
                    if (first or grows) and entry.values.size:
                        place = (..., slice(begin, self._done)) if grows else ...
                        self._arrays[key(path, name)][place] = entry.values.astype(object) if text else entry.values
            if self._sink is not None:
                self._sink.check()

    def finish(self) -> None:
        """Bring the file to the disk and verify it, so that `publish` only names it; `ValueError`: samples lack."""
        if self._file is None or self._done != self._length:
            raise ValueError(f"{self._done} of {self._length} samples were appended")
        with shielded(), self.named():
            for path, attrs in self._attrs.items():
                attrs.pop(ATTRIBUTE, None)
                write_attributes(self._file["/" + path], attrs, path or "root")
            self._close()
        with self.named():
            digest = self._verified()
        with shielded(), self.named():
            self._open("r+", "r+").attrs[ATTRIBUTE] = digest
            self._close(lasting=True)

    def _open(self, mode: str, file_mode: str) -> h5py.File:
        self._sink = Sink(self.temporary, mode)
        self._file = h5py.File(self._sink, file_mode, libver=LIBRARY, rdcc_nbytes=CHUNK_CACHE, track_order=True)
        return self._file

    def _close(self, *, lasting: bool = False) -> None:
        """Close the file and raise what went wrong since the last check; a `lasting` one is brought to the disk."""
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
        whole = {path: Group() for path in first}
        for path, group in first.items():
            for name, one in group.variables.items():
                if _ALONG in one.dims[:-1]:
                    raise FileError(f"{key(path, name)}: grows along {_ALONG!r}; make that its last dimension")
                shape = (*one.values.shape[:-1], self._length) if _ALONG in one.dims else one.values.shape
                values = np.broadcast_to(np.zeros((), one.values.dtype), shape)
                whole[path].variables[name] = Entry(one.dims, values, one.attrs)
        return whole

    def _verified(self) -> str:
        """The checksum of the file on the disk, every chunk compared with the checksum that it was written with."""
        try:
            return skim(self.temporary)[1]
        except FileError as error:
            fault = str(error).removeprefix(f"{shown(self.temporary, 400)}: ")
            raise FileError(f"was not written, it would not read back: {fault}") from error

    @contextlib.contextmanager
    def named(self) -> Iterator[None]:
        """Faults of the disk and of HDF5 in one line that names the file."""
        name = shown(self.path, 400)
        try:
            yield
        except FileError as error:
            fault = str(error)
            raise error if fault.startswith(f"{name}: ") else FileError(f"{name}: {fault}") from None
        except Exception as error:
            # HDF5 stumbles over what the sink kept from it: then that is what went wrong
            cause = error if self._sink is None or self._sink.fault is None else self._sink.fault
            if isinstance(cause, OSError):
                raise FileError(f"{name}: cannot be written, {reason(cause)}") from error
            raise cause from None
