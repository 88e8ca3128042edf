"""Suite `integrators`: error against run time of every propagator and of the peers, honesty of estimates, bars.

With a folder: a picture, and every table as CSV.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from pipeline.benchmarks import integrators_bars
from pipeline.benchmarks.csv_table import write
from pipeline.benchmarks.problems import raced
from pipeline.benchmarks.references import reference
from pipeline.benchmarks.work_precision import Point, sweep

Row = dict[str, Any]
UNDER = 10.0
"""The true error may be so many times the estimate."""
OVER = 1000.0
"""The estimate may be so many times the true error."""
EXACT = 1e-15
"""An estimate of a few roundings is not asked to be met from below: an error may vanish by chance."""


def run(*, quick: bool, folder: Path | None) -> Iterator[Row]:
    """Yield three kinds of rows: work-precision, honesty, bars. Quick: a tenth as long, fewer tolerances."""
    races: dict[str, tuple[str, list[Point]]] = {}
    tables: dict[str, list[Row]] = {"work-precision": []}
    for name, problem in raced(quick=quick).items():
        truth = reference(problem)
        races[name] = truth.source, sweep(problem, truth, quick=quick)
        rows = [point.row(truth.source) for point in races[name][1]]
        tables["work-precision"] += rows
        yield from rows
    points = {name: found for name, (_, found) in races.items()}
    tables["honesty"] = [row for found in points.values() for row in estimates(found)]
    bars = integrators_bars.judged(points)
    tables["bars"] = list(integrators_bars.not_judged(bars) if quick else bars)
    yield from (*tables["honesty"], *tables["bars"])
    if folder is not None:
        for name, table in tables.items():
            write(folder / f"{name}.csv", table)
        if importlib.util.find_spec("matplotlib") is not None:
            from pipeline.benchmarks.integrators_picture import draw

            draw(races, folder / "integrators.png")


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
