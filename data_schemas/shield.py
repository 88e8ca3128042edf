"""Guards of this process: Ctrl-C and a request to end wait until a delicate step is done; memory has a bound."""

import contextlib
import os
import signal
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

PER_DECLARED = 12  # Bytes allowed for each byte of values that an input declares
_STATM = Path("/proc/self/statm")
_WAIT = (signal.SIGINT, signal.SIGTERM)


@contextlib.contextmanager
def shielded() -> Iterator[None]:
    """Let signals wait until the end of the block: raised within HDF5 they may be lost, or leave a file half closed.

    Other threads than the main one get no signals, and nothing is changed there.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    arrived: list[int] = []  # without their frames: h5py's would keep what HDF5 then frees after Python has ended
    before = {number: signal.getsignal(number) for number in _WAIT}
    # None: set by other means than Python's, which cannot set it back; ignored ones stay ignored
    waiting = [number for number in _WAIT if before[number] not in (None, signal.SIG_IGN)]
    try:
        for number in waiting:
            signal.signal(number, lambda signalled, _frame: arrived.append(signalled))
        yield
    finally:
        for number in waiting:
            signal.signal(number, before[number])
        for signalled in arrived:
            handler = before[signal.Signals(signalled)]
            if callable(handler):
                handler(signalled, None)
            else:
                signal.raise_signal(signalled)


@contextlib.contextmanager
def bounded(fixed: int | None) -> Iterator[Callable[[int], None]]:
    """Keep this process below `fixed` bytes; once the input says what it declares, `PER_DECLARED` times that is added.

    What the system can limit is address space, of which compiled code maps hundreds of MiB that it never touches: the
    limit is what may be held in memory plus what is mapped and not held now. Beyond it an allocation fails, with a
    `MemoryError` or the end of the process. An input may declare a bomb: it never gives more than half of the machine's
    memory. None, or a system without such a limit, is unbounded. What is yielded is told the bytes that are declared.
    """
    if fixed is None or not _STATM.exists():
        yield lambda _declared: None
        return
    import resource

    before = resource.getrlimit(resource.RLIMIT_AS)
    mapped, held = (int(word) * os.sysconf("SC_PAGE_SIZE") for word in _STATM.read_text().split()[:2])

    half = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 2

    def allow(declared: int) -> None:
        limit = mapped - held + max(fixed, min(fixed + PER_DECLARED * declared, half))
        hard = before[1]
        resource.setrlimit(resource.RLIMIT_AS, (limit if hard == resource.RLIM_INFINITY else min(limit, hard), hard))

    try:
        allow(0)
        yield allow
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)
