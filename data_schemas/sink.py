"""A file for HDF5 to write to that never fails in its sight.

HDF5 1.14 does not survive a write that fails: closing the file fails too, again and again, and the process ends with a
segmentation fault. So a full disk, or a Ctrl-C that comes just then, is kept here, HDF5 is told that all went well, and
whoever writes asks after every portion.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Any


class Sink(io.FileIO):
    """A file of bytes; what goes wrong is kept in `fault`, and nothing is written after that.

    What could not be written is remembered and read back: HDF5 trusts what it reads, and crashes on what is not as it
    wrote it. Memory for that is bounded by what is written until somebody asks for the fault.
    """

    fault: BaseException | None = None

    def __init__(self, path: Any, mode: str) -> None:
        super().__init__(path, mode)
        self._lost: list[tuple[int, bytes]] = []

    def check(self) -> None:
        """Raise what went wrong, if anything did."""
        if self.fault is not None:
            raise self.fault

    def write(self, data: Any, /) -> int:
        """Write all bytes, at once or in parts."""
        view = memoryview(data).cast("B")
        at = self.tell()

        def write_all() -> None:
            left = view
            while left:
                left = left[super(Sink, self).write(left) :]

        self._kept(write_all)
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
