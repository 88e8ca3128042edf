"""Suite `integrators`, linear part: the closed form against general integrators, in one run, taking turns."""

from __future__ import annotations

import importlib.util
import statistics
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.arrays import Floats
from pipeline.benchmarks.clock import median_ratio, rounds, seconds
from pipeline.benchmarks.linear_hour import HOUR, closed_form, motion, reference, task
from pipeline.benchmarks.peers_linear import heyoka_taylor, scipy_dop853

HEYOKA = "heyoka, non-compact"
TOLERANCES = (1e-6, 1e-9, 1e-12, 1e-15)
"""heyoka's; at 1e-6 it is left with an error near 1e-4, and nobody wants worse."""
DOP853 = ((1e-6, 1e-9), (1e-9, 1e-11))
"""Relative and absolute tolerance: the ones by name, and those whose error is 1e-6."""
QUICK = 360  # s of simulated time
_SAMPLED = 200  # readings compared with the reference
OWN = "closed form"


def run(*, quick: bool, folder: Path | None) -> Iterator[dict[str, Any]]:
    """Yield one row a propagator: time, error of the largest angle, how many times slower than the closed form."""
    given = task(QUICK if quick else HOUR)
    rows = np.unique(np.linspace(0, given.time.size - 1, _SAMPLED).astype(np.int64))
    known = importlib.util.find_spec("mpmath") is not None
    true = reference(given, rows) if known else np.full((2, rows.size), np.nan)

    def error(angles: Floats) -> float:
        return float(np.abs(angles[:, rows] - true).max() / np.abs(true).max())

    moved = motion(given)
    calls: dict[str, Callable[[], Floats]] = {OWN: lambda: closed_form(given, moved)}
    absent = importlib.util.find_spec("heyoka") is None
    if not absent:
        for shared, words in ((True, "shared forcing"), (False, "forcing for each")):
            for tolerance in TOLERANCES[1::2] if quick else TOLERANCES:
                calls[f"{HEYOKA}, {words}, {tolerance:g}"] = heyoka_taylor(given, tolerance, shared=shared)
    taken = rounds(calls, repeats=3 if quick else 5, batch=5)
    for name, times in taken.items():
        ratio = None if name == OWN else median_ratio(times, taken[OWN])
        yield _row(name, given.seconds, statistics.median(times), error(calls[name]()), ratio)
    if absent:
        yield _row(HEYOKA, given.seconds, None, None, None) | {"note": "not installed: extra 'peers'"}
    scipy_dop853(task(2), *DOP853[0])()  # its compiled right-hand side is loaded
    for relative, absolute in DOP853:
        found: list[Floats] = []
        call = scipy_dop853(given, relative, absolute)
        time = seconds(partial(_keep, found, call))  # one run: it takes seconds
        name = f"scipy DOP853, rtol {relative:g}"
        yield _row(name, given.seconds, time, error(found[0]), time / statistics.median(taken[OWN]))


def _keep(found: list[Floats], call: Callable[[], Floats]) -> None:
    found.append(call())


def _row(name: str, length: int, time: float | None, error: float | None, ratio: float | None) -> dict[str, Any]:
    return {
        "propagator": name,
        "simulated_s": length,
        "ms": None if time is None else 1e3 * time,
        "error": error,
        "times_slower": ratio,
        "note": "",
    }
