"""Jobs by several processes: results in order, faults at their turn, the death of a worker noticed."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from pathlib import Path

import pytest

from data_schemas.errors import SceneError
from synth.ensemble import WorkerError, in_order


def work(job: int) -> int:
    if job == 5:
        raise SceneError("the fifth is bad; mend it")
    if job == 7:
        os._exit(9)
    time.sleep(0.02 * (job % 3))  # so that they are done in another order
    return job * job


def test_one_worker_is_this_process() -> None:
    asked = []
    results = in_order(work, (asked.append(job) or job for job in range(5)), 1)
    assert next(results) == 0
    assert asked == [0]
    assert list(results) == [1, 4, 9, 16]


def test_results_come_in_order_and_jobs_are_not_taken_far_ahead() -> None:
    asked: list[int] = []
    results = in_order(work, (asked.append(job) or job for job in (0, 1, 2, 3, 4, 6, 8, 9, 10, 11)), 2)
    assert next(results) == 0
    assert len(asked) <= 5  # two to a worker, and one more since the first result was given out
    assert list(results) == [1, 4, 9, 16, 36, 64, 81, 100, 121]
    assert multiprocessing.active_children() == []


def test_a_fault_is_raised_at_its_turn() -> None:
    results = in_order(work, range(7), 2)
    assert [next(results) for _ in range(5)] == [0, 1, 4, 9, 16]
    with pytest.raises(SceneError, match="the fifth is bad"):
        next(results)
    assert multiprocessing.active_children() == []


def test_the_death_of_a_worker_is_told() -> None:
    with pytest.raises(WorkerError, match="a worker process died before it was done; run the same again"):
        list(in_order(work, [0, 7, 1, 2], 2))
    assert multiprocessing.active_children() == []


def test_who_stops_asking_ends_the_workers() -> None:
    results = in_order(work, [0, 1, 2], 2)
    next(results)
    results.close()
    assert multiprocessing.active_children() == []


def test_faulty_jobs_are_raised_too() -> None:
    def jobs():
        yield 0
        raise SceneError("no further job")

    with pytest.raises(SceneError, match="no further job"):
        list(in_order(work, jobs(), 2))
    assert multiprocessing.active_children() == []


def begun(path: Path) -> None:
    path.touch()
    if path.name > "0":
        time.sleep(1.0)


def test_a_worker_that_is_ended_begins_no_other_job(tmp_path: Path) -> None:
    results = in_order(begun, [tmp_path / str(job) for job in range(8)], 2)
    next(results)
    while len(list(tmp_path.iterdir())) < 3:
        time.sleep(0.01)
    results.close()
    assert len(list(tmp_path.iterdir())) <= 3


def deaf(path: Path) -> None:
    if path.name == "0":
        return
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    path.touch()
    time.sleep(60.0)


def test_a_worker_that_does_not_hear_its_end_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("synth.ensemble._PATIENCE", 0.3)
    results = in_order(deaf, [tmp_path / str(job) for job in range(3)], 2)
    next(results)
    while not any(tmp_path.iterdir()):
        time.sleep(0.01)
    began = time.monotonic()
    results.close()
    assert multiprocessing.active_children() == []
    assert time.monotonic() - began < 30.0  # the job would have slept for a minute
