"""Who does the work on this machine: isolated processes, the default; or this one, for files that are trusted.

An executor is a function of jobs that yields lists of outcomes as they come; closing it ends the work at once. Pebble
starts an isolated process, ends it when its record's time is over, and starts another: its death, or too long a
silence, is that record's outcome. Each has a pool to itself: a process that is killed in the middle of a message can
then spoil no other's. Before its first record it is confined.
"""

import contextlib
import ctypes
import gc
import multiprocessing
import os
import shutil
import signal
import sys
import tempfile
import threading
import time
import weakref
from collections import deque
from collections.abc import Callable, Generator, Iterable, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from pebble import ProcessExpired, ProcessPool

from data_schemas.errors import IsochronyError
from pipeline.batch.confinement import confine
from pipeline.batch.job import Config, Outcome, failure, process_record
from synth.kernels.cache import cache_folder

if TYPE_CHECKING:
    from xarray import DataTree

ATTEMPTS = 3  # How often a record is begun whose process vanished before it began, or fell silent
LOOK = 5.0  # s after which a silent process is looked for
PATIENCE = 20.0  # s that a process may take to end when it is told to; it dies with this one anyway
_START = 900.0  # s a process may take to start, with all kernels compiled anew, on a busy machine
_PR_SET_PDEATHSIG = 1
_M_TRIM_THRESHOLD, _KEPT = -1, 16 << 20  # bytes that malloc may keep between records,
_M_MMAP_THRESHOLD, _MAPPED = -3, 8 << 20  # and blocks it asks of the system one by one


class Isolated(contextlib.AbstractContextManager["Isolated"]):
    """A process that does one record at a time, with these methods warmed up; a context manager.

    A record may take `timeout` seconds, the start of the process not counted. `form` is what it was made with.
    """

    def __init__(self, methods: Sequence[str], timeout: float) -> None:
        self.form = (tuple(methods), timeout)
        self._pool: ProcessPool | None = None
        self._job: tuple[Path, Config] | None = None
        self._clean: Callable[[], object] = lambda: None
        self._begun, self._attempt = 0.0, 0

    def __exit__(self, *_: object) -> None:
        self.stop()

    def begin(self, path: Path, config: Config) -> Future[Outcome]:
        """Give it a record; what comes of it is for `outcome` to say."""
        if self._job is not None and self._job[1].folder != config.folder:
            self.stop()  # it may write to one batch's folder only
        self._job, self._attempt = (path, config), 0
        return self._again()

    def silent(self) -> bool:
        """Whether it has said nothing for longer than its record and its start may take together."""
        return time.monotonic() - self._begun > self.form[1] + _START

    def outcome(self, future: Future[Outcome]) -> Outcome | Future[Outcome]:
        """What became of the record, once the future is done or the process is silent; or its next attempt."""
        assert self._job is not None
        path, config = self._job
        fault = "fell silent"
        if future.done():
            try:
                return future.result()
            except TimeoutError:
                told = f"{path}: took longer than {self.form[1]:g} s and was ended; allow more with --timeout"
                return replace(failure(config.key, "TimedOut", told), seconds=round(self.form[1], 6))
            except ProcessExpired as error:
                told = f"{path}: its process {_death(error.exitcode)}; look at this file, or allow more with --memory"
                return failure(config.key, "Crashed", told)
            except (BrokenProcessPool, CancelledError):
                fault = "vanished before it began"
        self.stop()
        if self._attempt < ATTEMPTS:
            return self._again()
        told = f"{path}: {ATTEMPTS} processes in turn {fault}; look at the machine's memory, then use --retry-failed"
        return failure(config.key, "WorkerLost", told)

    def run(self, path: Path, config: Config) -> Outcome:
        """Begin a record and wait for what becomes of it."""
        found: Outcome | Future[Outcome] = self.begin(path, config)
        while not isinstance(found, Outcome):
            if wait([found], LOOK, FIRST_COMPLETED).done or self.silent():
                found = self.outcome(found)
        return found

    def stop(self) -> None:
        """End the process at once, whatever it does."""
        pool, self._pool = self._pool, None
        if pool is not None:
            pool.stop()
            # an interrupt may have left a future locked, for which pebble would wait for ever
            ending = threading.Thread(target=_joined, args=(pool,), daemon=True)
            ending.start()
            ending.join(PATIENCE)
        self._clean()

    def _again(self) -> Future[Outcome]:
        assert self._job is not None
        self._attempt += 1
        self._begun = time.monotonic()
        if self._pool is None:
            scratch = tempfile.mkdtemp(prefix="isochrony-")
            self._clean = weakref.finalize(self, shutil.rmtree, scratch, ignore_errors=True)
            given = (self.form[0], os.getpid(), self._job[1].folder, scratch)
            spawn = multiprocessing.get_context("spawn")
            self._pool = ProcessPool(max_workers=1, initializer=_ready, initargs=given, context=spawn)
        try:
            begun: Future[Outcome] = self._pool.schedule(_process_alone, args=self._job, timeout=self.form[1])
        except RuntimeError as error:  # the pool broke since its last record
            begun = Future()
            begun.set_exception(BrokenProcessPool(str(error)))
        return begun


