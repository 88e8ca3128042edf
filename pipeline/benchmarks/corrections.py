"""Suite `corrections`: what every method leaves, on every kind of record, and what it costs.

First the table of residuals on linear pendulums, whose pattern is known. Then real pendulums: one factor at a time
about a nominal record, a map over period difference and psi/a, and one record on which everything acts, corrected entry
by entry. With a folder: tables (CSV), everything (JSON), pictures (PNG), and the finished points, so that a run that
was interrupted goes on where it stopped.
"""

from __future__ import annotations

import importlib.util
import math
import statistics
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from pipeline.benchmarks import corrections_cases, corrections_grid, corrections_ledger, json_table
from pipeline.benchmarks.corrections_points import FULL_LENGTH, QUICK_LENGTH, places
from pipeline.benchmarks.csv_table import write
from pipeline.benchmarks.kept import Kept
from pipeline.methods import PAIR_METHODS

Row = dict[str, Any]
HONEST = ("general", "shooting")
"""Methods that reduce what acts on real pendulums: their sigma must hold, or a flag must say why not."""
SIGMAS = 5.0
PROMISED = {"general": 0.1, "shooting": 0.005}
"""What is promised of a method on real pendulums without noise, mGal, which no sigma speaks of; others: `FLOOR`."""
FLOOR = 1e-3


def run(*, quick: bool, folder: Path | None) -> Iterator[Row]:
    """Yield the table of residuals, a row for each record of the grids (errors in mGal), a row for each refusal, a row
    for each method (run times and errors over all records), and the ledger's entries in turn.

    A record's row passes if no method that should hold on it is silently wrong. Quick: fewer and shorter records.
    """
    cases = []
    for row in corrections_cases.run(quick=quick, folder=folder):
        cases.append(row)
        yield row
    chosen = list(places(quick=quick))
    points: list[Row] = []
    for rows in corrections_grid.measured(chosen, Kept(folder), quick=quick):
        points += rows
        yield judged(rows)
    yield from refusals(points)
    yield from summary(points)
    ledger = corrections_ledger.measured(QUICK_LENGTH if quick else FULL_LENGTH)
    yield from ledger
    if folder is not None:
        write(folder / "corrections.csv", points)
        write(folder / "corrections-ledger.csv", ledger)
        tables = {"quick": quick, "cases": cases, "points": points, "methods": summary(points), "ledger": ledger}
        json_table.write(folder / "corrections.json", tables)
        if importlib.util.find_spec("matplotlib") is not None:
            _draw(points, ledger, folder)


def judged(rows: Sequence[Row]) -> Row:
    """One record: the error of each method, those that are wrong and say nothing, whether it passes."""
    silent = [row["method"] for row in rows if row["method"] in HONEST and silently_wrong(row)]
    return {
        "factor": rows[0]["factor"],
        "value": rows[0]["value"],
        "unit": rows[0]["unit"],
        **{row["method"]: row["error_mgal"] for row in rows},
        "silently_wrong": " ".join(silent),
        "pass": not silent,
    }


def silently_wrong(row: Row) -> bool:
    """Whether a value lies beyond five of its sigmas and what is promised, and carries no flag; refusals are right."""
    if row["refused"] or row["flags"]:
        return False
    return not abs(row["error_mgal"]) <= SIGMAS * row["sigma_mgal"] + PROMISED.get(row["used"], FLOOR)


def refusals(points: Sequence[Row]) -> list[Row]:
    """One row for each method and record that it declined, with the reason."""
    return [{key: row[key] for key in ("factor", "value", "method", "refused")} for row in points if row["refused"]]


def summary(points: Sequence[Row]) -> list[Row]:
    """One row a method over all records of the grids."""
    table = []
    for name in PAIR_METHODS:
        rows = [row for row in points if row["method"] == name]
        errors = [abs(row["error_mgal"]) for row in rows if not row["refused"]]
        table.append(
            {
                "method": name,
                "median_ms": _median([row["ms"] for row in rows if not row["refused"]]),
                "median_error_mgal": _median(errors),
                "worst_error_mgal": max(errors, default=math.nan),
                "flagged": sum(bool(row["flags"]) for row in rows),
                "declined": sum(bool(row["refused"]) for row in rows),
                "records": len(rows),
            }
        )
    return table


def _median(values: Sequence[float]) -> float:
    return statistics.median(values) if values else math.nan


def _draw(points: Sequence[Row], ledger: Sequence[Row], folder: Path) -> None:
    from pipeline.benchmarks import corrections_maps, corrections_sweeps, corrections_waterfall

    corrections_sweeps.draw(points, folder / "corrections-sweeps.png")
    corrections_sweeps.draw_cost(points, folder / "corrections-cost.png")
    corrections_maps.draw(points, folder / "corrections-maps.png")
    corrections_waterfall.draw(ledger, folder / "corrections-waterfall.png")
