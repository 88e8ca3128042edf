"""An orderly end when the system asks for one (SIGTERM), as after Ctrl-C: nothing half-written stays."""

from __future__ import annotations

import contextlib
import signal
import sys
from collections.abc import Iterator
from types import FrameType

STATUS = 128 + signal.SIGTERM
"""Exit status of a program that was asked to end, as shells count."""


@contextlib.contextmanager
def orderly() -> Iterator[None]:
    """Turn SIGTERM into an exception for as long as files are being written."""

    def leave(_number: int, _frame: FrameType | None) -> None:
        sys.exit(STATUS)

    before = signal.signal(signal.SIGTERM, leave)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
