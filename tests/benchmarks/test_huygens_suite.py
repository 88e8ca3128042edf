"""Suite huygens: every way gives the same regime, the map resumes, the claims hold, pictures are drawn."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.benchmarks import huygens


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(huygens, "QUICK", 5)


@pytest.mark.compiled
def test_the_suite_says_what_holds(small: None, tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = list(huygens.run(quick=True, folder=tmp_path))
    told = {row["claim"]: row for row in rows if "claim" in row}
    assert all(row["pass"] is not False for row in told.values())
    assert told["k as printed, without 1/(2 delta), is not: it errs by"]["value"] == pytest.approx(0.09, abs=0.05)
    curves = [row for row in rows if "way" in row]
    for alpha in (-0.35, -0.9):
        near = [row for row in curves if abs(row["alpha"] - alpha) < 0.01]
        assert len(near) == 4
        assert np.ptp([row["beta"] for row in near]) < 1e-6
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"huygens-figure-2.png", "huygens-map.png", "points"}

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("computed again")

    monkeypatch.setattr(huygens, "integrate_ensemble", refuse)
    assert len(huygens.lock_map(5, tmp_path)[2]) == 5


def test_the_edge_is_read_off_a_row() -> None:
    chis = np.array([0.1, 0.2, 0.3, 0.4])
    assert huygens.measured_edge(chis, {"locked": [1, 1, 0, 0]}) == pytest.approx(0.25)
    assert huygens.measured_edge(chis, {"locked": [0, 0, 0, 0]}) == pytest.approx(0.05)
    assert huygens.measured_edge(chis, {"locked": [1, 1, 1, 1]}) == math.inf
    (row,) = huygens.edges(chis, np.array([0.0]), [{"locked": [1, 1, 0, 0], "cpu_s": 1.0}])
    assert row["edge_by_balance"] == pytest.approx(row["edge_by_theory"], rel=0.08)
