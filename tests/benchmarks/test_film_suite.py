"""The suite `film` on one short film: every reader gives a row, what is written is there, promises are told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from data_schemas.errors import IsochronyError, RefusedError
from data_schemas.scene_recording import Film
from pipeline.benchmarks import film
from pipeline.benchmarks.film import Case, cases, hard_films, scene, touching

pytest.importorskip("tifffile")
READERS = {"isochrony", "column argmax", "centroid"}


def test_every_axis_has_its_ends() -> None:
    quick, full = list(cases(60.0, quick=True)), list(cases(60.0, quick=False))
    assert {case.axis for case in quick} == {case.axis for case in full}
    assert len(quick) == 10
    assert len(full) == 15
    assert all(case.film.grain == film.GRAIN for case in full if case.axis != "grain")


@pytest.mark.compiled
def test_one_film_is_read_by_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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
    bars = [row for row in rows if "bar" in row]
    assert bars[0]["pass"] is None


@pytest.mark.compiled
def test_a_refused_film_has_its_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise RefusedError("no trace")

    monkeypatch.setattr(film, "own_reading", refuse)
    monkeypatch.setattr(film, "peers", lambda path, truth: iter(()))
    (row,) = film.rows_of(Case("grain", 0.02, scene(10.0), Film()), tmp_path / "a.film.tif")
    assert row["refused"] == "no trace"
    assert row["accepted"] == 0.0


def test_hard_films_are_judged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Read, refused, wrong, hardly read: only the wrong one fails, and only the well read one counts."""

    def found(accepted: float, wrong: float) -> dict[str, float]:
        return {"accepted": accepted, "wrong_unflagged": wrong, "slipped": 0.0}

    answers = iter([found(0.9, 0.0), RefusedError("no"), found(0.9, 0.01), found(0.2, 0.0)])

    def answer(*_: object) -> dict[str, float]:
        given = next(answers)
        if isinstance(given, Exception):
            raise given
        return given

    some = dict.fromkeys("abcd", Film(speed=1.0, lever=500.0, paper_width=40.0))
    monkeypatch.setattr(film, "HARD_SECONDS", 2.0)
    monkeypatch.setattr(film, "hard_films", lambda seconds: some)
    monkeypatch.setattr(film, "own_reading", answer)
    rows = list(film.hard(tmp_path / "a.film.tif"))
    assert [row["pass"] for row in rows] == [True, True, False, True, False]
    assert rows[1]["bar"] == "b: refused"
    assert rows[-1]["value"] == 1.0


@pytest.mark.compiled
def test_touching_traces_touch() -> None:
    assert 15.0 < touching(300.0) < 30.0
    assert len(hard_films(60.0)) == 7


@pytest.mark.compiled
def test_a_landscape_is_no_film(tmp_path: Path) -> None:
    """Clouds over a ridge are declined."""
    import tifffile
    from scipy.ndimage import gaussian_filter

    from pipeline.film.digitise import digitise
    from pipeline.film.knowledge import FilmOptions

    chance = np.random.default_rng(0)
    clouds = sum(size * gaussian_filter(chance.normal(size=(2000, 1500)), size) for size in (3.0, 12.0, 50.0))
    picture = 150.0 + 60.0 * np.asarray(clouds)
    ridge = 1300.0 + 150.0 * gaussian_filter(chance.normal(size=1500), 60.0) * 60.0
    picture[np.arange(2000)[:, None] > ridge] -= 90.0
    path = tmp_path / "landscape.tif"
    tifffile.imwrite(path, np.clip(picture, 0, 255).astype(np.uint8), resolution=(300, 300), resolutionunit="INCH")
    with pytest.raises(IsochronyError):
        digitise(path, options=FilmOptions(traces=("1",), periods={"": 1.01}))
