"""Paper that stood still: how long is told, or what is not certain has no time."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipeline.film import digitise
from pipeline.film.marks.alignment import Stand, light_across, swept, together
from pipeline.film.marks.alignment import bars as bars_of
from pipeline.film.marks.axis import axis_of
from pipeline.film.marks.lines import Lines
from pipeline.film.marks.search import GapSearch
from pipeline.film.parts import Marking, TimeAxis, Tracks
from tests.films.make import write
from tests.pipeline.film.mark_lists import Case, Made, made, slips

ABOUT = 0.3  # by which a bar's light misleads


def bars(case: Case, truth: Made, light: float, *, saturated: bool = False) -> list[list[Stand]]:
    """Bars as both traces show them."""
    rows = [
        float(np.interp(case.start + begin, truth.seconds, np.arange(truth.seconds.size) + 0.5))
        for begin, _ in case.stands
    ]
    lengths = [light * case.speed * stood for _, stood in case.stands]
    return [[Stand(*each, saturated) for each in zip(rows, lengths, strict=True)]] * case.traces


def read(case: Case, light: float, *, saturated: bool = False) -> tuple[TimeAxis, Made]:
    truth = made(case)
    marking = Marking(minute_code=case.code)
    found = bars(case, truth, light, saturated=saturated)
    return axis_of(truth.search(found), truth.tracks, marking), truth


def errors(axis: TimeAxis, truth: Made) -> np.ndarray:
    """Of the rows' times against each other, s."""
    away = axis.seconds - truth.seconds
    away = away[np.isfinite(away)]
    return np.asarray(away - np.median(away))


@pytest.mark.compiled
@pytest.mark.parametrize("stood", [0.5, 1.01, 2.02, 5.05])
@pytest.mark.parametrize("light", [1.0 - ABOUT, 1.0 + ABOUT])
def test_codes_on_both_sides_tell_how_long(stood: float, light: float) -> None:
    axis, truth = read(Case(minutes=6.0, stands=((131.3, stood),)), light)
    assert "film-stood-still" in axis.flags
    assert "film-cut" not in axis.flags
    assert np.all(slips(axis.index, axis.row, truth) == 0.0)
    assert np.abs(errors(axis, truth)).max() < 3e-3
    assert np.isfinite(axis.seconds).mean() > 0.98


@pytest.mark.compiled
@pytest.mark.parametrize("stood", [0.5, 1.01])
def test_without_codes_pendulums_and_light_tell_a_short_stand(stood: float) -> None:
    axis, truth = read(Case(minutes=3.0, code=None, stands=((81.3, stood),)), 1.0)
    assert np.abs(errors(axis, truth)).max() < 3e-3


@pytest.mark.compiled
@pytest.mark.parametrize("stood", [1.01, 2.02, 3.03, 5.05])
@pytest.mark.parametrize("light", [1.0 - ABOUT, 1.0 + ABOUT])
def test_a_ship_that_shakes_the_pendulums_never_makes_time_wrong(stood: float, light: float) -> None:
    axis, truth = read(Case(minutes=6.0, code=None, stands=((131.3, stood),)), light)
    assert np.abs(errors(axis, truth)).max() < 3e-3


@pytest.mark.compiled
def test_what_is_not_certain_has_no_time() -> None:
    axis, truth = read(Case(minutes=3.0, code=None, stands=((61.3, 5.05),)), 0.5, saturated=True)
    assert "film-cut" in axis.flags
    timed = np.flatnonzero(np.isfinite(axis.seconds))
    assert truth.seconds[timed[0]] > 61.3 + 3.2
    assert np.abs(errors(axis, truth)).max() < 3e-3


@pytest.mark.compiled
def test_several_stands_in_one_film() -> None:
    axis, truth = read(Case(minutes=10.0, stands=((90.2, 1.01), (250.7, 2.02), (431.1, 5.05))), 1.1)
    assert np.abs(errors(axis, truth)).max() < 3e-3
    assert np.isfinite(axis.seconds).mean() > 0.8  # a part with too few codes is cut off


@pytest.mark.compiled
@pytest.mark.parametrize("code", [0.125, None])
def test_a_bar_where_the_paper_never_stood_makes_no_time_wrong(code: float | None) -> None:
    """Dirt as long as the light of a second: pendulums say that none passed."""
    truth = made(Case(minutes=4.0, code=code))
    bar = Stand(float(truth.row[200]) + 12.0, 59.0, False)
    axis = axis_of(truth.search([[bar]] * 2), truth.tracks, Marking(minute_code=code))
    assert np.abs(errors(axis, truth)).max() < 3e-3


@pytest.mark.compiled
def test_long_marks_across_the_film_are_no_stands() -> None:
    """Their light lies on the swings, too."""
    truth = made(Case(minutes=7.0, code=None, traces=1, unseen=0.0))
    minutes = truth.row[np.mod(truth.number, 120.0) == 0.0]
    long = np.abs(truth.gaps.row[:, None] - minutes).min(axis=1) < 2.0
    gaps = replace(truth.gaps, width=np.where(long, 3.0, 1.0) * truth.gaps.width)
    dark = np.zeros(truth.seconds.size)
    lines = Lines("dark-lines", dark, dark, noise=0.01, shear=0.0, shear_sigma=0.0)
    bars = [[Stand(row, 59.0, False) for row in minutes.tolist()]]
    axis = axis_of(GapSearch(gaps, bars, truth.width, lines), truth.tracks, Marking(minute_code=0.0))
    assert "film-stood-still" not in axis.flags
    assert "film-cut" not in axis.flags
    assert np.all(slips(axis.index, axis.row, truth) == 0.0)


