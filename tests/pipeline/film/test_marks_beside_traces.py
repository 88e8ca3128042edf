"""Marks beside the traces, on films of the independent renderer: found, counted, timed; and the direction of time."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("tifffile")  # of the extra `film`

from data_schemas.errors import RefusedError
from data_schemas.film_description import load_description
from pipeline.film.digitise import make_record, read
from pipeline.film.knowledge import FilmOptions
from pipeline.film.marks.lines import Lines, fitted, lines_across, noise_of, shown
from pipeline.film.normal_points import row_times
from tests.films import make, plain
from tests.films.kinds import Case

CASE = Case(duration=(75.0, 75.0), missing=0.02)
BESIDE = {"dark lines": {}, "bright lines": {"fog": 0.3, "lamp": 0.2}, "edge": {"skew": 0.2}}
ALL = {"kind": "dark-lines", "noise": 0.01, "shear": 0.01, "shear_sigma": 0.0}

pytestmark = pytest.mark.compiled  # whole films are read


def expose(folder: Path, **changes):
    film = plain.expose(replace(CASE, **changes), np.random.default_rng(4))
    (image,) = make.save(film, folder, "night")
    image.with_name("night.film.toml").write_text(make.description(film, "night"))
    return image, make.truth_of(film)


def late(reading, truth, trace: int) -> np.ndarray:
    """By how much each row's time is late, s, but for the trace's own offset along the film."""
    times = row_times(reading.tracks, reading.axis, trace)
    away = times - np.array(truth["traces"][trace]["time_of_row"]) - truth["chronometer_offset"]
    return away - np.nanmedian(away)


@pytest.mark.parametrize("style", BESIDE)
def test_time_by_marks_beside_traces_is_true(style: str, tmp_path: Path) -> None:
    image, truth = expose(tmp_path, style=style, **BESIDE[style])
    found, known = read(image)
    stated = make_record(found, known, "night")["instrument"].dataset  # how far the lamps lie apart, marks do not tell
    assert float(stated["delay_uncertainty"]) == pytest.approx(0.3 / (found.axis.rows_per_second * found.scale))
    assert found.axis.kind == style.replace(" ", "-")
    assert "marks-beside-traces" in found.axis.flags
    for trace in range(2):
        error = late(found, truth, trace)
        assert np.isfinite(error).mean() > 0.97
        assert np.nanmax(np.abs(error)) < 1e-3  # s, a fifth of a spot's dwell
        assert np.sqrt(np.nanmean(error**2)) < 2.5 * np.sqrt(np.nanmean(found.axis.seconds_sigma**2))
        place = np.array(truth["traces"][trace]["column_of_row"])
        away = found.tracks.position[trace] - place
        assert np.isfinite(away).mean() > (0.6 if style == "dark lines" else 0.9)  # rows under a line are not read
        assert np.nanmax(np.abs(away)) < 12.0


def test_tone_of_lines_is_told_by_the_film(tmp_path: Path) -> None:
    """A person sees the scan, which may be the film's negative."""
    image, truth = expose(tmp_path, style="bright lines", **BESIDE["bright lines"])
    known = load_description(image.with_name("night.film.toml")).model_copy(update={"mark_kind": "dark-lines"})
    found, _ = read(image, known)
    assert found.axis.kind == "bright-lines"
    assert np.nanmax(np.abs(late(found, truth, 0))) < 1e-3


def test_wire_across_all_light_is_read_by_gaps(tmp_path: Path) -> None:
    image, truth = expose(tmp_path, style="wire", fog=0.1)
    found, _ = read(image)
    assert found.axis.kind == "gaps"
    assert np.nanmax(np.abs(late(found, truth, 0))) < 1e-3


def test_stated_kind_that_is_not_there_is_refused(tmp_path: Path) -> None:
    image, _ = expose(tmp_path, duration=(30.0, 30.0), missing=0.0)
    known = load_description(image.with_name("night.film.toml")).model_copy(update={"mark_kind": "dark-lines"})
    with pytest.raises(RefusedError, match=r"no lines run across it.*mark_kind"):
        read(image, known)


