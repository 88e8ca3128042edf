"""Suite `bars`: promised accuracy, statistics and cost as rows (bar, value, limit, pass).

What whole suites promise is in their own rows: `corrections`, `paper`, `stability`, `integrators`, `film`, `batch`.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from pipeline.benchmarks import bars_accuracy, bars_joint, bars_speed
from pipeline.benchmarks.bar import Row


def run(*, quick: bool, folder: Path | None) -> Iterator[Row]:
    """Yield every bar. Quick: fewer seeds, with limits as much wider as chance asks."""
    yield from bars_accuracy.rows()
    yield from bars_joint.rows(quick=quick)
    yield from bars_speed.rows(quick=quick)
