"""One process of its own that does one record at a time; its death, or too long a silence, is that record's outcome.

Pebble starts the process, ends it when the record's time is over, and starts another. Each has a pool to itself: a
process that is killed in the middle of a message can then spoil no other's. Before its first record it is confined.
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
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError, Future, wait
from concurrent.futures.process import BrokenProcessPool
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

    A record may take `timeout` seconds, the start of the process not counted.
    """

    def __init__(self, methods: Sequence[str], timeout: float) -> None:
        self.form = (tuple(methods), timeout)
        """What it was made with."""
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
        if not future.done():
            return self._next(path, config, "fell silent")
        try:
            return future.result()
        except TimeoutError:
            told = f"{path}: took longer than {self.form[1]:g} s and was ended; allow more with --timeout"
            return failure(config.key, "TimedOut", told).took(self.form[1])
        except ProcessExpired as error:
            told = f"{path}: its process {_death(error.exitcode)}; look at this file, or allow more with --memory"
            return failure(config.key, "Crashed", told)
        except (BrokenProcessPool, CancelledError):
            return self._next(path, config, "vanished before it began")

    def run(self, path: Path, config: Config) -> Outcome:
        """Begin a record and wait for what becomes of it."""
        found: Outcome | Future[Outcome] = self.begin(path, config)
        while not isinstance(found, Outcome):
            if wait([found], LOOK).done or self.silent():
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

    def _next(self, path: Path, config: Config, what: str) -> Outcome | Future[Outcome]:
        self.stop()
        if self._attempt < ATTEMPTS:
            return self._again()
        told = f"{path}: {ATTEMPTS} processes in turn {what}; look at the machine's memory, then use --retry-failed"
        return failure(config.key, "WorkerLost", told)

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
            return begun
        except RuntimeError as error:  # the pool broke since its last record
            broken: Future[Outcome] = Future()
            broken.set_exception(BrokenProcessPool(str(error)))
            return broken


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
    if code is not None and code < 0:
        try:
            return f"was killed by {signal.Signals(-code).name}"
        except ValueError:
            return f"was killed by signal {-code}"
    return f"ended with status {code}"
