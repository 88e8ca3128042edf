"""An existing dask.distributed cluster, by the address of its scheduler: an executor as those of `executors`.

Every thread of a worker keeps an isolated process of its own, so that a record that crashes, hangs or fills the memory
never ends the worker: dask would lay its death to the charge of whatever else was there.
"""

import multiprocessing
import queue
import threading
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from data_schemas.errors import UsageError
from pipeline.batch.executors import Isolated
from pipeline.batch.job import Config, Outcome, failure

if TYPE_CHECKING:
    from distributed import Client, Future

_AHEAD = 2  # records to a thread that wait on the cluster, so that none waits for us
_OWN = threading.local()
LOOK, PATIENCE = 10.0, 300.0  # s without an outcome, after which workers are looked for; s they are waited for


def clustered(
    jobs: Iterable[tuple[Path, Config]], *, address: str, methods: Sequence[str], timeout: float,
    security: Mapping[str, str] | None = None, told: Callable[[str], object] = lambda _: None,
) -> Generator[list[Outcome]]:  # fmt: skip
    """Outcomes of jobs as they come, from the workers of a cluster that sees the same files and has this package.

    Jobs are taken as the cluster gets free. `address` is the scheduler's, such as ``tcp://10.0.0.1:8786``; `methods`
    and `timeout` as `Isolated` takes them; `security` has `distributed.Security`'s files for TLS: ``tls_ca_file``,
    ``tls_client_cert``, ``tls_client_key``; `told` is given a line when the batch has to wait for workers.

    `UsageError` where dask is not installed, no scheduler answers, it is gone before the end, or has no workers for
    `PATIENCE` seconds.
    """
    try:
        from distributed import Client, Security
    except ImportError:
        raise UsageError("--scheduler wants dask.distributed; install 'isochrony[cluster]'") from None
    try:
        secured = Security(**security, require_encryption=True) if security else None
        client = Client(address, timeout=10, set_as_default=False, security=secured)
    except (OSError, ValueError, TypeError, TimeoutError) as error:  # TypeError: TLS without certificates
        reason = " ".join(str(error).split()) or type(error).__name__
        raise UsageError(
            f"--scheduler {address}: no scheduler answers ({reason}); start one, or leave it out"
        ) from None
    with client:
        threads = _threads(client, address, told)
        left = iter(jobs)
        keys: dict[object, Config] = {}
        done: queue.SimpleQueue[Future] = queue.SimpleQueue()

        def feed(count: int) -> None:
            for _, (path, config) in zip(range(count), left, strict=False):
                future = client.submit(_process_isolated, path, config, tuple(methods), timeout, pure=False, retries=0)
                keys[future.key] = config
                future.add_done_callback(done.put)

        feed(_AHEAD * threads)
        while keys:
            try:
                batch = [done.get(timeout=LOOK)]
            except queue.Empty:
                _threads(client, address, told)
                continue
            batch += [done.get_nowait() for _ in range(done.qsize())]
            if any(future.cancelled() for future in batch):  # as dask does with all of them where the scheduler is gone
                raise UsageError(f"--scheduler {address}: the scheduler is gone; start one, and go on with --resume")
            outcomes = [_outcome(future, keys.pop(future.key)) for future in batch]
            for future in batch:
                future.release()
            feed(len(outcomes))
            yield outcomes


def _threads(client: "Client", address: str, told: Callable[[str], object]) -> int:
    """Threads of the workers, which are waited for where there are none; `UsageError` as `clustered`."""
    start = f"start some with 'dask worker {address}'"
    try:
        if not client.nthreads():
            told(f"--scheduler {address}: has no workers; waiting {PATIENCE:.0f} s for them, {start}")
            client.wait_for_workers(1, timeout=PATIENCE)
        return sum(client.nthreads().values())
    except TimeoutError:
        fault = f"has no workers for {PATIENCE:.0f} s; {start}"
    except OSError:
        fault = "the scheduler is gone; start one"
    raise UsageError(f"--scheduler {address}: {fault}, and go on with --resume")


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


def _outcome(future: "Future", config: Config) -> Outcome:
    try:
        found: Outcome = future.result()
    except Exception as error:  # the worker was lost, or cannot import us: this record's outcome, the batch goes on
        told = f"{config.key}: the cluster gave it up: {type(error).__name__}: {error}; see its workers' logs"
        return failure(config.key, "WorkerLost", told)
    return found
