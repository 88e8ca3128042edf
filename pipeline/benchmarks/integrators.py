"""Suite `integrators`: work-precision of every propagator and of the peers, growth and honesty of errors, bars.

With a folder: a picture of each problem and of growth, and every table as CSV. Problems that were finished in it by an
earlier, interrupted run are not run again.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

from pipeline.benchmarks import bars_integrators, ensemble_race, estimated_errors, growth
from pipeline.benchmarks.csv_table import write
from pipeline.benchmarks.kept import Kept
from pipeline.benchmarks.problems import Problem, problems
from pipeline.benchmarks.raced_problems import Race, raced_before
from pipeline.benchmarks.references import reference
from pipeline.benchmarks.work_precision import compiled, sweep

Row = dict[str, Any]


def run(*, quick: bool, folder: Path | None) -> Iterator[Row]:
    """Yield four kinds of rows: work-precision, growth, honesty, bars. Quick: a tenth as long, fewer tolerances."""
    races: dict[str, Race] = {}
    for name, race in finished(Kept(folder), quick=quick):
        races[name] = race
        yield from race.rows()
        if folder is not None:
            from pipeline.benchmarks.work_precision_picture import draw

            draw(race.title, race.source, race.points, folder / f"{name.replace(' ', '-')}.png")
            write(folder / "work-precision.csv", [row for each in races.values() for row in each.rows()])
    grown = list(growth.grown(quick=quick))
    if folder is not None:
        from pipeline.benchmarks.work_precision_picture import draw_growth

        draw_growth(grown, folder / "growth.png")
    points = {name: race.points for name, race in races.items()}
    bars = bars_integrators.judged(points)
    others = {
        "growth": [each.row() for each in grown],
        "honesty": [row for found in points.values() for row in estimated_errors.judged(found)],
        "bars": list(bars_integrators.not_judged(bars) if quick else bars),
    }
    for name, found in others.items():
        if folder is not None:
            write(folder / f"{name}.csv", found)
        yield from found


def finished(kept: Kept, *, quick: bool) -> Iterator[tuple[str, Race]]:
    """Every problem's race, and the ensemble's, by name; those that were kept at once."""
    for name, problem in problems(quick=quick).items():
        yield name, raced_before(kept, name, partial(raced, problem, quick=quick), quick=quick)
    name = ensemble_race.NAME
    yield name, raced_before(kept, name, lambda: Race(*ensemble_race.race(quick=quick)), quick=quick)


def raced(problem: Problem, *, quick: bool) -> Race:
    """Every method on a problem; compile times in full runs alone."""
    truth = reference(problem)
    points = sweep(problem, truth, quick=quick)
    return Race(problem.title, truth.source, points, {} if quick else compiled(problem, points))
