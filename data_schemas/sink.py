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
    """A file of bytes; what goes wrong is kept in `fault`, and nothing is written after that."""

    fault: BaseException | None = None

    def check(self) -> None:
        """Raise what went wrong, if anything did."""
        if self.fault is not None:
            raise self.fault

    def write(self, data: Any, /) -> int:
        """Write all bytes, at once or in parts."""
        view = memoryview(data).cast("B")

        def write_all() -> None:
            left = view
            while left:
                left = left[super(Sink, self).write(left) :]

        self._kept(write_all)
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
