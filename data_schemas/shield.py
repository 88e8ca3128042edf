"""Keeps Ctrl-C and a request to end waiting until a delicate step is done."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType

_WAIT = (signal.SIGINT, signal.SIGTERM)


@contextlib.contextmanager
def shielded() -> Iterator[None]:
    """Let signals wait until the end of the block, then act as they would have.

    An exception that a signal raises in the middle of HDF5 or of its wrappers may be lost, or leave a file half
    closed. Other threads than the main one get no signals, and nothing is changed there.

    Examples
    --------
    >>> try:
    ...     with shielded():
    ...         signal.raise_signal(signal.SIGINT)
    ...         print("done")
    ... except KeyboardInterrupt:
    ...     print("interrupted")
    done
    interrupted
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    arrived: list[tuple[int, FrameType | None]] = []
    before = {number: signal.getsignal(number) for number in _WAIT}
    # None: set by other means than Python's, which cannot set it back; ignored ones stay ignored
    waiting = [number for number in _WAIT if before[number] not in (None, signal.SIG_IGN)]
    try:
        for number in waiting:
            signal.signal(number, lambda *signalled: arrived.append(signalled))
        yield
    finally:
        for number in waiting:
            signal.signal(number, before[number])
        for signalled, frame in arrived:
            handler = before[signal.Signals(signalled)]
            if callable(handler):
                handler(signalled, frame)
            else:
                signal.raise_signal(signalled)
