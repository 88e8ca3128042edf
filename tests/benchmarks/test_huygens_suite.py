"""Suite huygens: every way tells the same regime, maps resume, the claims hold, pictures are drawn."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.benchmarks import huygens, huygens_claims, huygens_map
from pipeline.benchmarks.kept import Kept
from synth.huygens.clocks import Clocks


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(huygens_map, "QUICK", 5)
    monkeypatch.setattr(huygens_map, "BASIN_SWINGS", 1500)


@pytest.mark.compiled
def test_the_suite_says_what_holds(small: None, tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = list(huygens.run(quick=True, folder=tmp_path))
    told = {row["claim"]: row for row in rows if "claim" in row}
    assert all(row["pass"] is not False for row in told.values())
    assert told["k as printed, without 1/(2 delta), is not: it errs by"]["value"] == pytest.approx(0.09, abs=0.05)
    curves = [row for row in rows if "way" in row]
    for alpha in (-0.35, -0.9):
        near = [row for row in curves if abs(row["alpha"] - alpha) < 0.01]
        assert len(near) == 5
        assert np.ptp([row["beta"] for row in near]) < 1e-6
    names = {path.name for path in tmp_path.iterdir()}
    assert names >= {
        "huygens.json",
        "huygens-curves.csv",
        "huygens-edges.csv",
        "huygens-figure-2.png",
        "huygens-maps.png",
    }

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("computed again")

    monkeypatch.setattr(huygens_map, "integrate_ensemble", refuse)
    kept = Kept(tmp_path)
    assert len(huygens_map.lock_map(5, kept)[2]) == 5
    assert len(huygens_map.basins(5, kept)[2]) == 5


def test_the_edge_is_read_off_a_row() -> None:
    chis = np.array([0.1, 0.2, 0.3, 0.4])
    assert huygens_map.measured_edge(chis, {"locked": [1, 1, 0, 0]}) == pytest.approx(0.25)
    assert huygens_map.measured_edge(chis, {"locked": [0, 0, 0, 0]}) == pytest.approx(0.05)
    assert huygens_map.measured_edge(chis, {"locked": [1, 1, 1, 1]}) == math.inf
    assert huygens_map.balance_edge(0.0) == pytest.approx(huygens_map.theory_edge(0.0), rel=0.08)


def test_where_starts_end() -> None:
    late = np.zeros(201)
    places = (0.0, math.pi, -0.5 * math.pi + 4.0 * math.pi, 0.8)
    assert [huygens_map._end(late + place) for place in places] == [0, 1, 2, 3]
    assert huygens_map._end(np.linspace(0.0, 50.0, 201)) == 3


def test_the_basins_are_of_clocks_with_both() -> None:
    from synth.huygens.balance import solutions
    from synth.huygens.slow_flow import stability

    held = [abs(each.offset) > 1.0 for each in solutions(huygens_map.BASIN, shifts=True)
            if stability(each, huygens_map.BASIN).stable]  # fmt: skip
    assert sorted(held) == [False, True]
    assert isinstance(huygens_map.BASIN, Clocks)
    assert huygens_claims.EDGE == 0.08
