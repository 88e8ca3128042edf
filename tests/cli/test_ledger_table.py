"""The ledger as `process` shows it."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr
from made_trees import GRAVITY, made_record

import data_schemas
from data_schemas.variables import attributes
from pipeline.ledger.book import corrections

STATED = {"chronometer_rate": 1.0, "tilt_mean_square": 1e-5, "tilt_mean_square_uncertainty": 1e-6, "latitude": 45.0}


@pytest.fixture
def stated_path(tmp_path):
    record = made_record()
    instrument = record["instrument"].to_dataset(inherit=False)
    for name, value in STATED.items():
        instrument[name] = ((), value, attributes(f"instrument/{name}"))
    record["instrument"] = xr.DataTree(instrument)
    traces = record["record"].to_dataset(inherit=False)
    still = np.zeros(record["time"].size)
    traces["vertical_acceleration"] = ("time", still, attributes("record/vertical_acceleration"))
    record["record"] = xr.DataTree(traces)
    path = tmp_path / "stated.record.nc"
    data_schemas.write(record, path)
    return path


def lines_of(text: str) -> dict[str, list[str]]:
    """First word -> words, of the ledger's lines; and why corrections are not applied, under "not"."""
    corrections, _, absent = text[text.index("ledger") :].partition("  not applied:\n")
    found = {line.split()[0]: line.split() for line in corrections.splitlines() if line.startswith("  ")}
    return found | {"not": absent.split()}


def test_one_method_shows_sizes_sigmas_periods_and_reasons(run, stated_path):
    outcome = run("process", stated_path, "--method", "projection", "--no-output")
    assert outcome.status == 0, outcome.err
    lines = lines_of(outcome.out)
    named = {word.strip(",:") for word in lines["not"]} | set(lines)
    assert {module.NAME for module in corrections()} <= named
    # 1 s/day is 22.7 mGal, of the full period 1e-7 s are 0.194 mGal; it states no uncertainty
    assert float(lines["chronometer"][1]) == pytest.approx(-22.7, abs=0.05)
    assert float(lines["chronometer"][2]) == pytest.approx(0.01 * abs(float(lines["chronometer"][1])), rel=1e-3)
    assert float(lines["chronometer"][3]) == pytest.approx(22.7 / 0.194, rel=0.01)
    assert float(lines["tilt"][1]) == pytest.approx(GRAVITY * 0.5, abs=1e-3)  # g <b^2>/2 = g/2 1e-5
    assert lines["tilt"][2] == "0.4903"
    assert "temperature:" in lines["not"]
    values = [float(lines[each.NAME][1]) for each in corrections() if each.NAME in lines]
    assert float(lines["sum"][1]) == pytest.approx(sum(values), abs=2e-4)  # four decimals each
    assert "free air anomaly" in outcome.out
    assert [line for line in outcome.out.splitlines() if len(line) > 80] == []


def test_several_methods_stand_side_by_side(run, stated_path):
    outcome = run("process", stated_path, "--method", "uncorrected,projection,shooting", "--no-output")
    lines = lines_of(outcome.out)
    assert lines["correction"] == ["correction", "uncorrected", "projection", "shooting"]
    assert lines["non_isochronism"][1] == "-"
    assert len(lines["chronometer"]) == 4
    assert "yaw: no instrument/yaw_rate in the record" in " ".join(lines["not"])
    finite = lines["finite_arc"]
    assert finite[1:3] == ["-", "-"]
    assert float(finite[3]) != 0.0


def test_of_several_records_the_ledger_is_shown_on_demand(run, stated_path, record_path):
    words = ("process", stated_path, record_path, "--method", "projection", "--no-output")
    assert "ledger" not in run(*words).out
    shown = run(*words, "--ledger").out
    assert shown.count("ledger of projection") == 2
    assert shown.count("gravity m/s2") == 2  # headings again below a ledger


def test_a_refused_record_has_no_ledger(run, tmp_path):
    path = tmp_path / "short.record.nc"
    data_schemas.write(made_record(20), path)
    assert "ledger" not in run("process", path, "--no-output").out


def test_json_carries_the_ledger(run, stated_path):
    outcome = run("process", stated_path, "--method", "projection", "--no-output", "--json")
    (row,) = map(json.loads, outcome.out.splitlines())
    assert [entry["entry"] for entry in row["ledger"]] == list(row["corrections_mgal"])
    for entry in row["ledger"]:
        assert entry["value_mgal"] == row["corrections_mgal"][entry["entry"]]
        assert entry["formula"]
        assert entry["formula_source"]
    unknown = next(entry for entry in row["ledger"] if entry["entry"] == "chronometer")
    assert unknown["sigma_mgal"] == pytest.approx(0.01 * abs(unknown["value_mgal"]))
    assert unknown["input"] == ["instrument/chronometer_rate"]
    total = sum(row["corrections_mgal"].values())
    # gravity is rounded to 1e-15 of 10 m/s2
    assert total == pytest.approx((row["gravity_m_s2"] - row["uncorrected_m_s2"]) * 1e5, abs=1e-7)
    assert row["free_air_anomaly_mgal"] == pytest.approx((row["gravity_m_s2"] - 9.806199202522187) * 1e5, abs=1e-6)


def test_all_methods_stand_below_each_other_where_a_line_is_full(run, stated_path):
    outcome = run(
        "process", stated_path, "--method", "uncorrected,panteleev,complex,projection,shooting", "--no-output"
    )
    assert outcome.status == 0, outcome.err
    assert [line for line in outcome.out.splitlines() if len(line) > 80] == []
    assert outcome.out.count("  correction ") == 2


def test_the_line_of_a_record_has_the_sum_of_its_corrections(run, stated_path):
    outcome = run("process", stated_path, "--method", "shooting", "--no-output")
    assert outcome.out.splitlines()[1].split()[-1] == lines_of(outcome.out)["sum"][1]
