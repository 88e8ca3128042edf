"""Several threads give what one gives, in the same order, and hold little."""

from __future__ import annotations

import threading
import time

import pytest

from pipeline.film.marks.search import in_order


@pytest.mark.parametrize("jobs", [1, 2, 5])
def test_results_come_in_the_order_of_the_items(jobs: int) -> None:
    def slow_at_first(item: int) -> int:
        time.sleep(0.01 * (item % 3 == 0))
        return item * item

    assert list(in_order(slow_at_first, range(20), jobs)) == [item * item for item in range(20)]


def test_items_are_asked_for_a_few_at_a_time() -> None:
    asked = 0

    def items():
        nonlocal asked
        for item in range(50):
            asked = item + 1
            yield item

    for item in in_order(abs, items(), 2):
        assert asked <= item + 3


def test_one_job_works_in_the_caller_s_thread_and_two_do_not() -> None:
    threads = {jobs: set(in_order(lambda _: threading.get_ident(), range(4), jobs)) for jobs in (1, 2)}
    assert threads[1] == {threading.get_ident()}
    assert threading.get_ident() not in threads[2]


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_fault_is_the_caller_s_and_ends_the_work(jobs: int) -> None:
    begun = []

    def work(item: int) -> float:
        begun.append(item)
        return 1.0 / (3 - item)

    results = in_order(work, range(100), jobs)
    with pytest.raises(ZeroDivisionError):
        list(results)
    assert len(begun) <= 3 + 1 + jobs + 1
