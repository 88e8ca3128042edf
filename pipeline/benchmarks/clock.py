"""Processor time, measured so that it can be compared: warm, rivals taking turns in one run, medians with ranges."""

from __future__ import annotations

import os
import statistics
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from pipeline.arrays import Floats
from pipeline.benchmarks.tables import Row, at_most

Call = Callable[[], Any]
Given = TypeVar("Given")


def timed(call: Callable[[], Given]) -> tuple[Given, float]:
    """What a call gives, and its processor time, all threads and finished child processes, s."""
    started = _spent()
    given = call()
    return given, _spent() - started


def _spent() -> float:
    children = os.times()  # which counts in hundredths of a second: process_time does not know children
    return time.process_time() + children.children_user + children.children_system


def rounds(calls: Mapping[str, Call], repeats: int = 5, batch: int = 1) -> dict[str, list[float]]:
    """Times of rivals that take turns, s a call: a busy machine slows all of them alike.

    Parameters
    ----------
    calls : mapping of str to callable
        The rivals; one call of each goes before and is not counted.
    repeats : int
        Rounds.
    batch : int
        Calls in a row of one rival within a round, for calls of a few ms.
    """
    for call in calls.values():
        call()
    taken: dict[str, list[float]] = {name: [] for name in calls}
    for _ in range(repeats):
        for name, call in calls.items():
            taken[name].append(statistics.median(timed(call)[1] for _ in range(batch)))
    return taken


def median_ratio(slow: Sequence[float], fast: Sequence[float]) -> float:
    """Median of the ratios of times that were taken in the same rounds."""
    return statistics.median(one / other for one, other in zip(slow, fast, strict=True))


def times(bar: str, own: Sequence[float], rival: Sequence[float], limit: float) -> Row:
    """A bar on the median of these ratios, with their range."""
    every = [one / other for one, other in zip(own, rival, strict=True)]
    return at_most(bar, median_ratio(own, rival), limit, f"{min(every):.3g} to {max(every):.3g}")


def hilbert(values: Floats) -> float:
    """Slope of the phase, rad a sample, as a user of scipy would have it: the yardstick of methods' times."""
    from scipy.signal import hilbert as analytic

    return float(np.polyfit(np.arange(values.size), np.unwrap(np.angle(analytic(values))), 1)[0])


def command(*words: str) -> Call:
    """A call that runs a program from start to exit in the folder-independent environment of this tree; its output.

    Raises
    ------
    subprocess.CalledProcessError
        The program fails: its time would mean nothing.
    """
    environment = tree_environment()
    return lambda: subprocess.run(words, env=environment, check=True, capture_output=True, text=True).stdout


def tree_environment() -> dict[str, str]:
    """Environment in which a child process finds the same packages, installed or not."""
    root = str(Path(__file__).parents[2])
    before = os.environ.get("PYTHONPATH")
    return os.environ | {"PYTHONPATH": root if before is None else f"{root}{os.pathsep}{before}"}
