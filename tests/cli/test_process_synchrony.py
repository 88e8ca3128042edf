"""process --synchrony: the table and JSON Lines of clocks, what it refuses, what it writes."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

import data_schemas
from pipeline.cli.main import main

sys.path.append(str(Path(__file__).parents[1] / "pipeline" / "synchronism"))

from known_clocks import record_of


@pytest.fixture
def clocks(tmp_path):
    time = np.arange(0.0, 200.0, 0.1)
    rows = 0.1 * np.cos(np.stack([6.2 * time, 6.2 * time + np.pi]))
    path = tmp_path / "clocks.record.nc"
    data_schemas.write(record_of(time, rows), path)
    return path


def test_the_table_says_it_in_words(clocks, capsys) -> None:
    assert main(["process", str(clocks), "--synchrony"]) == 0
    heading, name, line = capsys.readouterr().out.splitlines()
    assert heading.split()[:2] == ["pair", "verdict"]
    assert name == "clocks:"
    assert line.split()[:3] == ["1-2", "antiphase", "1.000"]
    assert max(map(len, (heading, line))) <= 80
    stored = data_schemas.read(clocks.with_name("clocks.result.nc"))
    assert stored["synchrony"]["verdict"].values.tolist() == ["antiphase"]


def test_json_has_the_contracts_keys_and_what_was_found(clocks, capsys) -> None:
    assert main(["process", str(clocks), "--synchrony", "--json", "--no-output"]) == 0
    row = json.loads(capsys.readouterr().out)
    assert list(row)[:7] == ["record_id", "input", "output", "status", "error", "requested_method", "method"]
    assert row["gravity_m_s2"] is None
    assert row["synchrony"]["verdict"] == "antiphase"
    assert abs(row["synchrony"]["angle_rad"]) == pytest.approx(np.pi, abs=1e-3)


def test_options_of_gravity_are_refused(clocks, capsys) -> None:
    assert main(["process", str(clocks), "--synchrony", "--method", "projection"]) == 2
    assert "drop --method" in capsys.readouterr().err


def test_a_record_too_short_is_refused_in_one_line(tmp_path, capsys) -> None:
    time = np.arange(0.0, 5.0, 0.1)
    path = tmp_path / "short.record.nc"
    data_schemas.write(record_of(time, 0.1 * np.cos(np.stack([6.2 * time, 6.1 * time]))), path)
    assert main(["process", str(path), "--synchrony"]) == 3
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 1
    assert "swings are too few" in told[0]


def test_the_result_is_drawn(clocks, capsys) -> None:
    assert main(["process", str(clocks), "--synchrony"]) == 0
    assert main(["plot", str(clocks.with_name("clocks.result.nc"))]) == 0
    picture = clocks.with_name("clocks.result.png")
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert capsys.readouterr().out.splitlines()[-1] == str(picture)