def test_stated_orientation_against_the_code_is_refused(tmp_path: Path) -> None:
    image, _ = expose(tmp_path, missing=0.0, reversed=True)
    assert any("upside down" in note for note in read(image)[0].scan.notes)
    with pytest.raises(RefusedError, match=r"--orientation given, the minute code reads backwards"):
        read(image, options=FilmOptions(orientation="0"))


def test_sway_tells_which_way_up_a_film_lies(tmp_path: Path) -> None:
    """A ship sways the pendulums, not their difference, even where marks do not tell how time runs."""
    image, _ = expose(tmp_path, missing=0.0, code="none", reversed=True)
    found, _ = read(image)
    assert "marks-direction-unknown" in found.axis.flags
    assert any("upside down" in note for note in found.scan.notes)


def test_stated_orientation_is_the_direction_of_time(tmp_path: Path) -> None:
    image, _ = expose(tmp_path, missing=0.0, code="none")
    assert "marks-direction-unknown" in read(image)[0].axis.flags
    assert "marks-direction-unknown" not in read(image, options=FilmOptions(orientation="0"))[0].axis.flags


def peaks(rows: np.ndarray, places: np.ndarray, wide: np.ndarray) -> np.ndarray:
    return np.sum(np.exp(-0.5 * ((rows[:, None] - places) / wide) ** 2), axis=1)


def test_peaks_are_fitted_within_their_sigma() -> None:
    rng, rows = np.random.default_rng(2), np.arange(3000) + 0.5
    places = np.sort(np.concatenate([np.arange(20.3, 2980.0, 29.7), [621.3]]))  # one mark is a second one 7 rows on
    light = peaks(rows, places, np.where(np.arange(places.size) == 40, 4.0, 1.7)) + 0.01 * rng.standard_normal(3000)
    gaps = fitted(Lines(light=light, usual=light, **ALL))
    assert gaps.size == places.size
    pull = (gaps.row - places) / gaps.row_sigma
    assert 0.8 < np.sqrt(np.mean(pull**2)) < 1.25
    assert gaps.width[40] == pytest.approx(4.0 / 1.7, rel=0.05)


def test_lines_are_drawn_along_their_slant() -> None:
    rows = np.arange(400) + 0.5
    light = peaks(rows, np.array([100.0, 200.0]), np.array([2.0]))
    drawn = Lines(light=light, usual=light, **ALL).over(80, 60, 1000)
    expected = peaks(80.5 + np.arange(60) - 0.01 * 700.5, np.array([100.0, 200.0]), np.array([2.0]))
    np.testing.assert_allclose(drawn[:, 700], expected, atol=0.01)


def test_noise_of_groups_leaves_shared_marks_out() -> None:
    rng = np.random.default_rng(3)
    marks = np.where(np.arange(1000) % 30 < 8, 1.0, 0.0)
    each = marks + 0.05 * rng.standard_normal((16, 1000))
    assert noise_of(each, 1) == pytest.approx(0.05 * np.sqrt(np.pi / 2), rel=0.1)
    assert (shown(each[0], 0.05), shown(-each[0], 0.05), shown(each[0] - marks, 0.05)) == (1, -1, 0)


@pytest.mark.parametrize("columns", [300, 400, 700])
def test_lines_across_narrow_films_are_found(columns: int) -> None:
    rows, draw = np.arange(3000), np.random.default_rng(5)
    line = np.exp(-0.5 * ((rows % 30 - 12.3) / 1.2) ** 2)
    film = (0.3 * line[:, None] + 0.01 * draw.standard_normal((3000, columns))).astype(np.float32)
    found = lines_across(lambda first, stop: film[first:stop], 3000, columns)
    assert found is not None
    assert found.kind == "dark-lines"
    assert len(found.marks()[0]) == 100
