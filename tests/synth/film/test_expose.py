"""The three files of a film: whole or not there, as the schemas say, in any orientation."""

from __future__ import annotations

import json
import os

import numpy as np
import pytest
from made_films import SMALL, record_of, swing

import data_schemas
import synth
from data_schemas.errors import FileError, SceneError, UsageError
from data_schemas.film_description import description_path, load_description
from data_schemas.scene import Scene
from data_schemas.scene_recording import Film
from synth.film.exposing import ImageFile

tifffile = pytest.importorskip("tifffile")


@pytest.fixture
def scene(make_scene):
    return make_scene(duration=6.0, gravity=9.81)


def centroids(image, film):
    """Centroid of the darkening of every row, px."""
    value = image.astype(float)
    dark = np.median(value) - value
    dark[dark < 0.02 * np.ptp(value)] = 0.0
    place = np.arange(image.shape[1]) + 0.5
    with np.errstate(invalid="ignore"):
        return (dark * place).sum(axis=1) / dark.sum(axis=1)


def test_the_files_are_what_they_should_be(tmp_path):
    path = tmp_path / "a.film.tif"
    film = Film(**SMALL | {"gap": 0.03})
    steps = []
    truth = synth.expose(
        record_of(swing(), seconds=12.0), film, path, progress=lambda done, of: steps.append((done, of))
    )
    assert sorted(each.name for each in tmp_path.iterdir()) == ["a.film.tif", "a.film.toml", "a.film.truth.nc"]
    for name in ("a.film.toml", "a.film.truth.nc"):
        assert data_schemas.validate(tmp_path / name) == []
    assert data_schemas.check(truth, "film-truth") == []
    with tifffile.TiffFile(path) as file:
        page = file.pages[0]
        assert file.is_bigtiff
        assert page.rowsperstrip == min(1024, page.shape[0])
        assert page.shape == (truth.sizes["time"], 295)
        assert page.resolution == (300.0, 300.0)
        assert page.dtype == np.uint8
        assert page.compression == 1
    assert steps[-1] == (truth.sizes["time"],) * 2
    assert np.all(np.diff(truth["time"].values) > 0)
    assert json.loads(truth.attrs["film"])["lever"] == 500.0


def test_the_description_says_what_an_observer_knows_and_no_more(tmp_path, scene):
    film = Film(drift=0.1, wow=0.01, missing_marks=0.3, skew=0.1, lever=300.0, traces=[{"name": "1", "offset": 2.0}])
    synth.expose(scene, film, tmp_path / "a.film.tif")
    known = load_description(description_path(tmp_path / "a.film.tif"))
    assert [(each.name, each.combination, each.lever) for each in known.traces] == [
        ("1", {"1": 1.0}, 300.0),
        ("1-2", {"1": 1.0, "2": -1.0}, 300.0),
    ]
    assert [each.period for each in known.pendulums] == [1.00966, 1.00976]
    assert known.instrument.reference_gravity == 9.81
    assert (known.speed, known.dpi, known.gap, known.minute_code) == (5.0, 300.0, 0.03, 0.125)
    text = (tmp_path / "a.film.toml").read_text()
    for hidden in ("drift", "wow", "missing", "skew", "offset", "seed", "amplitude", "grain"):
        assert hidden not in text


def test_the_description_tells_all_that_the_record_tells_of_the_instrument(tmp_path):
    """Heat, air, the ship's way, labels of base stations: what has one value, or one a pendulum."""
    scene = data_schemas.load_scene(synth.scene_path("cruise")).model_copy(update={"duration": 10.0})
    record, _ = synth.simulate(scene)
    film = Film(lever=100.0, speed=1.0, paper_width=60.0)
    synth.expose_to(record, film, tmp_path / "a.film.tif")
    known = load_description(tmp_path / "a.film.toml")
    told = record["instrument"].dataset
    for name, value in told.variables.items():
        if value.dims == ():
            assert getattr(known.instrument, name) == float(value)
        elif value.dims == ("pendulum",) and name != "pendulum":
            assert [getattr(each, name) for each in known.pendulums] == value.values.tolist()
    assert known.instrument.latitude is not None
    assert known.pendulums[0].temperature_coefficient is not None


