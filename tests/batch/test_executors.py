"""Executors: the same outcomes whoever does the work; what crashes, hangs or eats memory costs itself alone."""

from __future__ import annotations

import functools
import gc
import os
import shutil
import signal
import struct
import subprocess
import sys
import threading
import time
from multiprocessing import Pipe
from pathlib import Path
from types import SimpleNamespace

import pytest
from batch_parts import METHODS, POISON, Processes, alike, config_of, numbers_of, write_record

from pipeline.batch import executors as isolated
from pipeline.batch.executors import Isolated, pooled, serial
from pipeline.batch.job import Kind, Outcome, process_record

FAULTS = {"crash": "Crashed", "leave": "Crashed", "hang": "TimedOut", "greedy": "MemoryError", "cut": "FileError"}
DISTINCT = 5
ROOT = Path(__file__).parents[2]


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
        killed = child._process.pid
        os.kill(killed, signal.SIGKILL)
        assert child.run(small, config_of(out, "b")).status in ("ok", "failed")
        assert child.run(small, config_of(out, "c")).status == "ok"
        held = child._process.pid
    for pid in (killed, held):
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def test_a_record_that_asks_python_to_end_is_a_crash(small, tmp_path, out):
    """It ended the whole batch."""
    path = shutil.copy(small, tmp_path / "gone-0.record.nc")
    ((one,), (other,)) = pooled(
        [(path, config_of(out, "a")), (small, config_of(out, "b"))], workers=1, methods=METHODS, timeout=60.0
    )
    assert (one.error_class, other.status) == ("Crashed", "ok")
    assert "its process ended with status 1" in one.error


def silent(_pipe):
    """Begins, and is never ready."""


def refused(pipe):
    pipe.close()
    raise BlockingIOError("Resource temporarily unavailable")


def vanishes(pipe):
    pipe.close()


def idle(pipe):
    """Is ready, and dies before it takes a record."""
    pipe.send(None)
    threading.Timer(0.1, pipe.close).start()


def then(*acts):
    """Is ready; once it has its record it does all that, the pipe in hand, or hangs."""

    def play(pipe):
        pipe.send(None)
        threading.Thread(target=lambda: pipe.poll(60.0) and pipe.recv() and [act(pipe) for act in acts]).start()

    return play


def answers(pipe):
    pipe.send(Outcome("a", "ok"))


def torn(pipe):
    """A message of a thousand bytes that ends after ten."""
    os.write(pipe.fileno(), struct.pack("!i", 1000) + bytes(10))


def nonsense(pipe):
    pipe.send_bytes(b"nonsense")


well, crashes, hangs = then(answers), then(vanishes), then()
needs_reset = pytest.mark.skipif(sys.platform != "linux", reason="Linux says that a record was not taken")


@pytest.mark.parametrize(
    "parts",
    [(vanishes, refused, well), pytest.param((idle, refused, well), marks=needs_reset), (silent, vanishes, well)],
)
def test_a_process_that_vanishes_is_replaced_and_the_record_begun_again(small, out, monkeypatch, parts):
    processes = Processes(*parts)
    monkeypatch.setattr(isolated, "multiprocessing", processes)
    monkeypatch.setattr(isolated, "_START", 0.3)
    with Isolated(METHODS, 60.0) as child:
        assert child.run(small, config_of(out, "a")).status == "ok"
    assert [process.killed for process in processes.made] == [part is not refused for part in parts]
    assert not any(os.path.exists(scratch) for *_, scratch in (process.given for process in processes.made))