def _joined(pool: ProcessPool) -> None:
    """Wait for a pool that was stopped to end its process."""
    with contextlib.suppress(RuntimeError):  # pebble: it would not die; the system's business then
        pool.join()


def _ready(methods: Sequence[str], parent: int, folder: Path, scratch: str) -> None:
    """Ready the process for records (see `warm`), then confine it, as it will read files of anybody's making."""
    warm(methods, parent)
    tempfile.tempdir = scratch
    confine([folder, Path(scratch), cache_folder()])


def warm(methods: Sequence[str], parent: int | None = None) -> None:
    """Import what processing needs and run every method once; end with the process `parent`, if one is given."""
    if parent is not None:
        _die_with(parent)
    _keep_memory()
    import data_schemas.writing  # noqa: F401  # with what reads
    from pipeline.processing import process

    record = small_record()
    for method in methods:
        with contextlib.suppress(IsochronyError):  # a method may decline this record: its kernels are loaded anyway
            process(record, method=method)
    gc.collect()
    gc.freeze()


def small_record(count: int = 2250) -> "DataTree":
    """Two free pendulums, `count` readings at 25 Hz; a minute and a half is the least that every method takes."""
    from xarray import Dataset

    from data_schemas import adopted

    time = np.arange(count) * 0.04
    period = np.array([1.00966, 1.009760966])
    swing = 0.01 * np.cos(2.0 * np.pi / period[:, None] * time + np.array([[0.4], [2.2]]))
    swing[1] = swing[0] - swing[1]
    values = {"elongation": (("trace", "time"), swing), "period": ("pendulum", period), "reference_gravity": 9.81}
    said = {"record_id": "warm", "restoring": "sine"}  # not left open, so few swings do not tell it
    return adopted(Dataset(values, {"trace": ["1", "1-2"], "pendulum": ["1", "2"], "time": time}, said))


def _die_with(parent: int) -> None:
    """End with the process that started this one; where the system cannot, the closed pipe ends it after its record."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # it died before we asked
            os._exit(1)


def _keep_memory() -> None:
    """Let GNU's C library keep memory between records: getting it again, as under dask, takes a sixth of the time."""
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if mallopt is not None:
        mallopt(_M_TRIM_THRESHOLD, _KEPT)
        mallopt(_M_MMAP_THRESHOLD, _MAPPED)


def _process_alone(path: Path, config: Config) -> Outcome:
    """`process_record`, and what it left in memory given back."""
    outcome = process_record(path, config)
    gc.collect()
    return outcome


def _death(code: int | None) -> str:
    """How a process ended, by its exit code.

    >>> _death(-9), _death(3)
    ('was killed by SIGKILL', 'ended with status 3')
    """
    if code is None or code >= 0:
        return f"ended with status {code}"
    known = {number.value: number.name for number in signal.Signals}
    return f"was killed by {known.get(-code, f'signal {-code}')}"


def pooled(
    jobs: Iterable[tuple[Path, Config]], *, workers: int, methods: Sequence[str], timeout: float
) -> Generator[list[Outcome]]:
    """Outcomes of jobs as they come, from `workers` processes that crash, hang and run out of memory alone.

    What is yielded together came together; jobs are taken one by one as processes become free, and all processes have
    their next ones already. `methods` and `timeout` as `Isolated` takes them.
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
