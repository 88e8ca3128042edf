"""Suite `integrators`: error against run time of every propagator and of the peers, honesty of estimates, bars.

Bars: times faster than peers at equal or smaller error, on points of one run. With a folder: a picture.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from pipeline.benchmarks.bar import at_least, not_measured, reported
from pipeline.benchmarks.pictures import draw_integrators
from pipeline.benchmarks.problems import raced
from pipeline.benchmarks.references import reference
from pipeline.benchmarks.tables import Row
from pipeline.benchmarks.work_precision import Point, sweep

ABSENT = "not installed, or did not reach it: extra 'peers'"
ANY = math.nan
_STIFF = ((1e-6, 1.4), (1e-9, 1.4), (1e-12, 3.0))

BARS: tuple[tuple[str, str, float, float, float | None], ...] = (
    ("linear", "heyoka", ANY, 1e-14, 50.0),
    ("linear", "CyRK DOP853", 1e-6, 1e-14, None),
    ("linear", "scipy DOP853", 1e-9, 1e-14, None),
    ("nonlinear", "heyoka", 1e-12, 1e-11, 8.0),
    ("nonlinear", "CyRK DOP853", 1e-9, 1e-11, None),
    ("nonlinear", "scipy DOP853", 1e-9, 1e-11, None),
    ("beam", "heyoka", 1e-9, math.inf, 1.5),
    ("beam", "scipy DOP853", 1e-9, math.inf, None),
    *(("van der Pol", "scipy Radau", tolerance, math.inf, 300.0) for tolerance in (1e-6, 1e-9, 1e-12)),
    *((name, "CyRK RADAU", tolerance, math.inf, limit) for name in ("van der Pol", "stiff beam")
      for tolerance, limit in _STIFF),
)  # fmt: skip
"""Problem, peer, its tolerance (`ANY`: its fastest point), the largest error of ours, and how many times faster ours
must be at that error and not above the peer's; None is reported only."""
UNDER = 10.0
"""The true error may be so many times the estimate."""
OVER = 1000.0
"""The estimate may be so many times the true error."""
EXACT = 1e-15
"""An estimate of a few roundings is not asked to be met from below: an error may vanish by chance."""


def run(*, quick: bool, folder: Path | None) -> Iterator[Row]:
    """Yield three kinds of rows: work-precision, honesty, bars. Quick: a tenth as long, fewer tolerances."""
    races: dict[str, tuple[str, list[Point]]] = {}
    for name, problem in raced(quick=quick).items():
        truth = reference(problem)
        races[name] = truth.source, sweep(problem, truth, quick=quick)
        yield from (point.row(truth.source) for point in races[name][1])
    points = {name: found for name, (_, found) in races.items()}
    for found in points.values():
        yield from estimates(found)
    for bar in judged(points):
        # of short problems, on which starting up is what takes the time: reported, not judged
        yield bar | {"limit": f"of the full run: {bar['limit']}", "pass": None} if quick else bar
    if folder is not None and importlib.util.find_spec("matplotlib") is not None:
        draw_integrators(races, folder / "integrators.png")


def honest(error: float, estimate: float) -> bool:
    """Whether an estimate fits the true error; NaN fits nothing."""
    return error <= UNDER * estimate and (error >= estimate / OVER or estimate <= EXACT)


def estimates(points: Sequence[Point]) -> Iterator[Row]:
    """One row for each point at which one of the project's propagators gave a value."""
    for point in points:
        if point.own and point.seconds and not math.isnan(point.estimate):
            yield {
                "honesty": point.problem,
                "method": point.method,
                "tolerance": point.tolerance,
                "error": point.whole_error,
                "estimate": point.estimate,
                "error_over_estimate": point.whole_error / point.estimate,
                "pass": honest(point.whole_error, point.estimate),
            }


def judged(found: Mapping[str, Sequence[Point]]) -> Iterator[Row]:
    """Bars from the points of the suite."""
    for name, peer, tolerance, error, limit in BARS:
        points = found[name]
        rival = min(_of(points, peer, tolerance), key=lambda point: point.ms, default=None)
        at = "any tolerance" if math.isnan(tolerance) else f"{tolerance:g}"
        bar = f"{name}{'' if math.isinf(error) else f' at <= {error:g}'}: times faster than {peer} at {at}"
        if rival is None:
            yield not_measured(bar, "reported" if limit is None else f">= {limit:g}", ABSENT)
            continue
        method, mine = own_time(points, min(error, rival.error))
        words = f"{bar}: {method} {mine:.3g} ms, it {rival.ms:.3g} ms at {rival.error:.1g}"
        ratio = rival.ms / mine
        yield reported(words, ratio) if limit is None else at_least(words, ratio, limit)


def _of(points: Sequence[Point], method: str, tolerance: float = ANY) -> list[Point]:
    """Points of a method that have a value, at one tolerance or all."""
    return [
        point
        for point in points
        if point.method == method
        and point.seconds
        and math.isfinite(point.error)
        and (math.isnan(tolerance) or point.tolerance == tolerance)
    ]


def own_time(points: Sequence[Point], error: float) -> tuple[str, float]:
    """The fastest propagator at an error and its time, ms; NaN where none reaches it."""
    methods = dict.fromkeys(point.method for point in points if point.own)
    times = {method: time_at(_of(points, method), error) for method in methods}
    reached = {method: time for method, time in times.items() if not math.isnan(time)}
    return min(reached.items(), key=lambda item: item[1], default=("none", math.nan))


def time_at(points: Sequence[Point], error: float) -> float:
    """Time, ms, at which one method reaches an error: its curve, interpolated between logarithms; NaN if never.

    Points that others beat in both respects are passed over. A method that is always better takes its least time.
    """
    front: list[Point] = []
    for point in sorted(points, key=lambda point: (point.ms, point.error)):
        if not front or point.error < front[-1].error:
            front.append(point)
    if not front or front[-1].error > error:
        return math.nan
    if front[0].error <= error:
        return front[0].ms
    errors = np.log([max(point.error, 1e-17) for point in front])
    times = np.log([point.ms for point in front])
    return float(np.exp(np.interp(-math.log(error), -errors, times)))
