"""digitise and plot of films: options, exit statuses, one line a fault; the whole way from a scene to gravity."""

from __future__ import annotations

import json

import numpy as np
import pytest

import data_schemas

pytest.importorskip("tifffile")
pytest.importorskip("PIL")

SCENE = """
record_id = "night"
duration = 60.0
gravity = 9.8123
reference_gravity = 9.81
restoring = "linear"
pendulums = [
  { label = "1", period = 1.00966, damping_rate = 1e-4, start = { kind = "free", amplitude = 5e-3, phase = 0.4 } },
  { label = "2", period = 1.009760966, damping_rate = 1e-4, start = { kind = "free", amplitude = 4e-3, phase = 2.2 } },
]
motion = [ { kind = "harmonics", amplitude = [0.01], period = [10.0] } ]
"""


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    """A minute of typical film."""
    import synth

    folder = tmp_path_factory.mktemp("film")
    (folder / "night.toml").write_text(SCENE)
    synth.expose_to(data_schemas.load_scene(folder / "night.toml"), "typical", folder / "night.film.tif")
    return folder / "night.film.tif"


@pytest.mark.compiled
def test_a_film_becomes_a_record_that_gives_gravity(run, film, tmp_path):
    outcome = run("digitise", film, "-o", f"{tmp_path}/", "--json", "--preview")
    assert outcome.status == 0, outcome.err
    row = json.loads(outcome.out)
    assert row["status"] == "ok"
    assert row["traces"] == ["1", "1-2"]
    assert row["accepted_fraction"] > 0.78
    assert row["assumed"] == []
    path = tmp_path / "night.record.nc"
    assert row["output"] == str(path)
    assert data_schemas.validate(path) == []
    assert (tmp_path / "night.film.png").stat().st_size > 10_000
    outcome = run("process", path, "--json")
    found = json.loads(outcome.out)
    error = abs(found["gravity_m_s2"] - 9.8123) / 1e-5
    assert error < 4.0 * found["gravity_sigma_mgal"]
    assert found["gravity_sigma_mgal"] < 30.0  # a single minute


@pytest.mark.compiled
def test_several_cores_read_the_same_record(film):
    from pipeline.film.digitise import digitise

    assert digitise(film, jobs=2).identical(digitise(film))


@pytest.mark.compiled
def test_light_lines_on_a_png_across_the_page_are_the_same_film(run, film, tmp_path):
    from PIL import Image

    from pipeline.film.scan.opening import open_scan

    scan = open_scan(film)
    pixels = 255 - scan.read(0, scan.rows)
    Image.fromarray(np.rot90(pixels, 1)).save(tmp_path / "night.png", dpi=(300, 300))
    (tmp_path / "night.film.toml").write_bytes(film.with_name("night.film.toml").read_bytes())
    outcome = run("digitise", tmp_path / "night.png", "--json")
    assert outcome.status == 0, outcome.err
    assert "lines are light on dark film" in outcome.err
    assert run("digitise", film, "-o", f"{tmp_path}/straight.record.nc").status == 0
    one, other = (data_schemas.read(tmp_path / f"{name}.record.nc") for name in ("night", "straight"))
    both = np.intersect1d(np.round(one.dataset["time"] * 25), np.round(other.dataset["time"] * 25))
    apart = [
        tree["record"].dataset["elongation"].values[:, np.isin(np.round(tree.dataset["time"] * 25), both)]
        for tree in (one, other)
    ]
    apart = apart[0] - apart[1]
    assert np.nanstd(apart) < 2e-5  # rad; half a pixel is 2.1e-5


