"""validate, schema, import, simulate and plot on good input."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest
from made_trees import made_period_result
from test_bad_input import GOOD_SCENE

import data_schemas
from pipeline.cli import benchmark


def test_validate_says_good_and_counts_what_is_not(run, tmp_path, record_path, result_path):
    assert run("validate", record_path, result_path) == (0, f"{record_path}: good\n{result_path}: good\n", "")
    outcome = run("validate", record_path, tmp_path / "none.nc")
    assert outcome.status == 1
    assert f"{record_path}: good\n" in outcome.out
    assert "none.nc: " in outcome.out


def test_validate_names_every_fault_of_a_file_at_once(run, tmp_path, record_path):
    record = data_schemas.read(record_path)
    record["instrument"]["period"].values[:] = -1.0
    record["instrument"]["reference_gravity"].values[...] = np.inf
    path = tmp_path / "two.record.nc"
    data_schemas.write(record, path)
    outcome = run("validate", path)
    assert outcome.status == 3
    assert len(outcome.out.splitlines()) == 2
    assert "instrument/period" in outcome.out
    assert "instrument/reference_gravity" in outcome.out


def test_join_puts_parts_together(run, tmp_path, record_path):
    record = data_schemas.read(record_path)
    half, out = record.sizes["time"] // 2, tmp_path / "whole.record.nc"
    parts = [tmp_path / f"{k}.record.nc" for k in range(2)]
    for path, part in zip(parts, (slice(0, half), slice(half, None)), strict=True):
        data_schemas.write(record.isel(time=part), path)
    outcome = run("join", parts[1], parts[0], "-o", out)
    assert outcome.status == 0, outcome.err
    assert outcome.out.startswith(f"{out}: 2 parts, {record.sizes['time']} samples over ")
    whole = data_schemas.read(out)
    np.testing.assert_array_equal(whole["record"]["elongation"].values, record["record"]["elongation"].values)
    assert "exists already; add --force" in run("join", *parts, "-o", out).fault
    twice = run("join", parts[0], parts[0], "-o", tmp_path / "twice.record.nc")
    assert twice.status == 3
    assert "say when each began" in twice.fault


@pytest.mark.parametrize("name", ["scene", "record", "truth", "result"])
def test_schema_prints_json_schema(run, name):
    outcome = run("schema", name)
    assert outcome.status == 0
    assert json.loads(outcome.out) == data_schemas.json_schema(name)


def test_import_writes_a_good_record_beside_the_table(run, tmp_path):
    table = tmp_path / "swing.csv"
    table.write_text("time, angle\n0.5, 1\n0.6, 2\n")
    path = tmp_path / "swing.record.nc"
    assert run("import", table) == (0, f"{path}: 2 samples of 1 over 0.1 s\n", "")
    assert data_schemas.validate(path) == []
    again = run("import", table)
    assert again.status == 2
    assert "swing.record.nc: exists already; add --force" in again.fault
    assert run("import", table, "--force").status == 0


def test_import_takes_every_option(run, tmp_path):
    table = tmp_path / "film.csv"
    table.write_text("clock;left;right\n10;2;1\n10,5;4;3\n")
    outcome = run(
        "import", table, "--time", "clock", "--column", "left:1", "--column", "right:d", "--unit", "mm",
        "--lever", 2000, "--period", "1=1.0099", "--period", "2=1.01", "--gravity", 9.81,
        "--combination", "d=1-2", "-o", f"{tmp_path}/out/",
    )  # fmt: skip
    assert outcome.status == 0, outcome.err
    record = data_schemas.read(tmp_path / "out" / "film.record.nc")
    assert record["time"].values.tolist() == [0.0, 0.5]
    assert record["record"]["elongation"].values.tolist() == [[0.001, 0.002], [0.0005, 0.0015]]
    assert record["record"]["combination"].values.tolist() == [[1, 0], [1, -1]]
    assert record["instrument"]["period"].values.tolist() == [1.0099, 1.01]


def test_import_takes_a_plain_period_for_a_single_pendulum(run, tmp_path):
    table = tmp_path / "swing.csv"
    table.write_text("0 1\n1 2\n")
    assert run("import", table, "--period", "1.029").status == 0
    assert data_schemas.read(tmp_path / "swing.record.nc")["instrument"]["period"].values.tolist() == [1.029]


def test_simulate_writes_record_and_truth_with_one_line_each(run, tmp_path):
    scene = tmp_path / "small.toml"
    scene.write_text(GOOD_SCENE)
    outcome = run("simulate", scene)
    assert outcome.status == 0, outcome.err
    lines = outcome.out.splitlines()
    assert [line.partition(": ")[0] for line in lines] == [
        f"{tmp_path}/small.record.nc",
        f"{tmp_path}/small.truth.nc",
    ]
    assert "gravity 9.81000000 m/s2" in lines[1]
    assert data_schemas.validate(tmp_path / "small.record.nc") == []
    assert data_schemas.validate(tmp_path / "small.truth.nc") == []


def test_simulate_knows_the_shipped_scenes_by_name(run, tmp_path, monkeypatch):
    scene = tmp_path / "package" / "demo.toml"
    scene.parent.mkdir()
    scene.write_text(GOOD_SCENE)
    monkeypatch.setattr("synth.scene_path", lambda name: scene)
    monkeypatch.chdir(tmp_path)
    assert run("simulate", "demo").status == 0
    # beside the user, not inside the package
    assert sorted(path.name for path in tmp_path.iterdir()) == ["demo.record.nc", "demo.truth.nc", "package"]
    assert [path.name for path in scene.parent.iterdir()] == ["demo.toml"]


def test_simulate_refuses_to_overwrite_either_file_before_it_works(run, tmp_path):
    scene = tmp_path / "small.toml"
    scene.write_text(GOOD_SCENE)
    (tmp_path / "small.truth.nc").write_text("precious")
    outcome = run("simulate", scene)
    assert outcome.status == 2
    assert "small.truth.nc: exists already" in outcome.fault
    assert not (tmp_path / "small.record.nc").exists()


def test_simulate_repeats_itself_with_a_seed_and_differs_with_another(run, tmp_path):
    scene = tmp_path / "small.toml"
    scene.write_text(GOOD_SCENE + "[recording]\nnoise = 1e-4\n")
    readings = {}
    for name, seed in (("a", 5), ("b", 5), ("c", 6)):
        assert run("simulate", scene, "--seed", seed, "-o", tmp_path / f"{name}.record.nc").status == 0
        readings[name] = data_schemas.read(tmp_path / f"{name}.record.nc")["record"]["elongation"].values
    np.testing.assert_array_equal(readings["a"], readings["b"])
    assert np.abs(readings["a"] - readings["c"]).max() > 1e-5


def test_plot_draws_a_record_a_result_and_a_period(run, tmp_path, record_path, result_path):
    period = tmp_path / "one.result.nc"
    data_schemas.write(made_period_result(), period)
    for path, name in (
        (record_path, "ship.record.png"),
        (result_path, "ship.result.png"),
        (period, "one.result.png"),
    ):
        outcome = run("plot", path)
        assert outcome == (0, f"{tmp_path / name}\n", "")
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")
    assert run("plot", result_path).status == 2  # exists
    assert run("plot", result_path, "--force").status == 0


def test_plot_refuses_what_it_cannot_do(run, tmp_path, record_path, monkeypatch):
    assert "PNG" in run("plot", record_path, "-o", tmp_path / "a.svg").fault
    assert "--truth goes with a result" in run("plot", record_path, "--truth", record_path).fault
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert "pip install 'isochrony[plot]'" in run("plot", record_path).fault


def test_plot_takes_the_gravity_of_a_truth(run, tmp_path, result_path):
    scene = tmp_path / "small.toml"
    scene.write_text(GOOD_SCENE)
    run("simulate", scene)
    outcome = run("plot", result_path, "--truth", tmp_path / "small.truth.nc")
    assert outcome.status == 0, outcome.err
    wrong = run("plot", result_path, "--truth", result_path, "--force")
    assert wrong.status == 3
    assert "isochrony-truth" in wrong.fault


class Suite:
    @staticmethod
    def run(*, quick, folder):
        yield {"bar": "one", "value": 0.5, "pass": True}
        yield {"bar": "two", "value": float("nan"), "pass": quick}
        yield {"claim": "three", "value": 1.0}


@pytest.fixture
def suite(monkeypatch):
    monkeypatch.setattr(benchmark, "importlib", SimpleNamespace(import_module=lambda name: Suite))


@pytest.mark.usefixtures("suite")
def test_benchmark_prints_a_table_or_json_and_judges(run, tmp_path):
    outcome = run("benchmark", "bars", "--quick", "-o", tmp_path / "kept")
    assert outcome.status == 0
    assert outcome.out.splitlines()[:3] == ["bar  value  pass", "one    0.5  yes", "two      -  yes"]
    assert outcome.out.splitlines()[3:] == ["", "claim  value", "three      1"]
    assert (tmp_path / "kept" / "bars.csv").read_text().splitlines() == [
        "bar,value,pass",
        "one,0.5,True",
        "two,nan,True",
    ]
    assert (tmp_path / "kept" / "bars-claim.csv").read_text().splitlines() == ["claim,value", "three,1.0"]
    outcome = run("benchmark", "bars", "--json")
    assert outcome.status == 1
    assert [json.loads(line)["value"] for line in outcome.out.splitlines()] == [0.5, None, 1.0]


@pytest.mark.usefixtures("suite")
def test_ratios_of_times_are_appended_to_a_history_and_drawn(run, tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    for value in (2.0, 0.5):
        row = {"bar": "one", "value": value, "limit": "<= 1", "unit": "times, 1 to 2", "pass": None}
        monkeypatch.setattr(Suite, "run", staticmethod(lambda *, row=row, **_: iter([row])))
        assert run("benchmark", "bars", "-o", tmp_path / "kept").status == 0
    lines = [json.loads(line) for line in (tmp_path / "kept" / "history.jsonl").read_text().splitlines()]
    assert [line["value"] for line in lines] == [2.0, 0.5]
    assert {"date", "machine", "versions", "suite", "quick", "bar", "limit"} < lines[0].keys()
    assert (tmp_path / "kept" / "history.png").read_bytes().startswith(b"\x89PNG")
    other = tmp_path / "other.jsonl"
    other.write_text("{}\n")
    assert "is no history of benchmarks" in run("benchmark", "bars", "--history", other).fault
    assert other.read_text() == "{}\n"


@pytest.mark.usefixtures("suite")
def test_benchmark_wants_a_folder(run, record_path):
    assert "must be a folder" in run("benchmark", "bars", "-o", record_path).fault


@pytest.mark.parametrize("name", benchmark.SUITES)
def test_every_listed_suite_exists(name):
    import importlib

    assert callable(importlib.import_module(f"pipeline.benchmarks.{name}").run)


def test_import_takes_what_a_logger_wrote_beside_the_angles(run, tmp_path):
    table, frame = tmp_path / "ship.csv", tmp_path / "frame.toml"
    table.write_text("t,1,1-2,az\n0,0.01,0.02,0.1\n1,0.02,0.01,0.2\n")
    frame.write_text('restoring = "sine"\nperiod_uncertainty = 1e-7\nlatitude = 10.0\n')
    words = ["--heave", "az", "--damping", "1=1e-4", "--damping", "2=1e-4", "--noise", "1e-5", "--zero-known"]
    known = ["--period", "1=1.01", "--period", "2=1.0101", "--gravity", "9.81", "--latitude", "54"]
    outcome = run("import", table, *words, *known, "--scale", "1e-3", "--instrument", frame)
    assert outcome.status == 0, outcome.err
    record = data_schemas.read(tmp_path / "ship.record.nc")
    stated = record["instrument"].dataset
    assert float(stated["latitude"]) == 54.0  # an option goes before the file
    assert float(stated["zero_uncertainty"]) == 0.0
    assert stated["damping_rate"].values.tolist() == [1e-4, 1e-4]
    assert record["record"]["vertical_acceleration"].values.tolist() == [0.1, 0.2]
