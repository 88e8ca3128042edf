"""A bound for the memory of this process, as inputs of anybody's making deserve one."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator
from pathlib import Path

PER_DECLARED = 12  # Bytes allowed for each byte of values that an input declares

_STATM = Path("/proc/self/statm")


@contextlib.contextmanager
def bounded(fixed: int | None) -> Iterator[Callable[[int], None]]:
    """Keep this process below `fixed` bytes; once the input says what it declares, `PER_DECLARED` times that is added.

    What the system can limit is address space, of which a process that has compiled code maps hundreds of MiB that it
    never touches. So the limit is what may be held in memory plus what is mapped and not held now: then an allocation
    that would pass the bound fails, with a `MemoryError` or the end of the process. What an input declares may be a
    bomb, a megabyte that unpacks to gigabytes: it never gives more than half of the machine's memory.

    None, or a system without such a limit, is unbounded. What is yielded is told the bytes that the input declares.
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
