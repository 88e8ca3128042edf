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
    """Results of a function of some module for each job, in the order of the jobs.

    Jobs are taken as they are needed: no more than two to a worker are ahead of the results. With one worker all is
    done in this process. `WorkerError` if a worker dies; what the function raises comes at its job's turn.
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
        raise WorkerError(
            "a worker process died before it was done; run the same again, with fewer workers if memory is short (in a "
            "script, start it under: if __name__ == '__main__')"
        ) from None
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
