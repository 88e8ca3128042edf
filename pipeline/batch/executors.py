"""Who does the work on this machine: isolated processes, the default; or this one, for files that are trusted.

An executor is a function of jobs that yields lists of outcomes as they come; closing it ends the work at once. Pebble
starts an isolated process, ends it when its record's time is over, and starts another: its death, or too long a
silence, is that record's outcome. Each has a pool to itself: a process that is killed in the middle of a message can
then spoil no other's. Before its first record it is confined.
"""

from __future__ import annotations

import contextlib
import gc
import multiprocessing
import os
import shutil
import signal
import tempfile
import time
import weakref
from collections import deque
from collections.abc import Callable, Generator, Iterable, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from pathlib import Path

from pebble import ProcessExpired, ProcessPool

from pipeline.batch.config import Config, Outcome, failure
from pipeline.batch.confinement import confine
from pipeline.batch.record import process_record
from pipeline.batch.warming import warm
from synth.kernels.cache import cache_folder

ATTEMPTS = 3  # How often a record is begun whose process vanished before it began, or fell silent
LOOK = 5.0  # s after which a silent process is looked for
_START = 900.0  # s a process may take to start, with all kernels compiled anew, on a busy machine


class Isolated:
    """A process that does one record at a time, with these methods warmed up; a context manager.

    A record may take `timeout` seconds, the start of the process not counted. `form` is what it was made with.
    """

    def __init__(self, methods: Sequence[str], timeout: float) -> None:
        self.form = (tuple(methods), timeout)
        self._pool: ProcessPool | None = None
        self._job: tuple[Path, Config] | None = None
        self._clean: Callable[[], object] = lambda: None
        self._begun, self._attempt = 0.0, 0

    def __enter__(self) -> Isolated:
        return self

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
            with contextlib.suppress(RuntimeError):  # pebble: it would not die; the system's business then
                pool.join()
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


def _ready(methods: Sequence[str], parent: int, folder: Path, scratch: str) -> None:
    """Ready the process for records (see `warm`), then confine it, as it will read files of anybody's making."""
    warm(methods, parent)
    tempfile.tempdir = scratch
    confine([folder, Path(scratch), cache_folder()])


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
