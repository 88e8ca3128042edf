"""One function on many jobs by several processes, results in order.

The processes are started afresh, not forked: a fork copies the threads' locks but not the threads.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import TypeVar

from data_schemas.errors import IsochronyError

Job = TypeVar("Job")
Result = TypeVar("Result")


class WorkerError(IsochronyError):
    """A worker process died, of a lack of memory or by a signal."""

    exit_status = 70


def in_order(function: Callable[[Job], Result], jobs: Iterable[Job], workers: int) -> Iterator[Result]:
    """Results of a function for each job, in the order of the jobs.

    `WorkerError` if a worker dies. `Exception`: what the function raises, at its job's turn.

    Parameters
    ----------
    function
        Of a module, so that another process finds it.
    jobs
        Taken as they are needed: no more than two to a worker are ahead of the results.
    workers
        Processes; with 1 all is done in this one.

    Yields
    ------
    result
    """
    if workers == 1:
        yield from map(function, jobs)
        return
    ahead: deque[Future[Result]] = deque()
    pool = ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), initializer=_begin)
    try:
        for job in jobs:
            ahead.append(pool.submit(_run, function, job))
            if len(ahead) == 2 * workers:
                yield ahead.popleft().result()
        while ahead:
            yield ahead.popleft().result()
    except BrokenProcessPool:
        told = (
            "a worker process died before it was done; run the same again, with fewer workers if memory is short (in a "
            "script, start it under: if __name__ == '__main__')"
        )
        raise WorkerError(told) from None
    finally:
        for process in [*(pool._processes or {}).values()]:  # those that still work on what nobody waits for
            process.terminate()
        pool.shutdown(cancel_futures=True)


def _run(function: Callable[[Job], Result], job: Job) -> Result:
    """One job; a worker that is ended leaves: the executor would take that for an answer, and give it the next."""
    try:
        return function(job)
    except SystemExit:
        os._exit(0)


def _begin() -> None:
    """Of a worker: Ctrl-C reaches all, but who started it ends it, and in order: nothing half-written stays."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())
