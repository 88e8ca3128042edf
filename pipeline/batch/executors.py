"""Who does the work on this machine: isolated processes, the default; or this one, for files that are trusted.

An executor is a function of jobs that yields lists of outcomes as they come; closing it ends the work at once. An
isolated process is given one record after the other through a pipe. It is ended when its record's time is over, and
another is started: its death, or too long a silence, is that record's outcome. Each has a pipe to itself: a process
that is killed in the middle of a message can then spoil no other's. Before its first record it is confined.
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
import time
import weakref
from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import replace
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from data_schemas.errors import IsochronyError
from pipeline.batch.confinement import confine
from pipeline.batch.job import Config, Outcome, failure, process_record
from synth.kernels.cache import cache_folder

if TYPE_CHECKING:
    from xarray import DataTree

ATTEMPTS = 3  # How often a record is begun whose process vanished before it began, or fell silent
LOOK = 5.0  # s between two looks at the clock: a system waits for days at most, a record may be given years
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
        self.pipe: Connection
        self.deadline = 0.0  # by the monotonic clock
        self._process: SpawnProcess | None = None
        self._end: Callable[[], int | None] = lambda: None
        self._job: tuple[Path, Config]
        self._attempts, self._has_it = 0, False

    def __exit__(self, *_: object) -> None:
        self.stop()

    def begin(self, path: Path, config: Config) -> None:
        """Give it a record; what comes of it is for `outcome` to say."""
        if self._process is not None and self._job[1].folder != config.folder:
            self.stop()  # it may write to one batch's folder only
        self._job, self._attempts, self._has_it = (path, config), 0, False
        begin = self._start if self._process is None else self._give
        begin()

    def outcome(self, *, ready: bool) -> Outcome | None:
        """What became of the record; None while it goes on. `ready`: its pipe has a message, or is closed."""
        if ready:
            try:
                outcome: Outcome | None = self.pipe.recv()
            except Exception as error:  # it died, perhaps in the middle of a message, or sent none that can be read
                self._has_it &= not isinstance(error, ConnectionResetError)  # which says that it took no record
            else:
                if outcome is None:
                    self._give()
                return outcome
        elif time.monotonic() < self.deadline:
            return None
        (path, config), code = self._job, self.stop()
        if self._has_it and not ready:
            told = f"{path}: took longer than {self.form[1]:g} s and was ended; allow more with --timeout"
            return replace(failure(config.key, "TimedOut", told), seconds=round(self.form[1], 6))
        if self._has_it:
            told = f"{path}: its process {_death(code)}; look at this file, or allow more with --memory"
            return failure(config.key, "Crashed", told)
        if self._attempts < ATTEMPTS:
            self._start()
            return None
        fault = "vanished before it began" if ready else "fell silent"
        told = f"{path}: {ATTEMPTS} processes in turn {fault}; look at the machine's memory, then use --retry-failed"
        return failure(config.key, "WorkerLost", told)

    def run(self, path: Path, config: Config) -> Outcome:
        """Begin a record and wait for what becomes of it."""
        return next(_done([self], [(path, config)]))[0]

    def stop(self) -> int | None:
        """End the process at once, whatever it does; the status with which it ended."""
        self._process = None
        return self._end()

    def _start(self) -> None:
        self._attempts += 1
        spawn, scratch = multiprocessing.get_context("spawn"), tempfile.mkdtemp(prefix="isochrony-")
        self.pipe, theirs = spawn.Pipe()
        given = (theirs, self.form[0], os.getpid(), self._job[1].folder, scratch)
        self._process = spawn.Process(target=_work, args=given, daemon=True)
        self._end = weakref.finalize(self, _end, self._process, self.pipe, scratch)
        with theirs, contextlib.suppress(OSError):  # where none can be had the pipe is closed, as if it had died
            self._process.start()
        self.deadline = time.monotonic() + _START

    def _give(self) -> None:
        with contextlib.suppress(ConnectionError):  # it has just died, as its pipe will tell
            self.pipe.send(self._job)
            self._has_it = True
        self.deadline = time.monotonic() + self.form[1]


def _end(process: SpawnProcess, pipe: Connection, scratch: str) -> int | None:
    """End a process, and clear away after it; one that does not end is the system's business, and dies with this."""
    if process.pid is not None:
        process.kill()
        process.join(PATIENCE)
    pipe.close()
    shutil.rmtree(scratch, ignore_errors=True)
    return process.exitcode


def _work(pipe: Connection, methods: Sequence[str], parent: int, folder: Path, scratch: str) -> None:
    """One record after the other, in a process that is warmed up, then confined: they may be of anybody's making."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which ends this process
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    warm(methods, parent)
    tempfile.tempdir = scratch
    confine([folder, Path(scratch), cache_folder()])
    with contextlib.suppress(EOFError, ConnectionError):  # the parent is gone
        pipe.send(None)
        while True:
            pipe.send(_process_alone(*pipe.recv()))


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
    with contextlib.ExitStack() as ends:
        yield from _done([ends.enter_context(Isolated(methods, timeout)) for _ in range(workers)], jobs)


def _done(children: Sequence[Isolated], jobs: Iterable[tuple[Path, Config]]) -> Generator[list[Outcome]]:
    """Outcomes of jobs, each of which goes to the first process that is free."""
    waiting, busy, outcomes = iter(jobs), list[Isolated](), dict[Isolated, Outcome]()
    while True:
        busy = [child for child in busy if child not in outcomes]
        for child, job in zip([each for each in children if each not in busy], waiting, strict=False):
            child.begin(*job)
            busy.append(child)
        if outcomes:
            yield list(outcomes.values())
        if not busy:
            return
        nearest = min(child.deadline for child in busy) - time.monotonic()
        ready = wait([child.pipe for child in busy], min(nearest, LOOK))
        looked = ((child, child.outcome(ready=child.pipe in ready)) for child in busy)
        outcomes = {child: outcome for child, outcome in looked if outcome is not None}


def serial(jobs: Iterable[tuple[Path, Config]]) -> Generator[list[Outcome]]:
    """Outcomes of jobs in their order, one at a time."""
    for path, config in jobs:
        yield [process_record(path, config)]
