"""Pieces of a film worked on by several threads; what comes of them comes in the film's order."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


def in_order(work: Callable[[Item], Result], items: Iterable[Item], jobs: int = 1) -> Iterator[Result]:
    """Results of `work` on each of the items, in their order.

    Parameters
    ----------
    work : callable
        Changes nothing that its other calls need; with several jobs they run in threads.
    items : iterable
        Asked for in the caller's thread, at most `jobs` of them ahead of the results: none holds the film.
    jobs : int
        Threads; 1 for none but the caller's.

    Examples
    --------
    >>> list(in_order(abs, [-3, 1, -2], jobs=2))
    [3, 1, 2]
    """
    if jobs == 1:
        yield from map(work, items)
        return
    from concurrent.futures import ThreadPoolExecutor

    coming: deque[Future[Result]] = deque()
    with ThreadPoolExecutor(jobs) as pool:
        try:
            for item in items:
                coming.append(pool.submit(work, item))
                if len(coming) > jobs:
                    yield coming.popleft().result()
            while coming:
                yield coming.popleft().result()
        finally:
            for begun in coming:
                begun.cancel()