@pytest.mark.campaign
@pytest.mark.parametrize("degrees", [90, 180, 270])
def test_a_film_upside_down_is_turned_by_its_minute_code(run, tmp_path, degrees):
    import tifffile

    import synth
    from pipeline.film.scan.opening import open_scan

    (tmp_path / "night.toml").write_text(SCENE.replace("60.0", "200.0"))
    film = tmp_path / "night.film.tif"
    synth.expose_to(data_schemas.load_scene(tmp_path / "night.toml"), "typical", film)
    scan = open_scan(film)
    turned = tmp_path / "turned.film.tif"
    tifffile.imwrite(
        turned, np.rot90(scan.read(0, scan.rows), -degrees // 90).copy(), rowsperstrip=64, compression="zlib"
    )
    (tmp_path / "turned.film.toml").write_bytes(film.with_name("night.film.toml").read_bytes())
    for path in (film, turned):
        outcome = run("digitise", path)
        assert outcome.status == 0, outcome.err
    assert ("upside down" in outcome.err) == (degrees in (90, 180))
    one, other = (data_schemas.read(tmp_path / f"{name}.record.nc") for name in ("night", "turned"))
    apart = one["record"].dataset["elongation"] - other["record"].dataset["elongation"]
    assert float(apart.std()) < 2e-5


@pytest.mark.parametrize("name", ["absent.tif", "notes.txt", "empty.png", "cut.tif"])
def test_what_is_no_film_gives_one_line_and_status_3(run, tmp_path, name):
    path = tmp_path / name
    content = {"notes.txt": b"dear diary", "empty.png": b"", "cut.tif": b"II*\0\x08\0\0\0"}
    if name in content:
        path.write_bytes(content[name])
    outcome = run("digitise", path)
    assert outcome.status == 3
    assert name in outcome.fault
    assert not path.with_name(f"{path.stem}.record.nc").exists()
    outcome = run("digitise", path, "--json")
    assert outcome.status == 3
    row = json.loads(outcome.out)
    assert row["status"] == "failed"
    assert name in row["error"]


def test_a_picture_without_traces_is_refused(run, tmp_path):
    from PIL import Image

    path = tmp_path / "sky.png"
    Image.fromarray(np.full((800, 300), 200, dtype=np.uint8)).save(path)
    outcome = run("digitise", path)
    assert outcome.status == 3
    assert "sky.png" in outcome.fault


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--lever", "0"], "--lever wants"),
        (["--orientation", "45"], "unknown orientation '45'"),
        (["--reading", "strob"], "did you mean 'strobe'"),
        (["--lines", "grey"], "unknown kind of lines"),
        (["--jobs", "0"], "--jobs wants"),
        (["--trace", "1:"], "NAME:COMBINATION"),
        (["--period", "1=x"], "--period wants a number"),
        (["--description", "none.toml"], "none.toml"),
        (["--dpi", "1e9"], "pixels per inch"),
    ],
)
def test_options_are_checked(run, tmp_path, options, said):
    from PIL import Image

    path = tmp_path / "a.png"
    Image.fromarray(np.full((300, 100), 200, dtype=np.uint8)).save(path)
    outcome = run("digitise", path, *options)
    assert outcome.status in (2, 3)
    assert said in outcome.fault


def test_outputs_are_not_overwritten(run, tmp_path):
    path = tmp_path / "a.film.png"
    path.write_bytes(b"")
    (tmp_path / "a.record.nc").write_bytes(b"precious")
    outcome = run("digitise", path)
    assert outcome.status == 2
    assert "exists already" in outcome.fault
    other = tmp_path / "b.png"
    outcome = run("digitise", other, path, "-o", tmp_path / "a.record.nc")
    assert outcome.status == 2


def test_plot_draws_a_film_that_cannot_be_read_and_says_why(run, tmp_path):
    from PIL import Image

    pytest.importorskip("matplotlib")
    path = tmp_path / "sky.png"
    Image.fromarray(np.full((800, 300), 200, dtype=np.uint8)).save(path)
    outcome = run("plot", path)
    assert outcome.status == 3
    assert (tmp_path / "sky.film.png").stat().st_size > 1000
    outcome = run("plot", path, "--force", "--from", "3", "--to", "2")
    assert outcome.status == 2
    assert "--to 2 is not after --from 3" in outcome.fault


def test_times_go_with_films_only(run, record_path):
    pytest.importorskip("matplotlib")
    outcome = run("plot", record_path, "--from", "3")
    assert outcome.status == 2
    assert "image of a film" in outcome.fault
