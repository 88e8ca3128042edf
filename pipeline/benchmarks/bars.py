"""Suite `bars`: every promised figure as a row (bar, value, limit, pass), on scenes of the project's own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pipeline.benchmarks import (
    bars_accuracy,
    bars_integrators,
    bars_speed,
    bars_statistics,
    corrections,
    paper,
    stability,
)
from pipeline.benchmarks.bar import Row, at_most

SUITES: tuple[tuple[Any, Mapping[str, str]], ...] = (
    (corrections, {"case": "corrections: kinds of record whose pattern is not reproduced, or silently wrong"}),
    (paper, {"claim": "paper: claims that are not reproduced"}),
    (
        stability,
        {
            "record": "stability: extreme records with a cell silently wrong or declined unlisted",
            "motion": "stability: extreme motions with a cell silently wrong, declined unlisted or beyond its bound",
        },
    ),
)
"""Suite -> key of its rows that names a case, and what a case that fails means."""


def run(*, quick: bool, folder: Path | None) -> Iterator[Row]:
    """Yield every bar. Quick: fewer seeds, with limits as much wider as chance asks, and a shorter race."""
    yield from bars_accuracy.rows()
    yield from suites()
    yield from bars_statistics.rows(quick=quick)
    yield from bars_speed.rows(quick=quick)
    yield from bars_integrators.rows(quick=quick)


def suites() -> Iterator[Row]:
    """Yield the number of rows that fail in each suite, and which they are."""
    for suite, bars in SUITES:
        found = list(suite.run(quick=True, folder=None))
        for key, bar in bars.items():
            failed = [str(row[key]) for row in found if key in row and row.get("pass") is False]
            yield at_most(bar, float(len(failed)), 0.0, "; ".join(failed))
