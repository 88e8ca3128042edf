"""Executors: the same outcomes whoever does the work; what crashes, hangs or eats memory costs itself alone."""

from __future__ import annotations

import functools
import gc
import os
import shutil
import signal
import sys
import threading
import time
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from types import SimpleNamespace

import pytest
from batch_parts import METHODS, POISON, alike, config_of, numbers_of, write_record
from pebble import ProcessExpired

from pipeline.batch import executors as isolated
from pipeline.batch.executors import Isolated, pooled, serial
from pipeline.batch.job import Kind, Outcome, process_record

FAULTS = {"crash": "Crashed", "leave": "Crashed", "hang": "TimedOut", "greedy": "MemoryError", "cut": "FileError"}
DISTINCT = 5


def pool(timeout=20.0):
    return functools.partial(pooled, workers=2, methods=METHODS, timeout=timeout)


def poisoned_batch(folder, out, count):
    """`count` records, of which one in twenty is bad, each in one of five ways; and the good ones done serially."""
    folder.mkdir()
    good = [write_record(folder / f"good-{number}.record.nc", number) for number in range(DISTINCT)]
    jobs, expected = [], {}
    (once,) = (out / "serial",)
    for path in good:
        config = config_of(once, path.name)
        ((outcome,),) = serial([(path, config)])
        assert outcome.status == "ok"
        expected[path] = (outcome.rows, numbers_of(config.output))
    words = list(FAULTS)
    for number in range(count):
        path = good[number % DISTINCT]
        if number % 20 == 7:
            word = words[number // 20 % len(words)]
            path = shutil.copy(path, folder / f"{word}-{number}.record.nc")
            if word == "cut":
                os.truncate(path, 5000)
        jobs.append((path, config_of(out, f"{number:04d}", memory=512 << 20)))
    return jobs, expected


def check_poisoned(tmp_path, out, count):
    jobs, expected = poisoned_batch(tmp_path / "in", out, count)
    outcomes = {one.key: one for batch in pool()(jobs) for one in batch}
    assert len(outcomes) == count
    good = 0
    for path, config in jobs:
        one = outcomes[config.key]
        if path in expected:
            good += 1
            assert one.status == "ok", one.error
            assert alike((one.rows, numbers_of(config.output)), expected[path])
        else:
            assert one.status == "failed"
            assert one.error_class == FAULTS[path.name.partition("-")[0]], one.error
            assert not config.output.exists()
    assert good == count - count // 20


@pytest.mark.compiled
def test_a_poisoned_batch_loses_the_poisoned_alone(tmp_path, out):
    check_poisoned(tmp_path, out, 100)


@pytest.mark.campaign
def test_a_large_poisoned_batch_loses_the_poisoned_alone(tmp_path, out):
    check_poisoned(tmp_path, out, 1000)


def test_a_worker_killed_from_outside_costs_its_record_and_no_other(small, out):
    """Killed while idle nothing is lost at all: the next record finds another process."""
    with Isolated(METHODS, 60.0) as child:
        assert child.run(small, config_of(out, "a")).status == "ok"
        (pid,) = child._pool._pool_manager.worker_manager.workers
        os.kill(pid, signal.SIGKILL)
        assert child.run(small, config_of(out, "b")).status in ("ok", "failed")
        assert child.run(small, config_of(out, "c")).status == "ok"
        held = child._pool._pool_manager.worker_manager.workers
    for pid in held:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def broken(*_):
    future = Future()
    future.set_exception(BrokenProcessPool("All workers expired"))
    return future


class Pools:
    """In place of pebble's: does as it is told, and nothing."""

    def __init__(self, *futures):
        self.futures, self.stopped = list(futures), 0

    def __call__(self, **_):
        return self

    def schedule(self, *_, **__):
        return self.futures.pop(0)()

    def stop(self):
        self.stopped += 1

    def join(self):
        raise RuntimeError("it would not die")


def done_well():
    future = Future()
    future.set_result(Outcome("a", "ok"))
    return future


def test_a_process_that_vanishes_is_replaced_and_the_record_begun_again(small, out, monkeypatch):
    def refuse():
        raise RuntimeError("Broken pool")

    fake = Pools(broken, refuse, done_well)
    monkeypatch.setattr(isolated, "ProcessPool", fake)
    with Isolated(METHODS, 1.0) as child:
        assert child.run(small, config_of(out, "a")).status == "ok"
    assert fake.stopped == 3


@pytest.mark.parametrize(("future", "told"), [(broken, "vanished before it began"), (Future, "fell silent")])
def test_a_record_whose_processes_all_vanish_is_given_up(small, out, monkeypatch, future, told):
    monkeypatch.setattr(isolated, "ProcessPool", Pools(*[future] * isolated.ATTEMPTS))
    monkeypatch.setattr(isolated, "_START", 0.0)
    monkeypatch.setattr(isolated, "LOOK", 0.01)
    ((outcome,),) = pooled([(small, config_of(out, "a"))], workers=1, methods=METHODS, timeout=0.02)
    assert outcome.error_class == "WorkerLost"
    assert f"3 processes in turn {told}" in outcome.error


def test_who_stops_listening_ends_the_processes(small, out):
    begun = time.monotonic()
    coming = pool(timeout=1000.0)([(small, config_of(out, "a")), (small, config_of(out, "b", kind=SLEEPER))])
    ((outcome,),) = [next(coming)]
    assert outcome.key == "a.result.nc"
    coming.close()
    assert time.monotonic() - begun < 500.0


def sleep(*_):
    time.sleep(1000.0)


SLEEPER = Kind("sleeper", (".record.nc",), sleep)


@pytest.mark.parametrize(
    ("code", "told"),
    [
        (-9, "was killed by SIGKILL"),
        (-99, "was killed by signal 99"),
        (3, "ended with status 3"),
        (None, "status None"),
    ],
)
def test_how_a_process_ended_is_told(code, told):
    assert told in isolated._death(code)


def test_what_a_record_leaves_in_memory_is_given_back(small, out):
    assert isolated._process_alone(small, config_of(out, "a")).status == "ok"
    assert process_record(small, config_of(out, "b", kind=POISON)).status == "ok"


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (TimeoutError(), "took longer than 1 s and was ended; allow more with --timeout"),
        (ProcessExpired("", -9), "look at this file, or allow more with --memory"),
    ],
)
def test_a_record_that_ends_its_process_is_told(small, out, monkeypatch, error, told):
    def ended():
        future = Future()
        future.set_exception(error)
        return future

    monkeypatch.setattr(isolated, "ProcessPool", Pools(ended))
    with Isolated(METHODS, 1.0) as child:
        outcome = child.run(small, config_of(out, "a"))
    assert outcome.status != "ok"
    assert told in outcome.error


