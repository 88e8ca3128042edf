"""`isochrony expose`: places of the three files, refusals in one line, exit statuses."""

from __future__ import annotations

import numpy as np
import pytest

import data_schemas

pytest.importorskip("tifffile")

SCENE = """
record_id = "short"
duration = 4.0
gravity = 9.81
[[pendulums]]
label = "1"
period = 1.01
start = { kind = "free", amplitude = 0.01 }
[film]
lever = 500.0
paper_width = 20.0
margin = 2.0
"""


@pytest.fixture
def scene_path(tmp_path):
    path = tmp_path / "short.toml"
    path.write_text(SCENE)
    return path


def test_a_scene_beside_itself(run, scene_path):
    outcome = run("expose", scene_path)
    assert outcome.status == 0
    assert all("compiling kernels" in line for line in outcome.err.splitlines())  # where it is the first to need any
    folder = scene_path.parent
    assert f"{folder / 'short.film.tif'}: 283 x 236 px" in outcome.out
    made = [folder / f"short.film.{ending}" for ending in ("tif", "toml", "truth.nc")]
    assert all(each.is_file() for each in made)
    assert run("validate", *made[1:]).status == 0
    again = run("expose", scene_path)
    assert again.status == 2
    assert "short.film.tif: exists already; add --force" in again.fault
    assert run("expose", scene_path, "--force", "--seed", 3).status == 0
    assert data_schemas.read(made[2]).attrs["seed"] == 3


def test_a_record_with_a_film_of_its_own(run, scene_path, tmp_path):
    assert run("simulate", scene_path, "-o", tmp_path / "r.record.nc").status == 0
    film = tmp_path / "slow.toml"
    film.write_text("speed = 1.0\nlever = 200.0\npaper_width = 10.0\n")
    assert run("expose", tmp_path / "r.record.nc", "--film", film, "-o", f"{tmp_path}/out/").status == 0
    truth = data_schemas.read(tmp_path / "out" / "r.film.truth.nc")
    assert np.isfinite(truth["slices/column"].values).sum() == pytest.approx(4.0 * 300 / 25.4, abs=2)


def test_refusals(run, scene_path, tmp_path):
    def refused(status, *words):
        before = sorted(tmp_path.iterdir())
        outcome = run("expose", *words)
        assert outcome.status == status
        assert sorted(tmp_path.iterdir()) == before
        return outcome.fault

    assert "no scene 'none' ships" in refused(2, "none")
    assert "no film 'nice' ships" in refused(2, scene_path, "--film", "nice")
    assert "end the name with .tif" in refused(2, scene_path, "-o", tmp_path / "a.png")
    assert "is an input and would be overwritten" in refused(2, scene_path, "-o", scene_path)
    (tmp_path / "wide.toml").write_text("lever = 9000.0")
    assert "short.toml: film: trace '1' would reach" in refused(2, scene_path, "--film", tmp_path / "wide.toml")
    assert "none.record.nc: " in refused(3, tmp_path / "none.record.nc")


def test_marks_alone_are_refused_with_a_remedy(run, scene_path, tmp_path):
    marks = tmp_path / "marks.toml"
    marks.write_text(SCENE + "[recording]\nmarks = true\n")
    assert run("simulate", marks).status == 0
    outcome = run("expose", tmp_path / "marks.record.nc")
    assert outcome.status == 3
    assert "marks.record.nc: time: samples 0.5 s apart are too few" in outcome.fault
    assert "expose the scene itself" in outcome.fault


def test_a_shipped_scene_goes_to_the_present_folder(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    film = tmp_path / "tiny.toml"
    film.write_text("speed = 0.1\nlever = 50.0\npaper_width = 20.0\nmargin = 1.0\ndpi = 100\n")
    assert run("expose", "linear", "--film", film).status == 0
    assert (tmp_path / "linear.film.tif").is_file()
