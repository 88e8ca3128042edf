"""Rows of bars, and the parts that every suite shares."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.benchmarks.bars import of_few
from pipeline.benchmarks.scenes import SWELL, two_pendulums
from pipeline.benchmarks.tables import (
    at_least,
    at_most,
    command,
    holds,
    median_ratio,
    not_measured,
    progress,
    reported,
    rounds,
    timed,
)
from synth import simulate


def test_a_bar_holds_at_its_limit_and_not_beyond() -> None:
    assert at_most("x", 1.0, 1.0)["pass"] is True
    assert at_most("x", 1.0001, 1.0)["pass"] is False
    assert at_least("x", 1.0, 1.0)["pass"] is True
    assert at_least("x", 0.9999, 1.0)["pass"] is False
    assert holds("x", True, "a fact")["pass"] is True


@pytest.mark.parametrize("row", [at_most, at_least])
def test_not_a_number_never_holds(row: object) -> None:
    assert row("x", math.nan, 1.0)["pass"] is False  # type: ignore[operator]  # one of two functions


def test_figures_that_promise_nothing_decide_nothing() -> None:
    assert reported("x", 1e9)["pass"] is None
    assert not_measured("x", ">= 50", "not installed")["pass"] is None


def test_limits_widen_with_fewer_records_and_never_narrow() -> None:
    assert of_few(1.1, 400, 400) == 1.1
    assert of_few(1.1, 800, 400) == 1.1
    assert of_few(1.1, 60, 400) > 1.2


def test_rivals_take_turns() -> None:
    order: list[str] = []
    taken = rounds({name: lambda name=name: order.append(name) for name in "ab"}, repeats=3)
    assert order == ["a", "b"] * 4
    assert [len(times) for times in taken.values()] == [3, 3]


def test_median_ratio_compares_within_a_round() -> None:
    # in the second round the machine was ten times slower for both
    assert median_ratio([2.0, 20.0, 2.0], [1.0, 10.0, 1.0]) == 2.0


def test_a_command_that_fails_is_not_timed() -> None:
    import subprocess
    import sys

    assert command(sys.executable, "-c", "import pipeline; print('good')")() == "good\n"
    with pytest.raises(subprocess.CalledProcessError):
        command(sys.executable, "-c", "raise SystemExit(1)")()


def test_time_of_child_processes_is_counted() -> None:
    import sys

    _, spent = timed(command(sys.executable, "-c", "sum(range(10_000_000))"))
    assert spent > 0.02  # a tenth of a second or two, in hundredths


def test_progress_passes_everything_on(capsys: pytest.CaptureFixture[str]) -> None:
    assert list(progress(range(5), "counting")) == [0, 1, 2, 3, 4]
    assert capsys.readouterr() == ("", "")  # no bar: this is no terminal


def test_swell_reaches_what_it_says() -> None:
    slow = np.asarray(simulate(two_pendulums("swell", 1e-4))[1]["truth/forced"].values)
    assert np.abs(slow[0]).max() == pytest.approx(SWELL, rel=0.01)  # scaled on a grid of 0.25 s
