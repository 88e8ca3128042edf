"""Each suite runs: small and uncompiled for its machinery, whole and compiled for its claims."""

from __future__ import annotations

import importlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.benchmarks import bars, paper, scenes
from pipeline.benchmarks.tables import RATIO
from pipeline.cli.benchmark import SUITES, module_of


@pytest.mark.parametrize("suite", SUITES)
def test_registered_suite_can_be_run(suite: str) -> None:
    assert callable(importlib.import_module(module_of(suite)).run)


@pytest.mark.usefixtures("short")
def test_bars_of_accuracy_are_yielded() -> None:
    rows = list(bars.accuracy())
    assert len({row["bar"] for row in rows}) == len(rows) == 4
    assert {tuple(row) for row in rows} == {("bar", "value", "limit", "unit", "pass")}


@pytest.mark.compiled
def test_bars_of_speed_are_yielded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bars, "DURATION", 30.0)
    short = replace(bars.BASE, duration=120.0, rate=10.0, swell=(0.015, 0.0), states_heave=False)
    monkeypatch.setattr(bars, "FITS", {"short": (short, 1e6, 0.0, 1e6)})
    asked: list[tuple[str, ...]] = []

    def command(*words: str) -> Any:
        return lambda: (asked.append(words), '["numpy", "scipy.signal._waveforms", "numba"]')[1]

    monkeypatch.setattr(bars, "command", command)
    monkeypatch.setattr(bars, "rounds", lambda calls, *_, **__: {name: [1.0, 2.0, 3.0] for name in calls})
    rows = {row["bar"]: row for row in bars.costs(quick=True)}
    assert len(rows) == 14
    ratios = [row for row in rows.values() if row["unit"].startswith(RATIO)]
    assert [(row["value"], row["unit"]) for row in ratios] == [(1.0, "times, 1 to 1")] * 8
    assert [row["pass"] for row in ratios] == [True, True, None, None, True, False, True, False]
    assert [row["unit"] for bar, row in rows.items() if "imports" in bar] == ["scipy.signal", "numba scipy"]
    assert [row["value"] for bar, row in rows.items() if "read, reduced, written" in bar] == [2000.0] * 2
    assert {words[1] for words in asked} == {"-c"}


@pytest.mark.compiled
@pytest.mark.usefixtures("short")
def test_scatter_is_compared_with_the_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bars, "RATES", (10,))
    found = []
    for bound in (0.05, 0.1):
        monkeypatch.setattr(bars, "BOUNDS", {"linear": (bound,), "real": (2.0 * bound,)})
        rows = list(bars.efficiency(2))
        assert ["linear" in row["bar"] for row in rows] == [True, False]
        found.append([row["value"] for row in rows])
    assert np.all(np.isfinite(found))
    assert found[0] == pytest.approx(2.0 * np.array(found[1]))


@pytest.mark.parametrize(
    "methods",
    [("projection",), pytest.param(bars.PAIR_METHODS, marks=pytest.mark.campaign)],
)
def test_process_leaves_out_what_it_does_not_use(methods: tuple[str, ...], tmp_path: Path) -> None:
    import data_schemas
    from synth import simulate

    path = tmp_path / "x.record.nc"
    data_schemas.write(simulate(scenes.linear(duration=30.0, noise=1e-5))[0], path)
    loaded = bars.modules(bars._PROCESS, str(path), ",".join(methods))
    assert bars.in_vain(loaded, bars.FORBIDDEN) == []
    if methods == ("projection",):
        others = ("general", "vening_meinesz")
        assert loaded.isdisjoint(f"pipeline.methods.{name}" for name in others)


def test_a_linear_scene_leaves_out_what_belongs_to_other_terms() -> None:
    loaded = bars.modules(bars._SIMULATE, scenes.linear(duration=10.0).model_dump_json())
    assert bars.in_vain(loaded, bars.OF_OTHER_TERMS) == []


def test_paper_yields_every_claim_on_short_records_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scenes, "DURATION", 300.0)  # five marks
    rows = list(paper.run(quick=True, folder=None))
    assert len({row["claim"] for row in rows}) == len(rows) == 25
    assert all(row["pass"] for row in rows if "psi1-psi2 on film" in row["claim"])


@pytest.mark.compiled
def test_every_claim_of_the_paper_is_reproduced() -> None:
    rows = list(paper.run(quick=True, folder=None))
    assert [row["claim"] for row in rows if not row["pass"]] == []
