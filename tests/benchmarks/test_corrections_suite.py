"""The suite `corrections`: what its records are, how they are judged, kept, tabled and drawn."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from data_schemas.errors import RecordError
from data_schemas.scene import Scene
from pipeline.benchmarks import corrections, scenes
from pipeline.benchmarks.corrections import METHODS, REAL, SWELLS, Kind, kinds
from pipeline.benchmarks.records import Made, record


@pytest.mark.parametrize("quick", [True, False])
def test_every_kind_has_a_name_of_its_own(quick: bool) -> None:
    every = kinds(quick=quick)
    assert len({kind.name for kind in every}) == len(every)
    assert {kind.name for kind in every if kind.real} == set(REAL)


def test_real_records_are_those_of_the_suite_honesty() -> None:
    """Shorter when quick; another seed is another record."""
    short, other = (record("swell", "middle", seed, duration=30.0) for seed in (24, 25))
    assert float(short.tree["time"][-1]) == pytest.approx(30.0, abs=0.2)
    assert short.gravity != other.gravity


def row(method: str, error: float = 0.0, sigma: float = 0.1, **changes: Any) -> dict[str, Any]:
    found = {"case": "x", "method": method, "error_mgal": error, "sigma_mgal": sigma, "ms": 3.0}
    return {**found, "flags": "", "refused": "", **changes}


def declined(method: str, **changes: Any) -> dict[str, Any]:
    return row(method, math.nan, math.nan, ms=math.nan, refused="too short; record longer", **changes)


@pytest.mark.parametrize(
    ("found", "wrong"),
    [
        (row("shooting", 0.4), False),
        (row("shooting", 0.6), True),
        (row("shooting", -0.6), True),
        (row("shooting", 0.6, flags="arc"), True),  # a flag excuses no error
        (row("shooting", 4e-3, 0.0), False),
        (row("shooting", 6e-3, 0.0), True),
        (row("general", 0.09, 0.0), False),
        (row("joint", 0.6), True),
        (row("shooting", math.nan), True),
        (declined("shooting"), False),
    ],
)
def test_silently_wrong(found: dict[str, Any], wrong: bool) -> None:
    assert corrections.silently_wrong(found) == wrong


def made(**changes: Any) -> Kind:
    return Kind("x", lambda seed: pytest.fail("not made"), **changes)


def test_only_methods_for_real_pendulums_are_judged() -> None:
    judged = corrections.judged(made(real=True), [row(name, 100.0) for name in METHODS], [])
    assert judged["silently_wrong"] == "general shooting joint"
    assert judged["pass"] is False
    assert corrections.judged(made(real=True), [row(name, 0.01, 1.0) for name in METHODS], [])["pass"] is True
    assert corrections.judged(made(real=True), [row("joint", 100.0), row("general", 0.01, 1.0)], [])["pass"] is False


def test_pattern_is_refused_where_a_wrong_method_is_right_or_a_right_one_declines() -> None:
    kind = made(right={"projection": 1e-3}, wrong={"uncorrected": 5.0})
    good, wrong = row("projection", 1e-4), row("uncorrected", 9.0)

    def holds(*rows: dict[str, Any], others: tuple[dict[str, Any], ...] = ()) -> bool:
        return bool(corrections.judged(kind, rows, list(others))["pass"])

    assert holds(good, wrong)
    assert not holds(good, wrong, others=(row("uncorrected", 0.1),) * 5)  # judged by the r.m.s. over all swells
    assert not holds(row("projection", 1e-2), wrong)
    assert not holds(good, wrong, declined("general"))


def test_summary_counts_refusals() -> None:
    points = [row("general", -2.0, ms=5.0), row("general", 1.0, ms=9.0, flags="x"), declined("general")]
    found = {each["method"]: each for each in corrections.summary(points)}
    assert found["general"] == {
        "method": "general", "median_ms": 7.0, "median_error_mgal": 1.5, "worst_error_mgal": 2.0, "flagged": 1,
        "declined": 1, "records": 3,
    }  # fmt: skip
    assert math.isnan(found["shooting"]["median_ms"])


def of(scene: Scene) -> Callable[[int], Made]:
    return lambda seed: scenes.made(scene)


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Three kinds of a minute's length, reduced by nobody; the methods that were asked for."""
    asked: list[str] = []

    def timed(record: Made, name: str) -> dict[str, Any]:
        asked.append(name)
        answer = declined(name) if name == "general" else row(name, 1e-3)
        return {key: value for key, value in answer.items() if key != "case"}

    chosen = [
        Kind("linear", of(scenes.linear(duration=20.0, sampling_rate=5)), refused=("general",)),
        Kind("real", of(scenes.real(duration=20.0, sampling_rate=5)), real=True),
    ]
    monkeypatch.setattr(corrections, "kinds", lambda *, quick: chosen)
    monkeypatch.setattr(corrections, "_timed", timed)
    return asked


