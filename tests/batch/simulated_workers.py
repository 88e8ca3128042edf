"""What the executors use of multiprocessing, with processes that do their records when chance says."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from typing import Any

from simulated_system import MET, Killed, Process, System

from pipeline.batch import executors

FATES = ("dies", "hangs", "vanishes", "silent")
_MOST = 24  # calls of the system; a record makes about 20


class Crew:
    """All processes of one run; `share` of their records meet one of `FATES`."""

    def __init__(self, system: System, share: float) -> None:
        self.system, self.share = system, share
        self.workers: list[Worker] = []

    def get_context(self, how: str) -> Crew:
        assert how == "spawn"
        return self

    def Pipe(self) -> tuple[Worker, contextlib.AbstractContextManager[Worker]]:
        worker = Worker(self)
        return worker, contextlib.nullcontext(worker)

    def Process(self, *, args: tuple[Any, ...], **_: object) -> Worker:
        worker: Worker = args[0].enter_result
        return worker

    def fate(self) -> str:
        chance = self.system.chance
        return chance.choice(FATES) if chance.random() < self.share else "well"

    def wait(self, workers: Iterable[Worker], timeout: float) -> list[Worker]:
        """In place of `multiprocessing.connection.wait`: some of those waited for do something, or time passes."""
        system, able = self.system, [worker for worker in workers if not worker.mute]
        if not able:
            system.clock += 2000.0
        elif system.chance.random() < 0.1:
            system.clock += timeout
        else:
            chosen = system.chance.sample(able, system.chance.randint(1, len(able)))
            return [worker for worker in chosen if worker.goes_on()]
        return []

    def abandon(self) -> None:
        """What every process still did when the command died."""
        workers, self.workers = self.workers, []
        for worker in workers:
            worker.partly()


class Worker:
    """A process and both ends of its pipe."""

    def __init__(self, crew: Crew) -> None:
        self.crew = crew
        self.pid: int | None = None
        self.exitcode: int | None = None
        self.fate, self.begun, self.mute = "", False, False
        self.job: tuple[Any, ...] | None = None
        self.message: Any = None

    def start(self) -> None:
        self.fate = self.crew.fate()
        if self.fate == "vanishes" and self.crew.system.chance.random() < 0.3:
            MET["worker refused"] += 1
            raise BlockingIOError("Resource temporarily unavailable")
        self.pid = 1
        self.mute = self.fate == "silent"
        MET["worker silent"] += self.mute
        self.crew.workers.append(self)

    def send(self, job: tuple[Any, ...]) -> None:
        if self.exitcode is not None:
            raise BrokenPipeError
        if not self.fate:
            self.fate = self.crew.fate().replace("silent", "hangs")
        if self.fate == "vanishes":
            self.exitcode = -9
            if self.crew.system.chance.random() < 0.5:
                raise BrokenPipeError
        self.job = job

    def goes_on(self) -> bool:
        """Come to the next message, or to an end; whether the pipe has news of it."""
        if self.pid is None or self.fate == "vanishes":
            MET["worker vanishes"] += 1
            self.exitcode, self.message = -9, ConnectionResetError() if self.job else EOFError()
        elif not self.begun:
            self.begun, self.message = True, None
        else:
            assert self.job is not None
            MET[f"worker {self.fate}"] += 1
            if self.fate == "well":
                job, self.job, self.fate = self.job, None, ""
                with self.crew.system.running(Process()):
                    self.message = executors._process_alone(*job)
            else:
                self.partly()
                self.mute = self.fate == "hangs"
                self.message = EOFError()
        return not self.mute

    def recv(self) -> Any:
        if isinstance(self.message, Exception):
            raise self.message
        return self.message

    def partly(self) -> None:
        """The record as far as chance says, perhaps to its end, of which nobody hears; then the process is no more."""
        job, self.job = self.job, None
        if job is None or self.exitcode is not None:
            return
        process = Process(left=self.crew.system.chance.randint(0, _MOST))
        with self.crew.system.running(process):
            try:
                executors._process_alone(*job)
            except Killed:
                if not self.crew.system.main.alive:
                    raise
        process.end()

    def kill(self) -> None:
        """End the process in the middle of what it does."""
        self.crew.workers = [worker for worker in self.crew.workers if worker is not self]
        if self.crew.system.main.alive:
            self.partly()
        self.exitcode = -9

    def join(self, timeout: float) -> None: ...

    def close(self) -> None: ...
