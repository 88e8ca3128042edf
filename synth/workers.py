"""One function on many jobs by several processes, results in order.

The processes are started afresh, not forked: a fork copies the threads' locks but not the threads. Each has a pipe of
its own, so that one that dies is noticed at once.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, TypeVar

from data_schemas.errors import IsochronyError

Job = TypeVar("Job")
Result = TypeVar("Result")

_PATIENCE, _ASKED = 2.0, 5  # s that a worker has to tidy up, and how often it is asked to


class WorkerError(IsochronyError):
    """A worker process died, of a lack of memory or by a signal."""

    exit_status = 70


def in_order(function: Callable[[Job], Result], jobs: Iterable[Job], workers: int) -> Iterator[Result]:
    """Results of a function for each job, in the order of the jobs.

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

    Raises
    ------
    WorkerError
        If a worker dies.
    Exception
        What the function raises, at its job's turn.
    """
    if workers == 1:
        yield from map(function, jobs)
        return
    context = multiprocessing.get_context("spawn")
    with contextlib.ExitStack() as ends:
        idle: deque[Connection] = deque()
        for _ in range(workers):
            here, there = context.Pipe()
            process = context.Process(target=_serve, args=(function, there), daemon=True)
            process.start()
            there.close()
            ends.callback(_end, process, here)
            idle.append(here)
        yield from _results(enumerate(jobs), idle, 2 * workers)


def _results(jobs: Iterator[tuple[int, Any]], idle: deque[Connection], most: int) -> Iterator[Any]:
    busy: dict[Connection, int] = {}
    found: dict[int, tuple[bool, Any]] = {}
    turn = begun = 0
    while True:
        while idle and begun - turn < most and (job := next(jobs, None)) is not None:
            begun = job[0] + 1
            busy[idle[0]] = job[0]
            with contextlib.suppress(OSError):  # it died: told below, when nothing comes back
                idle[0].send(job[1])
            idle.popleft()
        if turn in found:
            good, result = found.pop(turn)
            if not good:
                raise result
            yield result
            turn += 1
        elif busy:
            ready = set(wait(list(busy)))
            for worker in [each for each in busy if each in ready]:
                found[busy.pop(worker)] = _received(worker)
                idle.append(worker)
        else:
            return


def _received(worker: Connection) -> tuple[bool, Any]:
    try:
        result: tuple[bool, Any] = worker.recv()
    except (EOFError, OSError):
        told = (
            "a worker process died before it was done; run the same again, with fewer workers if memory is short (in a "
            "script, start it under: if __name__ == '__main__')"
        )
        return False, WorkerError(told)
    return result


def _serve(function: Callable[[Any], Any], jobs: Connection) -> None:
    """Life of a worker: until nobody is at the other end of the pipe."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches all: the one who started us ends us
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())  # as an exception, so that nothing half-written stays
    with contextlib.suppress(EOFError, OSError):
        while True:
            job = jobs.recv()
            try:
                result = True, function(job)
            except Exception as error:
                result = False, error
            jobs.send(result)


def _end(process: BaseProcess, pipe: Connection) -> None:
    pipe.close()
    for _ in range(_ASKED):
        process.terminate()  # asked again, for an exception that meets a destructor is lost
        process.join(_PATIENCE)
        if not process.is_alive():
            break
    else:
        process.kill()
        process.join()
    process.close()
