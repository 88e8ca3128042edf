"""Signals wait for delicate steps, and are not lost."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import weakref

import pytest

from data_schemas.shield import shielded

NUMBERS = [signal.SIGINT, signal.SIGTERM]


@pytest.fixture(autouse=True)
def _handlers_as_before():
    before = {number: signal.getsignal(number) for number in NUMBERS}
    yield
    assert {number: signal.getsignal(number) for number in NUMBERS} == before


@pytest.fixture
def heard():
    """Numbers of the signals that were acted upon."""
    numbers: list[int] = []
    before = {number: signal.signal(number, lambda got, _frame: numbers.append(got)) for number in NUMBERS}
    yield numbers
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize("number", NUMBERS)
def test_a_signal_waits_for_the_end_of_the_block(heard, number):
    with shielded():
        signal.raise_signal(number)
        assert heard == []
    assert heard == [number]


def test_a_signal_is_not_lost_when_the_block_fails(heard):
    def fail() -> None:
        with shielded():
            signal.raise_signal(signal.SIGINT)
            raise ValueError("at fault")

    with pytest.raises(ValueError, match="at fault"):
        fail()
    assert heard == [signal.SIGINT]


class Held:
    """What a function was at when a signal came."""


def test_a_signal_that_waits_keeps_nothing_of_what_it_interrupted():
    gone = []

    def interrupted() -> None:
        held = Held()
        weakref.finalize(held, gone.append, True)
        signal.raise_signal(signal.SIGTERM)

    signal.signal(signal.SIGTERM, lambda _number, frame: gone.append(frame))
    with shielded():
        interrupted()
        assert gone == [True]
    assert gone == [True, None]
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


def test_blocks_nest(heard):
    with shielded():
        with shielded():
            signal.raise_signal(signal.SIGINT)
        assert heard == []
    assert heard == [signal.SIGINT]


def test_what_is_ignored_stays_ignored(heard):
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    with shielded():
        assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN
        signal.raise_signal(signal.SIGINT)
    signal.signal(signal.SIGINT, handler)
    assert heard == []


def test_threads_are_left_alone(heard):
    seen: list[object] = []

    def work() -> None:
        before = signal.getsignal(signal.SIGINT)
        with shielded():
            seen.append(signal.getsignal(signal.SIGINT) is before)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [True]


def test_a_signal_without_a_handler_ends_the_process_after_the_block():
    script = (
        "import signal, sys\nfrom data_schemas.shield import shielded\nsignal.signal(signal.SIGTERM, signal.SIG_DFL)\n"
    )
    script += "with shielded():\n    signal.raise_signal(signal.SIGTERM)\n    print('done', flush=True)\nprint('after')"
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout) == (-signal.SIGTERM, "done\n")


def test_a_signal_whose_handler_is_the_systems_is_raised_again(heard, monkeypatch):
    again: list[int] = []
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    with shielded():
        signal.raise_signal(signal.SIGTERM)
        monkeypatch.setattr(signal, "raise_signal", again.append)
    assert again == [signal.SIGTERM]
