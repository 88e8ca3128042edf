"""What long suites keep of their points, so that an interrupted run goes on."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from pipeline.benchmarks.tables import Kept, sources


def test_kept_points_are_found_by_what_they_are_and_by_what_made_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = [{"method": "general", "error_mgal": math.nan}]
    Kept(tmp_path).put({"noise": 1.0}, made)
    found = Kept(tmp_path).get({"noise": 1.0})
    assert found is not None
    assert math.isnan(found[0]["error_mgal"])
    assert Kept(tmp_path).get({"noise": 2.0}) is None
    (path,) = (tmp_path / "points").iterdir()  # nothing half-written beside it
    monkeypatch.setattr("pipeline.benchmarks.tables.sources", lambda: "other code")
    assert Kept(tmp_path).get({"noise": 1.0}) is None
    monkeypatch.undo()
    path.write_text(path.read_text()[:-20])
    assert Kept(tmp_path).get({"noise": 1.0}) is None


def test_without_a_folder_points_last_as_long_as_the_run() -> None:
    kept = Kept(None)
    kept.put({"noise": 1.0}, [{"method": "general"}])
    assert kept.get({"noise": 1.0}) == [{"method": "general"}]
    assert kept.get({"noise": 2.0}) is None
    assert Kept(None).get({"noise": 1.0}) is None


def test_sources_are_those_that_compute() -> None:
    assert len(sources()) == 64
    assert sources() == sources.__wrapped__()
