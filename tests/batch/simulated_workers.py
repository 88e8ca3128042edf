"""Pebble's pool of one process, as the executors use it, with a process that does its record when chance says."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from pebble import ProcessExpired
from simulated_system import MET, Killed, Process, System

FATES = ("dies", "hangs", "vanishes", "silent")
_MOST = 24  # calls of the system; a record makes about 20


@dataclass(eq=False)
class Task:
    pool: Pool
    fate: str
    future: Future[Any]
    work: Callable[[], Any]
    timeout: float


class Crew:
    """All processes of one run; `share` of their records meet one of `FATES`."""

    def __init__(self, system: System, share: float) -> None:
        self.system, self.share = system, share
        self.tasks: list[Task] = []

    def pool(self, **_: object) -> Pool:
        return Pool(self)

    def wait(self, futures: Iterable[Future[Any]], timeout: float, _when: str) -> Any:
        """In place of `concurrent.futures.wait`: some of what is waited for gets done, or time passes."""
        system, asked = self.system, set(futures)
        ready = [task for task in self.tasks if task.future in asked and task.fate != "silent"]
        if not ready:
            MET["worker silent"] += 1
            system.clock += 2000.0
        elif system.chance.random() < 0.1:
            system.clock += timeout
        else:
            for task in system.chance.sample(ready, system.chance.randint(1, len(ready))):
                self._finish(task)
        return SimpleNamespace(done={each for each in asked if each.done()})

    def _finish(self, task: Task) -> None:
        self.tasks.remove(task)
        MET[f"worker {task.fate}"] += 1
        if task.fate == "well":
            with self.system.running(Process()):
                task.future.set_result(task.work())
        elif task.fate == "vanishes":
            task.pool.broken = True
            task.future.set_exception(BrokenProcessPool("All workers expired"))
        else:
            self.partly(task)
            if task.fate == "hangs":
                self.system.clock += task.timeout
                task.future.set_exception(TimeoutError())
            else:
                expired = ProcessExpired("Abnormal termination")
                expired.exitcode = -9
                task.future.set_exception(expired)

    def partly(self, task: Task) -> None:
        """The record as far as chance says, perhaps to its end, of which nobody hears; then the process is no more."""
        process = Process(left=self.system.chance.randint(0, _MOST))
        with self.system.running(process):
            try:
                task.work()
            except Killed:
                if not self.system.main.alive:
                    raise
        process.end()

    def abandon(self) -> None:
        """What every process still did when the command died."""
        tasks, self.tasks = self.tasks, []
        for task in tasks:
            if task.fate != "vanishes":
                self.partly(task)


class Pool:
    """In place of `pebble.ProcessPool`."""

    def __init__(self, crew: Crew) -> None:
        self.crew, self.broken = crew, False

    def schedule(self, function: Callable[..., Any], *, args: tuple[Any, ...], timeout: float) -> Future[Any]:
        if self.broken:
            raise RuntimeError("The pool is broken")
        chance = self.crew.system.chance
        fate = chance.choice(FATES) if chance.random() < self.crew.share else "well"
        task = Task(self, fate, Future(), lambda: function(*args), timeout)
        self.crew.tasks.append(task)
        return task.future

    def stop(self) -> None:
        """End the process in the middle of what it does."""
        for task in [each for each in self.crew.tasks if each.pool is self]:
            self.crew.tasks.remove(task)
            if self.crew.system.main.alive:
                self.crew.partly(task)

    def join(self) -> None: ...
