"""The suite `film` on one short film: every reader gives a row, what is written is there, promises are told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from data_schemas.errors import RefusedError
from data_schemas.scene_film import Film
from pipeline.benchmarks import film, film_bars, film_cases
from pipeline.benchmarks.film_cases import Case, cases, scene

pytest.importorskip("tifffile")
READERS = {"isochrony", "column argmax", "centroid", "scipy peak linking"}


def test_every_axis_has_its_ends() -> None:
    quick, full = list(cases(60.0, quick=True)), list(cases(60.0, quick=False))
    assert {case.axis for case in quick} == {case.axis for case in full}
    assert len(quick) == 10
    assert len(full) == 15
    assert all(case.film.grain == film_cases.GRAIN for case in full if case.axis != "grain")


@pytest.mark.compiled
def test_one_film_is_read_by_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("matplotlib")
    one = Case("grain", 0.02, scene(60.0), Film(grain=0.02))
    monkeypatch.setattr(film, "cases", lambda seconds, *, quick: iter([one]))
    rows = list(film.run(quick=True, folder=tmp_path))
    table = [row for row in rows if "reader" in row]
    assert {row["reader"] for row in table} >= READERS
    ours = table[0]
    assert ours["refused"] == ""
    assert ours["normal_px"] < 0.2
    assert ours["accepted"] > 0.83
    assert ours["slipped"] == 0.0
    for row in table[1:3]:  # who looks for the darkest place in its columns gets near it
        assert ours["normal_px"] < row["normal_px"] < 2.0
    assert all(np.isfinite(row["mpx_s"]) for row in table)
    assert {each.name for each in tmp_path.iterdir()} == {"film.csv", "film-bars.csv", "film.json", "film.png"}
    bars = [row for row in rows if "bar" in row]
    assert bars[0]["bar"] == "speed of all of digitise, one core"


@pytest.mark.compiled
def test_a_refused_film_has_its_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise RefusedError("no trace")

    monkeypatch.setattr(film, "own_reading", refuse)
    monkeypatch.setattr(film, "readings", lambda scan, truth: iter(()))
    (row,) = film.rows_of(Case("grain", 0.02, scene(10.0), Film()), tmp_path / "a.film.tif")
    assert row["refused"] == "no trace"
    assert row["accepted"] == 0.0


def test_speed_is_that_of_the_usual_films() -> None:
    def row(axis: str, reader: str, speed: float) -> dict[str, object]:
        return {"axis": axis, "reader": reader, "mpx_s": speed, "refused": ""}

    table = [
        row("grain", "isochrony", 12.0),
        row("grain", "scikit-image route_through_array", 0.5),
        row("resolution, dpi", "isochrony", 1.0),
    ]
    speed, times, left_out = film_bars.rows(table, Path("."), quick=True)
    assert (speed["value"], speed["pass"]) == (12.0, True)
    assert (times["value"], times["pass"]) == (24.0, True)
    assert left_out["pass"] is None
