"""The table of a batch: every number to the last bit, in the order of the inputs, whatever the names."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from batch_parts import config_of

import data_schemas
from pipeline.batch import summary
from pipeline.batch.job import Outcome, failure
from pipeline.batch.ledger import Ledger
from pipeline.batch.summary import write_summary

ROWS = (
    {"record_id": "a", "method": "projection", "status": "ok", "gravity_m_s2": 0.1 + 0.2, "flags": ""},
    {"record_id": "a", "method": "complex", "status": "refused", "error": "no; \0 \udcff", "flags": "x y"},
)


@pytest.fixture
def written(out):
    """Two inputs, one with two methods, one failed; a third that the ledger does not know."""
    jobs = [(Path("in/b\udcff.nc"), config_of(out, "b", variant=(("gravity", 9.8), ("kind", "sine")))),
            (Path("in/a.nc"), config_of(out, "a")), (Path("in/c.nc"), config_of(out, "c"))]  # fmt: skip
    with Ledger(out, "{}") as ledger:
        outcomes = [
            failure(jobs[1][1].key, "FileError", "bad"),
            Outcome(jobs[0][1].key, "ok", None, None, "1", "2", ROWS),
        ]
        ledger.append(outcomes, {one.key: "" for one in outcomes})
        return write_summary(jobs, ledger, out)


def test_rows_are_in_the_order_of_the_inputs_to_the_last_bit(written):
    with written[0].open(newline="", encoding="utf-8") as file:
        first, second, third = csv.DictReader(file)
    assert [row["output"] for row in (first, second, third)] == ["b.result.nc", "b.result.nc", ""]
    assert float(first["gravity_m_s2"]) == 0.1 + 0.2
    assert first["input"] == "in/b\\udcff.nc"
    assert second["error"] == "no; \\x00 \\udcff"
    assert third["error_class"] == "FileError"
    assert [row["sweep gravity"] for row in (first, third)] == ["9.8", ""]


def test_the_netcdf_table_is_a_kind_of_file(written):
    assert data_schemas.validate(written[1]) == []
    table = data_schemas.read(written[1])
    bare = table.copy()
    del bare["status"]
    bare["period_s"].attrs["units"] = "rad"
    assert data_schemas.check(bare, "summary") == [
        "status: the variable is missing; add it with dimensions (row) in 1",
        "period_s: has units 'rad'; convert it to 's'",
    ]


def test_the_netcdf_table_says_the_same(written):
    table = data_schemas.read(written[1])
    np.testing.assert_array_equal(table["gravity_m_s2"], [0.1 + 0.2, np.nan, np.nan])
    words = table["method"].attrs["flag_meanings"].split()
    assert [words[code] for code in table["method"].values] == ["projection", "complex", "none"]
    assert table["sweep_gravity"].values[0] == 9.8
    assert table["sweep_kind"].values.tolist() == ["sine", "sine", ""]
    assert table["input"].values[0] == "in/b\\udcff.nc"


def test_names_of_very_many_rows_are_left_to_the_csv(out, monkeypatch):
    monkeypatch.setattr(summary, "MOST_NAMED", 1)
    jobs = [(Path(f"{name}.nc"), config_of(out, name, variant=(("kind", name),))) for name in "abc"]
    with Ledger(out, "{}") as ledger:
        ledger.append(
            [Outcome(c.key, "ok", None, None, "1", "2", ROWS[:1]) for _, c in jobs], {c.key: "" for _, c in jobs}
        )
        paths = write_summary(jobs, ledger, out)
    table = data_schemas.read(paths[1])
    assert "input" not in table
    assert "sweep_kind" not in table
    assert table["gravity_m_s2"].size == 3
    assert "c.nc" in paths[0].read_text()