def test_the_description_tells_bases_and_what_changes(tmp_path):
    scene = data_schemas.load_scene(synth.scene_path("cruise"))
    changing = {
        "temperature": 290.0, "temperature_amplitude": 2.0, "temperature_period": 300.0,
        "bases": [{"label": "a", "time": -3600.0, "gravity": 9.81}, {"label": "b", "time": 7200.0, "gravity": 9.82}],
    }  # fmt: skip
    conditions = type(scene.conditions).model_validate(changing)
    scene = scene.model_copy(update={"duration": 130.0, "conditions": conditions})
    record, _ = synth.simulate(scene)
    told = record["instrument"].dataset
    film = Film(lever=100.0, speed=1.0, paper_width=60.0)
    for k, source in enumerate((record, scene)):
        (synth.expose_to if k == 0 else synth.expose)(source, film, tmp_path / f"{k}.film.tif")
        known = load_description(tmp_path / f"{k}.film.toml")
        assert [base.label for base in known.bases] == ["a", "b"]
        assert [base.time for base in known.bases] == told["base_time"].values.tolist()
        assert [list(base.period.values()) for base in known.bases] == told["base_period"].values.tolist()
        read = np.array([(each.time, each.temperature) for each in known.readings])
        assert read[0, 0] == 0.0
        assert read[-1, 0] == pytest.approx(130.0, abs=0.1)
        true = 290.0 + 2.0 * np.sin(2.0 * np.pi * read[:, 0] / 300.0)
        np.testing.assert_allclose(read[:, 1], true, atol=1e-4)  # K: the chronometer's rate turns it by less
        assert known.instrument.temperature is None


@pytest.mark.parametrize("lies", [{}, {"rotation": 1.5}, {"skew": 2.0, "stretch_along": 0.02, "stretch_across": -0.02}])
@pytest.mark.parametrize("turned", [{}, {"upside_down": True}, {"polarity": "positive"}, {"bits": 16}])
def test_the_image_is_where_the_truth_says(tmp_path, lies, turned):
    path = tmp_path / "a.film.tif"
    truth = synth.expose(record_of(swing(0.006)), Film(**SMALL | {"speed": 20.0}, **lies, **turned), path)
    image = tifffile.imread(path)
    if turned.get("bits"):
        assert np.unique(image).size > 1000
        image = image // 257
    if turned.get("upside_down"):
        image = image[::-1, ::-1]
    if turned.get("polarity"):
        image = 255 - image
    if lies.get("rotation"):
        image = np.where(image > 250, 229, image)  # the lid is not the paper
    column = truth["slices/column"].values[0]
    good = np.isfinite(column)
    good[: np.argmax(good) + 8] = False
    good[-np.argmax(good[::-1]) - 8 :] = False
    # of the curvature, where the curve of the emulsion weighs it, a tenth of a pixel and more is left
    np.testing.assert_allclose(centroids(image, None)[good], column[good], atol=0.6)
    assert np.median(np.abs(centroids(image, None)[good] - column[good])) < 0.1


@pytest.mark.compiled
@pytest.mark.parametrize("name", synth.films())
def test_every_shipped_film_renders(tmp_path, name, make_scene):
    still = [{"kind": "still"}]
    scene = make_scene(duration=30.0, gravity=9.81, motion=still, pendulums=[
        {"label": "1", "period": 1.00966, "start": {"kind": "free", "amplitude": 0.005}},
        {"label": "2", "period": 1.00976, "start": {"kind": "free", "amplitude": 0.004, "phase": 2.0}},
    ])  # fmt: skip
    truth = synth.expose(scene, name, tmp_path / "a.film.tif", seed=1)
    image = tifffile.imread(tmp_path / "a.film.tif")
    assert image.shape[0] == truth.sizes["time"]
    film = synth.load_film(name)
    paper = 255 * 10 ** (-film.fog / 2.2)
    assert np.median(image) == pytest.approx(paper, abs=0.1 * 255)
    assert image.min() < 0.6 * paper  # lines show


