"""Bars that are whole suites: table of residuals, the paper's claims, stability, what is left out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pipeline.benchmarks import corrections_cases, cost_of_terms, leave_out, paper, stability
from pipeline.benchmarks.bar import Row, at_most

SUITES: tuple[tuple[Any, Mapping[str, str]], ...] = (
    (corrections_cases, {"case": "table of residuals: cases whose pattern is not reproduced"}),
    (paper, {"claim": "paper: claims that are not reproduced"}),
    (
        stability,
        {
            "record": "stability: extreme records with a cell silently wrong or declined unlisted",
            "motion": "stability: extreme motions with a cell silently wrong, declined unlisted or beyond its bound",
        },
    ),
    (leave_out, {"method": "process: methods that import what they do not use"}),
    (cost_of_terms, {"terms": "simulate: scenes that load what belongs to terms they leave out"}),
)
"""Suite -> key of its rows that names a case, and what a case that fails means."""


def rows() -> Iterator[Row]:
    """Yield the number of rows that fail in each suite, and which they are."""
    for suite, bars in SUITES:
        found = list(suite.run(quick=True, folder=None))
        for key, bar in bars.items():
            failed = [str(row[key]) for row in found if key in row and row["pass"] is False]
            yield at_most(bar, float(len(failed)), 0.0, "; ".join(failed))
