"""Suite `integrators`, linear part: the closed form against general integrators, in one run, taking turns."""

from __future__ import annotations

import importlib.util
import statistics
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.arrays import Floats
from pipeline.benchmarks.clock import median_ratio, rounds, seconds
from pipeline.benchmarks.linear_hour import HOUR, closed_form, reference, task
from pipeline.benchmarks.peers_linear import heyoka_taylor, scipy_dop853

TOLERANCES = (1e-4, 1e-8, 1e-12, 1e-15)
QUICK = 360  # s of simulated time
_SAMPLED = 200  # readings compared with the reference
OWN = "closed form"


def run(*, quick: bool, folder: Path | None) -> Iterator[dict[str, Any]]:
    """Yield one row a propagator: time, error of the largest angle, how many times slower than the closed form."""
    given = task(QUICK if quick else HOUR)
    rows = np.unique(np.linspace(0, given.time.size - 1, _SAMPLED).astype(np.int64))
    true = reference(given, rows)

    def error(angles: Floats) -> float:
        return float(np.abs(angles[:, rows] - true).max() / np.abs(true).max())

    calls: dict[str, Callable[[], Floats]] = {OWN: lambda: closed_form(given)}
    absent = importlib.util.find_spec("heyoka") is None
    tolerances = TOLERANCES[1::2] if quick else TOLERANCES
    if not absent:
        calls |= {f"heyoka, non-compact, {tol:g}": heyoka_taylor(given, tol) for tol in tolerances}
    taken = rounds(calls, repeats=3 if quick else 7)
    errors = {name: error(call()) for name, call in calls.items()}
    for name, times in taken.items():
        ratio = None if name == OWN else median_ratio(times, taken[OWN])
        yield _row(name, given.seconds, statistics.median(times), errors[name], ratio)
    if absent:
        yield _row("heyoka, non-compact", given.seconds, None, None, None) | {"note": "not installed: extra 'peers'"}
    yield _slow_peer(given.seconds, scipy_dop853(given), taken[OWN], error)


def _slow_peer(
    length: int, call: Callable[[], Floats], own: list[float], error: Callable[[Floats], float]
) -> dict[str, Any]:
    """One timed run of a peer that takes many seconds; its compiled right-hand side is loaded by a short one first."""
    scipy_dop853(task(2))()
    found: list[Floats] = []
    time = seconds(lambda: found.append(call()))
    return _row("scipy DOP853, rtol 1e-6", length, time, error(found[0]), time / statistics.median(own))


def _row(name: str, length: int, time: float | None, error: float | None, ratio: float | None) -> dict[str, Any]:
    return {
        "propagator": name,
        "simulated_s": length,
        "ms": None if time is None else 1e3 * time,
        "error": error,
        "times_slower": ratio,
        "note": "",
    }
