"""Who works on this machine: several isolated processes, the default; or this one, for files that are trusted."""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Generator, Iterable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from pathlib import Path

from pipeline.batch.config import Config, Outcome
from pipeline.batch.executors.isolated import LOOK, Isolated
from pipeline.batch.record import process_record


def pooled(
    jobs: Iterable[tuple[Path, Config]], *, workers: int, methods: Sequence[str], timeout: float
) -> Generator[list[Outcome]]:
    """Outcomes of jobs as they come, from processes that crash, hang and run out of memory alone.

    What is yielded together came together; the processes have their next records already.

    Parameters
    ----------
    jobs : iterable of (Path, Config)
        Taken one by one as processes become free.
    workers : int
        Processes.
    methods, timeout
        See `Isolated`.
    """
    left = iter(jobs)
    busy: dict[Future[Outcome], Isolated] = {}
    with contextlib.ExitStack() as ends:
        idle = deque(ends.enter_context(Isolated(methods, timeout)) for _ in range(workers))

        def feed() -> None:
            while idle and (job := next(left, None)) is not None:
                child = idle.popleft()
                busy[child.begin(*job)] = child

        feed()
        while busy:
            done = wait(busy, LOOK, FIRST_COMPLETED).done
            outcomes = []
            for future in [each for each, child in busy.items() if each in done or child.silent()]:
                child = busy.pop(future)
                found = child.outcome(future)
                if isinstance(found, Outcome):
                    outcomes.append(found)
                    idle.append(child)
                else:
                    busy[found] = child
            feed()
            if outcomes:
                yield outcomes


def serial(jobs: Iterable[tuple[Path, Config]]) -> Generator[list[Outcome]]:
    """Outcomes of jobs in their order, one at a time."""
    for path, config in jobs:
        yield [process_record(path, config)]
