"""process: tables, JSON Lines, exit statuses, several records, and what is written."""

from __future__ import annotations

import json
import re
import sys

import numpy as np
import pytest
from made_trees import GRAVITY, made_record

import data_schemas
from pipeline.cli import process as verb
from pipeline.methods import DECLARED, METHODS

CONTRACT = [
    "record_id", "input", "output", "status", "error", "requested_method", "method", "gravity_m_s2",
    "gravity_sigma_mgal", "frequency_rad_s", "difference_frequency_rad_s", "corrections_mgal", "sensitivity_mgal",
    "flags", "samples_used", "elapsed_s",
]  # fmt: skip


def rows(text: str) -> list[dict]:
    def refuse(name):
        raise AssertionError(f"{name} is no JSON")

    return [json.loads(line, parse_constant=refuse) for line in text.splitlines()]


@pytest.fixture
def three(tmp_path):
    """A good record, one that is no record, and another good one."""
    paths = [tmp_path / f"{name}.record.nc" for name in ("a", "b", "c")]
    for index, path in enumerate(paths):
        record = made_record(1500 + 100 * index)
        record.attrs["record_id"] = f"record-{path.name[0]}"
        data_schemas.write(record, path)
    paths[1].write_bytes(paths[1].read_bytes()[:2000])
    return paths


def test_every_method_is_described_and_every_description_is_a_method():
    listed = " ".join(verb.LISTED.split())
    assert all(f"\n  {name} " in verb.LISTED and DECLARED[name].words in listed for name in METHODS)


def test_a_record_gives_a_table_and_a_result_beside_it(run, tmp_path, record_path):
    before = record_path.read_bytes()
    outcome = run("process", record_path, "--method", "projection")
    assert outcome.status == 0, outcome.err
    heading, row, flags, blank, *ledger = outcome.out.splitlines()
    headings = ["record", "method", "gravity m/s2", "sigma mGal", "corrected mGal"]
    assert re.split("  +", heading) == headings
    assert row.split()[:2] == ["ship", "projection"]
    # the swing is made at GRAVITY without noise: the table's last digit is 1e-8 m/s2, a thousandth of a mGal
    assert abs(float(row.split()[2]) - GRAVITY) < 2e-8
    assert flags.strip() == "flags: short-record"
    assert blank == ""
    assert ledger[0].startswith("ledger of projection")
    assert data_schemas.validate(tmp_path / "ship.result.nc") == []
    assert record_path.read_bytes() == before


def test_json_has_the_keys_of_the_contract_in_their_order(run, record_path, tmp_path):
    outcome = run("process", record_path, "--method", "projection,complex", "--json")
    assert outcome.status == 0, outcome.err
    assert outcome.err == ""
    objects = rows(outcome.out)
    assert [row["method"] for row in objects] == ["projection", "complex"]
    for row in objects:
        assert list(row)[: len(CONTRACT)] == CONTRACT
        assert row["status"] == "ok"
        assert row["error"] is None
        assert row["record_id"] == "hand-made"
        assert row["input"] == str(record_path)
        assert row["output"] == str(tmp_path / "ship.result.nc")
        assert set(row["frequency_rad_s"]) == {"1", "2"}
        assert {"non_isochronism", "finite_arc"} <= set(row["corrections_mgal"])
        assert {"frequency_difference_1e-7", "gain_1_percent"} <= set(row["sensitivity_mgal"])
        assert row["samples_used"] > 1000
        assert row["elapsed_s"] > 0


@pytest.mark.compiled
def test_the_default_is_the_joint_fit_and_says_what_it_assumed(run, record_path):
    outcome = run("process", record_path, "--json", "--no-output")
    (row,) = rows(outcome.out)
    assert row["requested_method"] == "auto"
    assert row["method"] == "joint"
    assert row["output"] is None
    outcome = run("process", record_path, "--no-output")
    assert row["choice_reason"] in " ".join(outcome.out.split())
    assert not record_path.with_name("ship.result.nc").exists()


