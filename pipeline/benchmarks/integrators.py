"""Suite `integrators`: work-precision of every propagator and of the peers, growth and honesty of errors, bars.

With a folder: a picture of each problem and of growth, and every table as CSV.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pipeline.benchmarks import bars_integrators, ensemble_race, growth, honesty
from pipeline.benchmarks.csv_table import write
from pipeline.benchmarks.problems import problems
from pipeline.benchmarks.references import reference
from pipeline.benchmarks.work_precision import Point, rows, sweep

Row = dict[str, Any]


def run(*, quick: bool, folder: Path | None) -> Iterator[Row]:
    """Yield four kinds of rows: work-precision, growth, honesty, bars. Quick: a tenth as long, fewer tolerances."""
    points: dict[str, list[Point]] = {}
    table: list[Row] = []
    for name, problem in problems(quick=quick).items():
        truth = reference(problem)
        points[name] = sweep(problem, truth, quick=quick)
        for row in rows(problem, truth, points[name], quick=quick):
            table.append(row)
            yield row
        if folder is not None:
            from pipeline.benchmarks.work_precision_picture import draw

            draw(problem.title, truth.source, points[name], folder / f"{name.replace(' ', '-')}.png")
    title, source, points[ensemble_race.NAME] = ensemble_race.race(quick=quick)
    for point in points[ensemble_race.NAME]:
        table.append(point.row(source, math.nan))
        yield table[-1]
    if folder is not None:
        from pipeline.benchmarks.work_precision_picture import draw

        draw(title, source, points[ensemble_race.NAME], folder / f"{ensemble_race.NAME}.png")
    grown = list(growth.grown(quick=quick))
    if folder is not None:
        from pipeline.benchmarks.work_precision_picture import draw_growth

        draw_growth(grown, folder / "growth.png")
        write(folder / "work-precision.csv", table)
    bars = bars_integrators.judged(points)
    others = {
        "growth": [each.row() for each in grown],
        "honesty": [row for found in points.values() for row in honesty.judged(found)],
        "bars": list(bars_integrators.not_judged(bars) if quick else bars),
    }
    for name, found in others.items():
        if folder is not None:
            write(folder / f"{name}.csv", found)
        yield from found
