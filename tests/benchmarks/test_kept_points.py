"""What long suites keep of their points, so that an interrupted run goes on."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from pipeline.benchmarks.tables import kept, sources


def test_kept_points_are_found_by_what_they_are_and_by_what_made_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[float] = []

    def rows(noise: float, folder: Path | None = tmp_path) -> list[dict[str, float]]:
        return kept(folder, {"noise": noise}, lambda: made.append(noise) or [{"error_mgal": math.nan}])

    assert math.isnan(rows(1.0)[0]["error_mgal"])
    assert math.isnan(rows(1.0)[0]["error_mgal"])
    assert made == [1.0]
    rows(2.0)
    assert made == [1.0, 2.0]
    for path in (tmp_path / "points").iterdir():  # nothing half-written beside them
        path.write_text(path.read_text()[:-20])
    rows(1.0)
    monkeypatch.setattr("pipeline.benchmarks.tables.sources", lambda: "other code")
    rows(1.0)
    rows(1.0, None)
    assert made == [1.0, 2.0, 1.0, 1.0, 1.0]


def test_sources_are_those_that_compute() -> None:
    assert len(sources()) == 64
    assert sources() == sources.__wrapped__()
