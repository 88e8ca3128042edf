"""An existing dask.distributed cluster, by the address of its scheduler.

Every thread of a dask worker keeps an isolated process of its own, so that a record that crashes, hangs or fills the
memory ends that process and never the worker: dask would lay its death to the charge of whatever else was there, and
give up records that did nothing.
"""

from __future__ import annotations

import multiprocessing
import queue
import threading
from collections.abc import Generator, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from data_schemas.errors import UsageError
from pipeline.batch.config import Config
from pipeline.batch.executors.isolated import Isolated
from pipeline.batch.outcome import Outcome, failure

if TYPE_CHECKING:
    from distributed import Future

_AHEAD = 2  # records to a thread that wait on the cluster, so that none waits for us
_OWN = threading.local()


def clustered(
    jobs: Iterable[tuple[Path, Config]], *, address: str, methods: Sequence[str], timeout: float
) -> Generator[list[Outcome]]:
    """Outcomes of jobs as they come, from the workers of a cluster that sees the same files and has this package.

    `UsageError` where dask is not installed, no scheduler with workers answers, or it is gone before the end.

    Parameters
    ----------
    jobs : iterable of (Path, Config)
        Taken as the cluster gets free.
    address : str
        Of the scheduler, such as ``tcp://10.0.0.1:8786``.
    methods, timeout
        See `Isolated`.
    """
    try:
        from distributed import Client
    except ImportError:
        raise UsageError("--scheduler wants dask.distributed; install 'isochrony[cluster]'") from None
    try:
        client = Client(address, timeout=10, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise UsageError(
            f"--scheduler {address}: no scheduler answers ({reason}); start one, or leave it out"
        ) from None
    with client:
        threads = sum(client.nthreads().values())
        if not threads:
            raise UsageError(f"--scheduler {address}: has no workers; start some with 'dask worker {address}'")
        left = iter(jobs)
        keys: dict[object, Config] = {}
        done: queue.SimpleQueue[Future] = queue.SimpleQueue()

        def feed(count: int) -> None:
            for _ in range(count):
                job = next(left, None)
                if job is None:
                    return
                future = client.submit(_process_isolated, *job, tuple(methods), timeout, pure=False, retries=0)
                keys[future.key] = job[1]
                future.add_done_callback(done.put)

        feed(_AHEAD * threads)
        while keys:
            batch = [done.get()]
            batch += [done.get_nowait() for _ in range(done.qsize())]
            if any(future.cancelled() for future in batch):  # as dask does with all of them where the scheduler is gone
                raise UsageError(f"--scheduler {address}: the scheduler is gone; start one, and go on with --resume")
            outcomes = [_outcome(future, keys.pop(future.key)) for future in batch]
            for future in batch:
                future.release()
            feed(len(outcomes))
            yield outcomes


def _process_isolated(path: Path, config: Config, methods: tuple[str, ...], timeout: float) -> Outcome:
    """One record, by the isolated process of this thread of a worker."""
    child: Isolated | None = getattr(_OWN, "child", None)
    if child is None or child.form != (methods, timeout):
        if child is not None:
            child.stop()
        # the processes that dask starts are not meant to start others; ours end when they do
        multiprocessing.current_process().daemon = False
        child = _OWN.child = Isolated(methods, timeout)
    return child.run(path, config)


def _outcome(future: Future, config: Config) -> Outcome:
    try:
        found: Outcome = future.result()
    except Exception as error:  # the worker was lost, or cannot import us: this record's outcome, the batch goes on
        told = f"{config.key}: the cluster gave it up: {type(error).__name__}: {error}; see its workers' logs"
        return failure(config.key, "WorkerLost", told)
    return found