@pytest.mark.compiled
def test_all_is_every_method_but_auto(run, record_path):
    outcome = run("process", record_path, "--method", "all", "--json", "--no-output")
    assert [row["requested_method"] for row in rows(outcome.out)] == [name for name in METHODS if name != "auto"]


@pytest.mark.compiled
def test_a_gap_makes_no_noise_on_stderr(run, tmp_path):
    path = tmp_path / "gap.record.nc"
    data_schemas.write(made_record(gap=10), path)
    outcome = run("process", path, "--method", "all", "--json", "--no-output")
    assert outcome.status == 0, outcome.err
    assert outcome.err == ""


def test_a_bad_record_does_not_stop_the_others(run, tmp_path, three):
    out = tmp_path / "out"
    outcome = run("process", *three, "--method", "projection", "--json", "-o", out)
    assert outcome.status == 1
    assert "b.record.nc" in outcome.fault
    objects = rows(outcome.out)
    assert [row["record_id"] for row in objects] == ["record-a", "b", "record-c"]
    assert [row["status"] for row in objects] == ["ok", "failed", "ok"]
    bad = objects[1]
    assert list(bad) == CONTRACT
    assert "b.record.nc" in bad["error"]
    assert bad["gravity_m_s2"] is bad["method"] is bad["output"] is None
    assert bad["requested_method"] == "projection"
    assert sorted(path.name for path in out.iterdir()) == ["a.result.nc", "c.result.nc"]


def test_no_usable_record_is_3(run, tmp_path, three):
    assert run("process", three[1], tmp_path / "none.record.nc", "--no-output").status == 3


def test_a_table_of_several_records_has_one_heading(run, three):
    outcome = run("process", *three, "--method", "projection", "--no-output")
    lines = outcome.out.splitlines()
    assert [line.split()[0] for line in lines if line[0] != " "] == ["record", "a", "c"]


def test_a_method_that_refuses_says_so_and_the_others_go_on(run, tmp_path):
    record = made_record()
    time = record["time"].values
    # two equal swings of which the difference passes through zero four times
    swing = 0.01 * np.cos(np.array([[6.22], [6.42]]) * time)
    record["record"]["elongation"].values[:] = [swing[0], swing[0] - swing[1]]
    record["instrument"]["period"].values[:] = 2 * np.pi / np.array([6.22, 6.42]) * np.sqrt(GRAVITY / 9.81)
    path = tmp_path / "beats.record.nc"
    data_schemas.write(record, path)
    outcome = run("process", path, "--method", "panteleev,projection", "--json", "--no-output")
    assert outcome.status == 0
    refused, good = rows(outcome.out)
    assert (refused["method"], refused["status"]) == ("panteleev", "refused")
    assert "amplitude" in refused["error"]
    assert refused["gravity_m_s2"] is None
    assert good["status"] == "ok"
    table = run("process", path, "--method", "panteleev,projection", "--no-output").out
    assert "    refused: " in table
    outcome = run("process", path, "--method", "panteleev")
    assert outcome.status == 3
    assert not (tmp_path / "beats.result.nc").exists()


def test_an_existing_result_is_refused_before_any_work(run, tmp_path, three, monkeypatch):
    (tmp_path / "c.result.nc").write_text("precious")
    monkeypatch.setattr(verb, "_one", None)  # calling it would end in status 70
    outcome = run("process", *three)
    assert outcome.status == 2
    assert "c.result.nc: exists already; add --force" in outcome.fault


def test_a_record_is_never_overwritten_by_its_result(run, record_path):
    outcome = run("process", record_path, "-o", record_path, "--force")
    assert outcome.status == 2
    assert "is an input" in outcome.fault


def test_the_same_record_twice_is_refused(run, record_path):
    assert "two inputs" in run("process", record_path, record_path).fault


def test_a_pair_that_is_not_there_is_a_usage_error(run, record_path):
    outcome = run("process", record_path, "--pair", "1-3")
    assert outcome.status == 2
    assert "1-3" in outcome.fault
    assert "ship.record.nc" in outcome.fault


