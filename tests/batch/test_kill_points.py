"""Killed at any named point of writing, of the ledger or of going on: nothing lost, doubled or unreadable.

A child process does a batch serially and kills itself at the point; then the batch goes on undisturbed, and its summary
is that of a batch that never was disturbed, bit by bit.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import sys
import time
import warnings

import numpy as np
import pytest
from batch_parts import METHODS, alike, config_of, numbers_of, write_record

import data_schemas
from data_schemas import writing
from pipeline.batch import campaign, ledger, summary
from pipeline.batch import executors as isolated
from pipeline.batch.campaign import Tally, remove_leftovers
from pipeline.batch.executors import pooled, serial
from pipeline.batch.job import owner_of
from pipeline.batch.ledger import Index, Ledger, Log
from pipeline.batch.summary import NAMES, write_summary

fcntl = pytest.importorskip("fcntl")
pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="the child is a fork")
RECORDS = 3


def batch(jobs, out, executor=serial):
    """What the command does, in this process."""
    with Ledger(out, '{"numpy": "1"}') as book, Log(out) as log:
        remove_leftovers(out)
        tally = Tally(len(jobs))
        campaign.run(jobs, book, executor, log, tally)
        write_summary(jobs, book, out)
        return tally


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("in")
    return [write_record(folder / f"{number}.record.nc", number) for number in range(RECORDS)]


@pytest.fixture(scope="module")
def undisturbed(inputs, tmp_path_factory):
    out = tmp_path_factory.mktemp("undisturbed")
    tally = batch(jobs_of(inputs, out), out)
    assert (tally.done, tally.kept) == (RECORDS, 0)
    return out


def jobs_of(inputs, out):
    return [(path, config_of(out, str(number))) for number, path in enumerate(inputs)]


def die(*_, **__):
    os.kill(os.getpid(), signal.SIGKILL)


def nth(function, count, before=True):
    """The function, with the process killed before or after its call of that number."""
    left = [count]

    def counted(*args, **kwargs):
        left[0] -= 1
        if left[0] == 0 and before:
            die()
        found = function(*args, **kwargs)
        if left[0] == 0:
            die()
        return found

    return counted


def torn(descriptor, data):
    os.fsync(descriptor)
    os.truncate(descriptor, os.fstat(descriptor).st_size)
    REAL_WRITE(descriptor, data[: len(data) // 2])
    die()


REAL_WRITE = os.write


class Os:
    """The module `os` as one file of ours sees it, one function of it replaced."""

    def __init__(self, **instead):
        self._instead = instead

    def __getattr__(self, name):
        return self._instead.get(name) or getattr(os, name)


def set_os(module, **instead):
    module.os = Os(**instead)


def set_attribute(owner, name, value):
    setattr(owner, name, value)


POINTS = {
    "result: before its temporary file is there": lambda: set_os(writing, open=nth(os.open, 3)),
    "result: encoded, nothing written": lambda: set_attribute(writing, "_flushed", nth(writing._flushed, 2)),
    "result: written, not on the disk": lambda: set_os(writing, fsync=nth(os.fsync, 3)),
    "result: on the disk, not verified": lambda: set_attribute(writing, "_verified", nth(writing._verified, 2)),
    "result: verified, without its name": lambda: set_attribute(writing, "give_name", nth(writing.give_name, 2)),
    "result: named, the folder not told": lambda: set_attribute(writing, "sync_folder", nth(writing.sync_folder, 2)),
    "result: whole, not in the ledger": lambda: set_attribute(Ledger, "append", nth(Ledger.append, 2)),
    "ledger: before its first line": lambda: set_os(ledger, write=nth(os.write, 1)),
    "ledger: half a line": lambda: set_os(ledger, write=nth_torn(3)),
    "ledger: line written, not on the disk": lambda: set_os(ledger, fsync=nth(os.fsync, 3)),
    "ledger: line on the disk": lambda: set_os(ledger, fsync=nth(os.fsync, 3, before=False)),
    "summary: before its first table": lambda: set_attribute(summary, "write_text", nth(summary.write_text, 1)),
    "summary: between its tables": lambda: set_attribute(summary, "write", nth(summary.write, 1)),
    "summary: all written": lambda: set_attribute(summary, "write", nth(summary.write, 1, before=False)),
}
RESUMED = {
    "resume: leftovers half removed": lambda: set_os(campaign, unlink=nth(os.unlink, 1, before=False)),
    "resume: before the torn end is cut": lambda: set_os(ledger, ftruncate=nth(os.ftruncate, 1)),
    "resume: after the torn end is cut": lambda: set_os(ledger, ftruncate=nth(os.ftruncate, 1, before=False)),
    "resume: while what holds is looked at": lambda: set_attribute(campaign, "_sum_of", nth(campaign._sum_of, 2)),
    "resume: before the second result is made again": lambda: set_attribute(writing, "lay_out", die),
}


def nth_torn(count):
    left = [count]

    def counted(descriptor, data):
        left[0] -= 1
        return torn(descriptor, data) if left[0] == 0 else os.write(descriptor, data)

    return counted


def killed(jobs, out, arrange, executor=serial):
    """Do the batch in a child that `arrange` has killed; whether it was."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # a fork of a process with threads: it uses none of them
        child = os.fork()
    if child == 0:
        with contextlib.suppress(BaseException):
            arrange()
            batch(jobs, out, executor)
        os._exit(0)
    _, status = os.waitpid(child, 0)
    with contextlib.suppress(FileNotFoundError), (out / "ledger.jsonl").open("rb") as held:
        fcntl.flock(held, fcntl.LOCK_EX)  # copies of the child have its lock until they end, as they do with it
    return os.WIFSIGNALED(status)