@pytest.mark.compiled
def test_chance_is_the_seeds_alone(tmp_path):
    record = record_of(swing(0.01), seconds=10.0)
    film = Film(**SMALL | {"gap": 0.03}, grain=0.05, dust=100, wow=0.01, walk=0.01, missing_marks=0.2, blur=0.5)

    def made(name, **how):
        synth.expose_to(record, film, tmp_path / f"{name}.tif", **how)
        return tifffile.imread(tmp_path / f"{name}.tif"), data_schemas.content_sha256(
            data_schemas.read(tmp_path / f"{name}.film.truth.nc")
        )

    image, digest = made("a", seed=4)
    again, same = made("b", seed=4)
    np.testing.assert_array_equal(image, again)
    assert same == digest
    other, _ = made("c", seed=5)
    assert other.shape != image.shape or np.any(other != image)


def test_the_seed_is_that_of_the_call_or_the_film_or_the_scene(tmp_path, scene):
    film = Film(lever=100.0, speed=1.0, paper_width=30.0, gap=0.0)

    def seed(name, film, **how):
        return synth.expose(scene, film, tmp_path / f"{name}.tif", **how).attrs["seed"]

    assert seed("a", film, seed=1) == 1
    assert seed("b", film.model_copy(update={"seed": 2})) == 2
    assert seed("c", film) == 11


def test_the_scene_may_name_its_film(tmp_path, make_scene):
    scene = make_scene(duration=3.0, film={"speed": 2.0, "lever": 100.0, "paper_width": 40.0})
    truth = synth.expose(scene, None, tmp_path / "a.film.tif")
    assert json.loads(truth.attrs["film"])["speed"] == 2.0
    assert Scene.model_validate_json(truth.attrs["scene"]) == scene
    assert json.loads(synth.expose(scene, Film(lever=100.0), tmp_path / "b.film.tif").attrs["film"])["speed"] == 5.0


def test_nothing_half_written_stays(tmp_path):
    def interrupt(done, of):
        raise KeyboardInterrupt

    record = record_of(swing())
    with pytest.raises(KeyboardInterrupt):
        synth.expose(record, Film(**SMALL), tmp_path / "a.film.tif", progress=interrupt)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("taken", ["a.film.tif", "a.film.toml", "a.film.truth.nc"])
def test_files_that_are_there_stay(tmp_path, taken):
    (tmp_path / taken).write_text("mine")
    with pytest.raises(FileError, match=f"{taken}: exists already"):
        synth.expose(record_of(swing()), Film(**SMALL), tmp_path / "a.film.tif")
    assert [(each.name, each.read_text()) for each in tmp_path.iterdir()] == [(taken, "mine")]
    synth.expose(record_of(swing()), Film(**SMALL), tmp_path / "a.film.tif", overwrite=True)
    assert len(list(tmp_path.iterdir())) == 3


def test_a_full_disk_is_told_in_one_line(tmp_path, monkeypatch):
    class Full:
        close = staticmethod(lambda: None)

        def seek(self, at):
            raise OSError(28, "No space left on device")

    def opened(self):
        made = enter(self)
        self._file.close()
        self._file = Full()
        return made

    enter = ImageFile.__enter__
    monkeypatch.setattr(ImageFile, "__enter__", opened)
    with pytest.raises(FileError, match="No space left on device; free space"):
        synth.expose(record_of(swing()), Film(**SMALL), tmp_path / "a.film.tif")
    assert os.listdir(tmp_path) == []


def test_only_tiff_is_written(tmp_path):
    with pytest.raises(UsageError, match=r"end the name with \.tif"):
        synth.expose(record_of(swing()), Film(), tmp_path / "a.png")


def test_films_in_files(tmp_path):
    (tmp_path / "f.toml").write_text("speed = 2.0\n")
    assert synth.load_film(str(tmp_path / "f.toml")).speed == 2.0
    (tmp_path / "s.toml").write_text("[film]\nspeed = 3.0\n")
    assert synth.load_film(str(tmp_path / "s.toml")).speed == 3.0
    (tmp_path / "b.toml").write_text("sped = 3.0\n")
    with pytest.raises(SceneError, match=r"b.toml: sped = 3.0 is not a known key; did you mean 'speed'\?"):
        synth.load_film(str(tmp_path / "b.toml"))
    with pytest.raises(SceneError, match="no film 'nice' ships with isochrony; there are: bad, clean"):
        synth.load_film("nice")
    with pytest.raises(SceneError, match="cannot be read"):
        synth.load_film(str(tmp_path / "none.toml"))