@pytest.mark.compiled
@pytest.mark.parametrize(("kind", "strength", "seed"), [("still 1.01 s", "middle", 1), ("still 5.05 s", "weak", 5)])
def test_a_bar_is_found_on_a_film_that_another_program_made(
    tmp_path: Path, kind: str, strength: str, seed: int
) -> None:
    (image,) = write(kind, strength, seed, tmp_path)
    (told,) = tmp_path.glob("*.truth.json")
    truth = json.loads(told.read_text(encoding="utf-8"))
    found, _ = digitise.read(image)
    times = np.array(truth["time_of_row"])
    away = found.axis.seconds[: times.size] - times[: found.axis.seconds.size]
    timed = np.isfinite(away)
    assert np.abs(away[timed] - np.median(away[timed])).max() < 1e-3
    assert timed.mean() > 0.97
    assert "film-stood-still" in found.axis.flags
    assert "film-cut" not in found.axis.flags


def test_a_bar_on_one_trace_alone_of_three_is_dirt() -> None:
    real = [Stand(100.0, 30.0, False)]
    assert len(together([real, [Stand(101.0, 25.0, False)], [Stand(100.5, 28.0, False)]], np.zeros(3))) == 1
    stray = [Stand(400.0, 30.0, False)]
    found = together([[*real, *stray], real, real], np.zeros(3))
    assert [round(each.row) for each in found] == [100]


def test_a_faint_bar_counts_where_another_trace_has_a_sure_one() -> None:
    sure, faint = Stand(100.0, 30.0, False), Stand(101.0, 20.0, False, sure=False)
    none = np.zeros(2)
    assert len(together([[sure], [faint]], none)) == 1
    assert together([[faint], [faint]], none) == []
    assert together([[sure], []], none) == []
    assert len(together([[sure], None], none)) == 1


@pytest.mark.parametrize("sway", [0.0, 60.0, 150.0])
@pytest.mark.parametrize("lost", [False, True])
def test_a_bar_shows_wherever_the_ship_sways_the_swing_to(sway: float, lost: bool) -> None:
    """The light of a stand of one swing lies where that swing is, not where most are; the trace is lost beside it."""
    row, at = np.arange(1500), 733
    middle = 500.0 + sway * np.sin(2.0 * np.pi * row / 600.0)
    tracks = Tracks.empty(1, row.size, 57.0, 1.5)
    tracks.course[0] = middle + 100.0 * np.cos(2.0 * np.pi * row / 57.0)
    exposure = np.zeros((row.size, 1000), dtype=np.float32)
    for k, column in enumerate(tracks.course[0]):
        exposure[k, round(column) - 5 : round(column) + 6] += 0.1
    exposure[at : at + 4, round(middle[at]) - 98 : round(middle[at]) + 98] += 0.2
    if lost:
        tracks.course[0, at - 40 : at + 40] = np.nan
    across = swept(tracks, 1000)
    still: Any = SimpleNamespace(noise=lambda exposure: np.full(exposure.shape, 1e-3))
    (found,) = bars_of(light_across(exposure, 0, across), across, tracks, still)
    assert found is not None
    assert [round(each.row) for each in found if each.sure] == [at + 2]


@pytest.mark.parametrize("apart", [30.0, 70.0, 140.0, 400.0])
def test_a_bar_is_sought_across_half_of_a_swing_at_least(apart: float) -> None:
    """Two traces that cross: near its turn, a stroke fills a few columns at once."""
    tracks = Tracks.empty(2, 600, 57.0, 1.5)
    turn = np.cos(2.0 * np.pi / 57.0 * np.arange(600))
    tracks.course[:] = 700.0 + 100.0 * turn, 700.0 + apart + 110.0 * turn
    for own, half in zip(swept(tracks, 1500), (100.0, 110.0), strict=True):
        assert own is not None
        assert np.ptp(own.aside) > 0.7 * half


@pytest.mark.parametrize("exchanged", [True, False])
def test_traces_keep_their_names_where_the_paper_stood(exchanged: bool) -> None:
    """Two traces of different places and swings; the tracker went on along the other behind row 4000."""
    rows = np.arange(8000.0)
    tracks = Tracks.empty(2, rows.size, 60.0, 2.0)
    true = np.stack([400.0 + 50.0 * np.sin(0.1 * rows), 530.0 + 40.0 * np.sin(0.1 * rows + 1.0)])
    found = true.copy()
    if exchanged:
        found[:, 4000:] = found[::-1, 4000:]
    found[1, 4000:4500] = np.nan
    tracks.course[:], tracks.position[:] = found, found
    tracks.named_over(4000.3)
    seen = np.isfinite(tracks.course)
    assert np.array_equal(tracks.course[seen], true[seen])
    assert np.array_equal(tracks.position[seen], true[seen])
    assert seen.sum() == 2 * rows.size - 500
