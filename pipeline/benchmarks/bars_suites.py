"""Bars that are whole suites: the pattern of the table of residuals, the paper's claims, stability, imports."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pipeline.benchmarks import corrections, leave_out, paper, stability
from pipeline.benchmarks.bar import Row, at_most


def rows() -> Iterator[Row]:
    """Yield the number of rows that fail in each suite, and which they are."""
    suites: tuple[tuple[str, Any, str], ...] = (
        ("table of residuals: cases whose pattern is not reproduced", corrections, "case"),
        ("paper: claims that are not reproduced", paper, "claim"),
        ("stability: extreme records with a cell silently wrong or declined unlisted", stability, "record"),
        ("process: methods that import what they do not use", leave_out, "method"),
    )
    for bar, suite, key in suites:
        failed = [str(row[key]) for row in suite.run(quick=True, folder=None) if row["pass"] is False]
        yield at_most(bar, float(len(failed)), 0.0, "; ".join(failed))