@pytest.mark.compiled
def test_the_least_memory_is_too_little_and_told(small, out):
    """Nothing that reading needs is loaded only then: a library that cannot be would look like a fault of ours."""
    with Isolated(METHODS, 60.0) as child:
        outcome = child.run(small, config_of(out, "a", memory=1))
    assert "takes more memory than this process may have; give it more" in outcome.error


def test_an_orphan_ends(monkeypatch):
    ended = []
    monkeypatch.setattr(isolated.ctypes, "CDLL", lambda _: SimpleNamespace(prctl=lambda *_: None))
    monkeypatch.setattr(isolated.os, "_exit", ended.append)
    isolated._die_with(os.getppid())
    assert ended == []
    isolated._die_with(os.getppid() + 1)
    assert ended == [1]
    monkeypatch.setattr(isolated.sys, "platform", "darwin")
    isolated._die_with(os.getppid() + 1)
    assert ended == [1]


def test_warming_takes_methods_that_decline(monkeypatch):
    monkeypatch.setattr(isolated, "_die_with", lambda _: None)
    isolated.warm(["projection", "shooting"], parent=1)
    gc.unfreeze()


@pytest.mark.skipif(sys.platform != "linux", reason="of Linux")
def test_a_c_library_is_asked_to_keep_memory_where_it_can(monkeypatch):
    asked = []
    for library in (SimpleNamespace(), SimpleNamespace(mallopt=lambda *what: asked.append(what))):
        monkeypatch.setattr(isolated.ctypes, "CDLL", lambda _, library=library: library)
        isolated._keep_memory()
    assert asked == [(-1, 16 << 20), (-3, 8 << 20)]
    monkeypatch.setattr(isolated.sys, "platform", "darwin")
    isolated._keep_memory()
    assert len(asked) == 2


def test_a_record_that_takes_longer_than_a_look_is_waited_for(small, out, monkeypatch):
    config, future = config_of(out, "a"), Future()
    done = Outcome(config.key, "ok", None, None, None)
    threading.Timer(0.1, future.set_result, [done]).start()
    monkeypatch.setattr(isolated, "LOOK", 0.01)
    monkeypatch.setattr(isolated, "ProcessPool", Pools(lambda: future))
    with Isolated(METHODS, 1.0) as child:
        assert child.run(small, config) == done


def test_a_process_that_does_not_end_is_left_to_die_with_its_parent(monkeypatch):
    ended = threading.Event()

    class Stuck:  # as pebble where an interrupt left a future locked
        def stop(self):
            pass

        def join(self):
            ended.wait(60.0)

    monkeypatch.setattr(isolated, "PATIENCE", 0.05)
    own = Isolated(METHODS, 1.0)
    monkeypatch.setattr(own, "_pool", Stuck())
    own.stop()
    assert not ended.is_set()
    ended.set()
