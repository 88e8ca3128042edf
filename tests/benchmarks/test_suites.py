"""Each suite runs: small and uncompiled for its machinery, whole and compiled for its claims."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.benchmarks import (
    bars,
    bars_integrators,
    bars_inversion,
    bars_speed,
    bars_statistics,
    bars_suites,
    corrections_cases,
    leave_out,
    paper,
    probe,
    scenes,
    speed,
)
from pipeline.cli.benchmark import SUITES


@pytest.mark.parametrize("suite", SUITES)
def test_registered_suite_can_be_run(suite: str) -> None:
    assert callable(importlib.import_module(SUITES[suite][0]).run)


@pytest.fixture
def few(short: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """One swell, one seed where many are meant."""
    monkeypatch.setattr(corrections_cases, "SWELLS", (24,))
    monkeypatch.setattr(bars_statistics, "QUICK_EFFICIENCY", 1)
    monkeypatch.setattr(bars_statistics, "QUICK_COVERAGE", 4)
    monkeypatch.setattr(bars_statistics, "CLEAN", 4)
    monkeypatch.setattr(bars_inversion, "QUICK_EFFICIENCY", 1)
    monkeypatch.setattr(bars_inversion, "QUICK_COVERAGE", 4)
    monkeypatch.setattr(bars_inversion, "DAMPED", 1)


@pytest.mark.usefixtures("few")
def test_corrections_yields_cases_and_times(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("matplotlib")
    chosen = corrections_cases.cases()[1::3]
    monkeypatch.setattr(corrections_cases, "cases", lambda: chosen)
    monkeypatch.setattr(
        corrections_cases, "COLUMNS", ("uncorrected", "projection", corrections_cases.AVERAGED, "panteleev")
    )
    for case in chosen:
        case.right.clear()
        case.wrong.clear()
    chosen[1].right["projection"] = 0.0  # nothing is that right
    rows = list(corrections_cases.run(quick=True, folder=tmp_path))
    assert [row["unit"] for row in rows] == ["mGal", "mGal", "ms"]
    assert [row["pass"] for row in rows] == [True, False, None]
    assert (tmp_path / "corrections.png").read_bytes().startswith(b"\x89PNG")


def test_pattern_is_refused_where_a_wrong_method_is_right_or_a_right_one_declines() -> None:
    case = corrections_cases.Case("x", lambda seed: pytest.fail("not made"), {"projection": 1e-3}, {"uncorrected": 5.0})
    found = {"projection": 1e-4, "uncorrected": 9.0}
    assert corrections_cases.agrees(case, found, found)
    assert not corrections_cases.agrees(case, found, found | {"uncorrected": 1.0})
    assert not corrections_cases.agrees(case, found | {"projection": 1e-2}, found)
    assert not corrections_cases.agrees(case, found | {"general": np.nan}, found)


@pytest.mark.usefixtures("few")
def test_bars_of_accuracy_and_statistics_are_yielded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bars_suites, "rows", lambda: iter(()))
    monkeypatch.setattr(bars_speed, "rows", lambda *, quick: iter(()))
    monkeypatch.setattr(bars_integrators, "rows", lambda *, quick: iter(()))
    rows = list(bars.run(quick=True, folder=None))
    assert len({row["bar"] for row in rows}) == len(rows) > 25
    assert {tuple(row) for row in rows} == {("bar", "value", "limit", "unit", "pass")}


def test_bars_name_the_rows_of_a_suite_that_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    for suite, key in (
        (corrections_cases, "case"),
        (paper, "claim"),
        (bars_suites.stability, "record"),
        (leave_out, "method"),
        (bars_suites.cost_of_terms, "terms"),
    ):
        made: list[dict[str, Any]] = [
            {key: "bad", "pass": False},
            {key: "good", "pass": True},
            {key: "-", "pass": None},
        ]
        monkeypatch.setattr(suite, "run", lambda *, quick, folder, made=made: iter(made))
    rows = list(bars_suites.rows())
    found = [(row["value"], row["unit"], row["pass"]) for row in rows if "motions" not in row["bar"]]
    assert found == [(1.0, "bad", False)] * 5
    assert [row["value"] for row in rows if "motions" in row["bar"]] == [0.0]  # no row is one


def test_speed_compares_with_its_rivals(short: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(speed, "SIZES", (600,))
    rows = list(speed.estimation(quick=True))
    assert [row["what"].split(",")[0] for row in rows] == ["projection"] * 3
    assert rows[0]["error_mgal"] is not None
    assert all(row["ms"] > 0.0 for row in rows)


def test_bars_of_speed_take_the_rows_that_promise(monkeypatch: pytest.MonkeyPatch) -> None:
    row = {"what": "projection, 45000 samples", "rival": "hilbert", "share_of_rival": 0.3, "error_mgal": 1e-9}
    other = row | {"what": "prepare alone", "share_of_rival": 9.0, "error_mgal": None}
    started = [row | {"what": what, "share_of_rival": 2.7} for what in ("isochrony --help", "isochrony process")]
    monkeypatch.setattr(speed, "estimation", lambda *, quick: iter([row, other]))
    monkeypatch.setattr(speed, "start_up", lambda *, quick: iter(started))
    assert [each["pass"] for each in bars_speed.rows(quick=True)] == [True, True, True, False]


def test_commands_are_timed_from_start_to_exit(short: float, monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[tuple[str, ...]] = []
    monkeypatch.setattr(speed, "command", lambda *words: lambda: started.append(words))
    monkeypatch.setattr(speed, "SIZES", (600,))
    rows = list(speed.run(quick=True, folder=None))
    assert [row["what"].split(",")[0] for row in rows[-2:]] == ["isochrony --help", "isochrony process"]
    assert {words[1] for words in started} == {"-m", "-c"}


@pytest.mark.parametrize(
    "methods",
    [("projection",), pytest.param(leave_out.PAIR_METHODS, marks=pytest.mark.campaign)],
)
def test_process_leaves_out_what_it_does_not_use(methods: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(leave_out, "PAIR_METHODS", methods)
    rows = list(leave_out.run(quick=True, folder=None))
    assert all(row["pass"] for row in rows), rows
    loaded = {row["method"]: set(row["methods_loaded"].split()) for row in rows}
    assert loaded["projection"].isdisjoint({"panteleev", "general", "vening_meinesz", "complex_form"})


def test_probe_tells_stages_and_modules(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    import json

    import data_schemas
    from pipeline.benchmarks.scenes import linear
    from synth import simulate

    path = tmp_path / "x.record.nc"
    data_schemas.write(simulate(linear(duration=30.0, sampling_rate=10))[0], path)
    probe.main(str(path), "uncorrected")
    said = json.loads(capsys.readouterr().out)
    assert list(said["seconds"]) == ["import", "read", "process", "write"]


def test_paper_yields_every_claim_on_short_records_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scenes, "DURATION", 300.0)  # five marks
    rows = list(paper.run(quick=True, folder=None))
    assert len({row["claim"] for row in rows}) == len(rows) == 25
    assert all(row["pass"] for row in rows if "psi1-psi2 on film" in row["claim"])


@pytest.mark.compiled
def test_every_claim_of_the_paper_is_reproduced() -> None:
    rows = list(paper.run(quick=True, folder=None))
    assert [row["claim"] for row in rows if not row["pass"]] == []


@pytest.mark.compiled
def test_table_of_residuals_has_its_pattern() -> None:
    rows = list(corrections_cases.run(quick=True, folder=None))
    assert [row["case"] for row in rows if row["pass"] is False] == []