def test_an_interrupted_run_goes_on_where_it_stopped(few: list[str], tmp_path: Path) -> None:
    rows = corrections.run(quick=True, folder=tmp_path)
    assert next(rows)["case"] == "linear"
    rows.close()
    assert len(few) == len(METHODS)
    assert [each["case"] for each in corrections.run(quick=True, folder=tmp_path) if "pass" in each] == [
        "linear",
        "real",
    ]
    assert len(few) == 2 * len(METHODS)
    list(corrections.run(quick=True, folder=tmp_path))
    assert len(few) == 2 * len(METHODS)


def test_wrong_methods_are_asked_in_every_swell(few: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    kind = Kind("linear", of(scenes.linear(duration=20.0, sampling_rate=5)), wrong={"complex": 1.0})
    monkeypatch.setattr(corrections, "kinds", lambda *, quick: [kind])
    (found,) = [each for each in corrections.run(quick=True, folder=None) if "pass" in each]
    assert few.count("complex") == len(SWELLS)
    assert found["pass"] is False


def test_the_suite_yields_its_tables_and_writes_them(few: list[str], tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    rows = list(corrections.run(quick=True, folder=tmp_path))
    judged = [each for each in rows if "silently_wrong" in each]
    assert all(each["pass"] for each in judged)
    assert sum("refused" in each for each in rows) == len(judged)  # `general` declines each
    assert sum("median_ms" in each for each in rows) == len(METHODS)
    with (tmp_path / "corrections-points.csv").open(newline="") as stream:
        table = list(csv.DictReader(stream))
    assert len(table) == len(judged) * len(METHODS)
    assert {each["refused"] for each in table if each["method"] == "general"} == {"too short; record longer"}
    assert [path.name for path in tmp_path.glob("*.png")] == ["corrections.png"]


@pytest.mark.usefixtures("few")
def test_without_a_folder_the_suite_writes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert list(corrections.run(quick=True, folder=None))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("few")
def test_without_matplotlib_the_tables_are_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    list(corrections.run(quick=True, folder=tmp_path))
    assert not list(tmp_path.glob("*.png"))
    assert (tmp_path / "corrections-points.csv").exists()


def test_a_record_that_is_declined_as_a_whole_is_declined_by_each(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: Any, **__: Any) -> Any:
        raise RecordError("no difference")

    monkeypatch.setattr(corrections, "_compile", lambda name: None)
    monkeypatch.setattr("pipeline.processing.process", refuse)
    kind = Kind("x", of(scenes.linear(duration=10.0, sampling_rate=5)))
    rows = corrections.measured(kind, 1, METHODS, None)
    assert [(each["method"], each["refused"]) for each in rows] == [(name, "no difference") for name in METHODS]


def test_methods_that_decline_are_rows_beside_those_that_do_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(corrections, "_compile", lambda name: None)
    equal = (0.01, 0.01)
    beats = scenes.two_pendulums("beats", 1e-3, duration=600.0, sampling_rate=10, motion=[], amplitudes=equal)
    found = corrections.measured(Kind("x", of(beats)), 1, ("panteleev", "projection"), None)
    rows = {each["method"]: each for each in found}
    assert "a phase means nothing" in rows["panteleev"]["refused"]
    assert rows["projection"]["refused"] == ""
    assert abs(rows["projection"]["error_mgal"]) < 0.01  # exact; its quadrature leaves less
    assert rows["projection"]["ms"] > 0.0


@pytest.mark.compiled
def test_real_pendulums_are_solved_by_exact_methods() -> None:
    """The bars with recorded heave; the paper's formulas leave arcs and acceleration in."""
    kind = Kind("x", of(scenes.real_heave(duration=600.0)), real=True)
    errors = {each["method"]: abs(each["error_mgal"]) for each in corrections.measured(kind, 1, METHODS, None)}
    assert max(errors["shooting"], errors["joint"]) < 0.005
    assert min(errors[name] for name in ("panteleev", "complex", "projection")) > 3.0


@pytest.mark.compiled
def test_linear_records_have_their_pattern(monkeypatch: pytest.MonkeyPatch) -> None:
    linear = [kind for kind in kinds(quick=True) if not kind.real]
    monkeypatch.setattr(corrections, "kinds", lambda *, quick: linear)
    rows = [each for each in corrections.run(quick=True, folder=None) if "pass" in each]
    assert [each["case"] for each in rows if not each["pass"]] == []
    assert np.isfinite([each["projection"] for each in rows]).all()


@pytest.mark.campaign
def test_no_kind_of_record_is_silently_wrong() -> None:
    rows = list(corrections.run(quick=True, folder=None))
    assert [each for each in rows if each.get("pass") is False] == []