@pytest.mark.parametrize(
    ("part", "told"),
    [(vanishes, "vanished before it began"), (refused, "vanished before it began"), (silent, "fell silent")],
)
def test_a_record_whose_processes_all_vanish_is_given_up(small, out, monkeypatch, part, told):
    processes = Processes(*[part] * isolated.ATTEMPTS)
    monkeypatch.setattr(isolated, "multiprocessing", processes)
    monkeypatch.setattr(isolated, "_START", 0.02)
    monkeypatch.setattr(isolated, "LOOK", 0.01)
    ((outcome,),) = pooled([(small, config_of(out, "a"))], workers=1, methods=METHODS, timeout=0.02)
    assert outcome.error_class == "WorkerLost"
    assert f"3 processes in turn {told}" in outcome.error
    assert len(processes.made) == isolated.ATTEMPTS


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
    ("part", "told"),
    [
        (hangs, "took longer than 0.2 s and was ended; allow more with --timeout"),
        (crashes, "its process was killed by SIGKILL; look at this file, or allow more with --memory"),
        (then(torn, vanishes), "its process was killed by SIGKILL; look at this file"),
        (then(nonsense), "its process was killed by SIGKILL; look at this file"),
    ],
    ids=["hangs", "crashes", "in the middle of a message", "nonsense"],
)
def test_a_record_that_ends_its_process_is_told(small, out, monkeypatch, part, told):
    """And costs itself alone: the next one finds another process."""
    processes = Processes(part, well, code=-signal.SIGKILL)
    monkeypatch.setattr(isolated, "multiprocessing", processes)
    with Isolated(METHODS, 0.2) as child:
        outcome = child.run(small, config_of(out, "a"))
        assert processes.made[0].killed
        monkeypatch.setattr(child, "form", (METHODS, 60.0))
        assert child.run(small, config_of(out, "a")).status == "ok"
    assert outcome.error_class == ("TimedOut" if part is hangs else "Crashed")
    assert outcome.seconds == (0.2 if part is hangs else 0.0)
    assert told in outcome.error


def test_a_record_has_its_time_from_when_the_process_is_ready(small, out, monkeypatch):
    def slow(pipe):
        threading.Timer(0.5, well, [pipe]).start()

    monkeypatch.setattr(isolated, "multiprocessing", Processes(slow))
    with Isolated(METHODS, 0.3) as child:
        assert child.run(small, config_of(out, "a")).status == "ok"


def test_a_process_leaves_interrupts_to_its_parent(small, out):
    with Isolated(METHODS, 60.0) as child:
        assert child.run(small, config_of(out, "a")).status == "ok"
        pid = child._process.pid
        os.kill(pid, signal.SIGINT)
        assert child.run(small, config_of(out, "b")).status == "ok"
        assert child._process.pid == pid


def test_a_process_ends_when_nobody_listens(monkeypatch, tmp_path):
    monkeypatch.setattr(isolated, "warm", lambda *_: None)
    monkeypatch.setattr(isolated, "confine", lambda _: None)
    monkeypatch.setattr(isolated, "signal", SimpleNamespace(**{**vars(signal), "signal": lambda *_: None}))
    monkeypatch.setattr(isolated.tempfile, "tempdir", None)
    ours, theirs = Pipe()
    theirs_too = os.dup(theirs.fileno())
    ours.close()
    isolated._work(theirs, METHODS, os.getpid(), tmp_path, str(tmp_path))
    os.close(theirs_too)


PARENT = """
import sys, pathlib, batch_parts, test_executors
if __name__ == "__main__":
    small, out = map(pathlib.Path, sys.argv[1:])
    with test_executors.Isolated(batch_parts.METHODS, 2000.0) as child:
        child.run(small, batch_parts.config_of(out, "a"))
        print("ready", flush=True)
        child.run(small, batch_parts.config_of(out, "b", kind=test_executors.SLEEPER))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux ends a process with its parent")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_a_parent_that_ends_takes_its_processes_along(small, out, number):
    """Its output has an end when the last process that holds it has ended."""
    env = os.environ | {"PYTHONPATH": f"{ROOT}:{Path(__file__).parent}"}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-c", PARENT, small, out], env=env, **pipes) as parent:
        assert parent.stdout.readline() == "ready\n", parent.stderr.read()
        begun = time.monotonic()
        parent.send_signal(number)
        assert parent.stdout.read() == ""
        assert time.monotonic() - begun < 500.0


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
    monkeypatch.setattr(isolated, "LOOK", 0.01)
    monkeypatch.setattr(isolated, "multiprocessing", Processes(then(lambda _: time.sleep(0.1), answers)))
    with Isolated(METHODS, 60.0) as child:
        assert child.run(small, config_of(out, "a")) == Outcome("a", "ok")


def test_a_process_that_does_not_end_is_left_to_die_with_its_parent(small, out, monkeypatch):
    processes, ended, waited = Processes(well), threading.Event(), []
    monkeypatch.setattr(isolated, "PATIENCE", 0.05)
    monkeypatch.setattr(isolated, "multiprocessing", processes)
    own = Isolated(METHODS, 60.0)
    assert own.run(small, config_of(out, "a")).status == "ok"
    (process,) = processes.made
    monkeypatch.setattr(process, "join", lambda timeout: waited.append(ended.wait(timeout)))
    own.stop()
    assert waited == [False]
    assert not os.path.exists(process.given[-1])
