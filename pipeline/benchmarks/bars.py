"""Suite `bars`: every promised figure as a row (bar, value, limit, pass), on scenes of the project's own."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from pipeline.benchmarks import (
    bars_accuracy,
    bars_integrators,
    bars_inversion,
    bars_joint,
    bars_speed,
    bars_statistics,
    bars_suites,
)
from pipeline.benchmarks.bar import Row


def run(*, quick: bool, folder: Path | None) -> Iterator[Row]:
    """Yield every bar. Quick: fewer seeds, with limits as much wider as chance asks, and a shorter race."""
    yield from bars_accuracy.rows()
    yield from bars_suites.rows()
    yield from bars_statistics.rows(quick=quick)
    yield from bars_inversion.rows(quick=quick)
    yield from bars_joint.rows(quick=quick)
    yield from bars_speed.rows(quick=quick)
    yield from bars_integrators.rows(quick=quick)