def check_whole(jobs, out, undisturbed):
    """What is there now is whole; what the batch then makes is what it always makes."""
    for path in out.rglob("*.nc"):
        assert data_schemas.validate(path) == []
        data_schemas.read(path)
    before = Index(out, '{"numpy": "1"}').places if (out / "ledger.jsonl").exists() else {}
    tally = batch(jobs, out)
    assert tally.kept == len(before)
    assert tally.done == len(jobs) - len(before)
    for name in NAMES:
        assert (out / name).read_bytes() == (undisturbed / name).read_bytes()
    for _, config in jobs:
        assert alike(numbers_of(config.output), numbers_of(undisturbed / config.key))
    names = {path.name for path in out.iterdir()}
    assert names == {path.name for path in undisturbed.iterdir()}
    lines = (out / "ledger.jsonl").read_text().splitlines()
    assert len(lines) == len(jobs) + 1


@pytest.mark.parametrize("point", POINTS)
def test_killed_in_a_batch(inputs, undisturbed, out, point):
    jobs = jobs_of(inputs, out)
    assert killed(jobs, out, POINTS[point])
    check_whole(jobs, out, undisturbed)


@pytest.mark.parametrize("point", RESUMED)
def test_killed_while_going_on(inputs, undisturbed, out, point):
    """First torn in the ledger with a leftover beside, then killed once more on going on."""
    jobs = jobs_of(inputs, out)
    assert killed(jobs, out, POINTS["ledger: half a line"])
    (out / f".isochrony-{owner_of(out)}0.part").write_bytes(b"half")
    assert killed(jobs, out, RESUMED[point])
    check_whole(jobs, out, undisturbed)


def two_forked(jobs):
    """The executor of the command, whose processes begin as copies of this one: a kill then meets records as a rule."""
    fork = multiprocessing.get_context("fork")
    set_attribute(isolated.multiprocessing, "get_context", lambda _: fork)
    return pooled(jobs, workers=2, methods=METHODS, timeout=60.0)


@pytest.mark.campaign
@pytest.mark.skipif(sys.platform != "linux", reason="times the kill by an interval timer")
@pytest.mark.parametrize(("executor", "kills"), [(serial, 500), (two_forked, 200)], ids=["serial", "pool"])
def test_killed_at_random(inputs, undisturbed, tmp_path, executor, kills):
    """At any moment of a batch, up to five times over the same folder; processes of its own end with it."""
    draw = np.random.default_rng(7)
    (tmp_path / "whole").mkdir()
    begun = time.perf_counter()
    assert not killed(jobs_of(inputs, tmp_path / "whole"), tmp_path / "whole", lambda: None, executor)
    whole = time.perf_counter() - begun
    hits = 0
    for number in range(3 * kills):
        out = tmp_path / str(number)
        out.mkdir()
        jobs = jobs_of(inputs, out)
        for _ in range(5):
            delay = draw.uniform(0.001, whole)

            def arrange(delay=delay):
                signal.signal(signal.SIGALRM, signal.SIG_DFL)
                signal.setitimer(signal.ITIMER_REAL, delay)

            if not killed(jobs, out, arrange, executor):
                break
            hits += 1
        check_whole(jobs, out, undisturbed)
        if hits >= kills:
            break
    assert hits >= kills
