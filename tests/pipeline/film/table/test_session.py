"""A film on the table: edits, their gravity, undo, and that the command line replays them to the same numbers."""

from __future__ import annotations

import io
import time
from pathlib import Path

import numpy as np
import pytest

from data_schemas.checksum import numbers_sha256
from data_schemas.errors import RecordError
from data_schemas.film_edits import edits_path, load_edits
from pipeline.film.digitise import digitise
from pipeline.film.table.session import TILE, Session

pytestmark = pytest.mark.compiled
MASK = {"kind": "mask", "points": [[3000.0, 100.0], [3100.0, 900.0]]}


@pytest.fixture
def session(path, tmp_path):
    film = tmp_path / "night.film.tif"
    film.symlink_to(path)
    film.with_name("night.film.toml").write_text(path.with_name("night.film.toml").read_text())
    opened = Session.open([film], who="A. B.")
    yield opened
    opened.close()


def refined(session: Session) -> dict:
    end = time.monotonic() + 600.0
    while (state := session.state())["gravity"]["refining"]:
        assert time.monotonic() < end
        time.sleep(0.05)
    return state


def test_an_edit_gives_gravity_at_once_and_then_as_digitise_and_process_do(session, path):
    first = refined(session)
    assert abs(first["gravity"]["value_m_s2"] - 9.8123) < 4e-5 * first["gravity"]["sigma_mgal"]
    at_once = session.edit(MASK)
    assert at_once["gravity"]["value_m_s2"] is not None
    assert at_once["gravity"]["refining"]
    last = refined(session)
    sigma = last["gravity"]["sigma_mgal"]
    assert abs(at_once["gravity"]["value_m_s2"] - last["gravity"]["value_m_s2"]) < 0.2e-5 * sigma
    assert at_once["gravity"]["sigma_mgal"] >= first["gravity"]["sigma_mgal"]
    assert 0.5 < at_once["gravity"]["sigma_mgal"] / sigma < 2.0
    assert abs(last["gravity"]["change_mgal"]) < sigma
    made = load_edits(session.path)
    assert [(each.kind, each.by) for each in made.edits] == [("mask", "A. B.")]
    assert made.edits[0].at[:2] == "20"
    record = digitise(session.path.with_name("night.film.tif"), edits=made)
    assert numbers_sha256(record) == last["numbers_sha256"]
    undone = session.undo()
    assert undone["numbers_sha256"] == first["numbers_sha256"]
    assert undone["can_redo"]
    assert session.redo()["numbers_sha256"] == last["numbers_sha256"]
    again = Session.open([session.path.with_name("night.film.tif")])
    again.close()
    assert again.edits == session.edits
    assert again.state()["numbers_sha256"] == last["numbers_sha256"]


def test_what_cannot_be_meant_changes_nothing(session):
    before = session.state()
    for edit, words in (
        ({"kind": "maks", "points": []}, "did you mean 'mask'?"),
        ({"kind": "mark", "row": 9e9}, "lies outside the image"),
        ({"kind": "follow", "trace": 9, "points": [[1.0, 1.0], [2.0, 2.0]]}, "there is no trace 9"),
    ):
        with pytest.raises(RecordError, match=words):
            session.edit(edit)
    with pytest.raises(RecordError, match="nothing to undo"):
        session.undo()
    after = session.state()
    assert after["edits"] == []
    assert after["numbers_sha256"] == before["numbers_sha256"]
    assert not session.path.exists()


def test_a_refusal_is_told_and_taken_back(session):
    # a break in every stretch that is long enough leaves too little
    told = session.edit({"kind": "mask", "points": [[0.0, 0.0], [7900.0, 1498.0]]})
    assert told["reading"]["refused"]
    assert told["gravity"]["value_m_s2"] is None
    assert session.record is None
    assert session.undo()["reading"]["refused"] is None


def test_tiles_overlay_and_table(session):
    from PIL import Image

    scan = session.untouched.scan
    tile = np.asarray(Image.open(io.BytesIO(session.tile(0, 2, 1))))
    np.testing.assert_array_equal(tile, scan.read(2 * TILE, 3 * TILE)[:, TILE : 2 * TILE])
    small = Image.open(io.BytesIO(session.tile(3, 0, 0)))
    assert small.size == (-(-scan.columns // 8), TILE)
    shown = session.overlay(1000, 1100, 5000)
    assert shown["rows"][0] == 1000.5
    read = np.array(shown["read"][0], dtype=float)
    np.testing.assert_allclose(read, session.reading.tracks.position[0, 1000:1101], atol=0.006)
    assert all(each["label"] for each in shown["marks"])
    assert len(shown["marks"]) > 2
    rows = session.csv().splitlines()
    assert rows[0] == "time_s,1_rad,1-2_rad,1_sigma_rad,1-2_sigma_rad"
    assert len(rows) == session.state()["reading"]["samples"] + 1
    harms = [each["harm_mgal"] for each in session.state()["doubtful"]]
    assert harms == sorted(harms, reverse=True)


def test_edits_are_kept_beside_the_film(session):
    assert session.path == edits_path(Path(session.path.parent / "night.film.tif"))