def test_a_pair_that_one_record_lacks_does_not_stop_the_others(run, three):
    other = made_record()
    for group in ("record", "instrument"):
        other[group] = (
            other[group]
            .to_dataset(inherit=False)
            .assign_coords(pendulum=("pendulum", np.array(["7", "8"]), {"units": "1", "long_name": "label"}))
        )
    data_schemas.write(other, three[1], overwrite=True)
    outcome = run("process", *three, "--pair", "1-2", "--method", "projection", "--json", "--no-output")
    assert outcome.status == 1
    assert [row["status"] for row in rows(outcome.out)] == ["ok", "failed", "ok"]
    assert "b.record.nc" in outcome.fault


def test_a_record_that_no_method_can_use_is_refused(run, tmp_path):
    record = made_record(20)
    path = tmp_path / "short.record.nc"
    data_schemas.write(record, path)
    outcome = run("process", path, "--json")
    assert outcome.status == 3
    assert [row["status"] for row in rows(outcome.out)] == ["refused"]
    assert not (tmp_path / "short.result.nc").exists()


def test_the_gain_uncertainty_widens_sigma(run, record_path):
    def sigma(*more):
        (row,) = rows(run("process", record_path, "--method", "projection", "--json", "--no-output", *more).out)
        return row["gravity_sigma_mgal"], row["sensitivity_mgal"]["gain_1_percent"]

    plain_sigma, per_percent = sigma()
    wide, _ = sigma("--gain-uncertainty", "0.01")
    # independent errors add in squares
    np.testing.assert_allclose(wide, np.hypot(plain_sigma, per_percent), rtol=1e-9)


def test_a_single_trace_gives_its_period(run, tmp_path):
    time = np.arange(3000) * 0.02
    table = tmp_path / "swing.csv"
    angle = 0.05 * np.cos(2 * np.pi / 1.029 * time)
    table.write_text("".join(f"{t:.2f},{a:.9f}\n" for t, a in zip(time, angle, strict=True)))
    assert run("import", table).status == 0
    path = tmp_path / "swing.record.nc"
    outcome = run("process", path, "--json", "--no-output")
    assert outcome.status == 0, outcome.err
    (row,) = rows(outcome.out)
    assert row["gravity_m_s2"] is None
    # a linear oscillator: the pendulum of the same period would be slower by amplitude^2/16 = 1.6e-4 at its arc
    assert row["period_s"] == pytest.approx(1.029 / (1 + 0.05**2 / 16), rel=1e-6)
    assert row["period_sigma_s"] > 0
    outcome = run("process", path)
    assert outcome.out.splitlines()[0].split()[2:6] == ["period", "s", "sigma", "s"]
    assert run("plot", tmp_path / "swing.result.nc").status == 0


@pytest.mark.parametrize(("terminal", "count", "shown"), [(True, 3, True), (True, 1, False), (False, 3, False)])
def test_progress_is_shown_to_a_person_who_waits(monkeypatch, capsys, terminal, count, shown):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal, raising=False)
    assert list(verb._with_progress(list(range(count)))) == list(range(count))
    assert ("record" in capsys.readouterr().err) == shown


def test_processing_imports_nothing_it_does_not_need(record_path):
    from test_main import python

    code = (
        # xarray imports dask wherever it is installed; whoever else does fails here
        "import sys; sys.modules['dask'] = None; from pipeline.cli.main import main\n"
        f"status = main(['process', {str(record_path)!r}, '--method', 'projection', '--no-output'])\n"
        "extra = {'matplotlib', 'pydantic', 'scipy.signal', 'pebble', 'tqdm', 'pytest', 'synth.simulate'}\n"
        "sys.exit(status or (repr(extra & set(sys.modules)) if extra & set(sys.modules) else 0))"
    )
    done = python("-c", code)
    assert done.returncode == 0, done.stderr
