"""Marks and gaps: where they fall, how wide they are, which of them chance takes."""

from __future__ import annotations

import numpy as np
import pytest
from made_films import SMALL, latent, planned, rest

from data_schemas.scene_recording import Film
from synth.film.layout import light_of, set_marks


def test_marks_are_multiples_of_the_interval_and_minutes_have_two():
    marks = set_marks(Film(), 59.2, 121.0, 0)
    regular = marks.time[marks.minute == 0]
    np.testing.assert_allclose(regular, np.arange(59.5, 121.25, 0.5))
    np.testing.assert_allclose(marks.time[marks.minute == 1], [60.125, 120.125])
    assert np.all(np.diff(marks.time) > 0)


def test_without_a_code_or_without_marks():
    assert not set_marks(Film(minute_code=0.0), 0.0, 130.0, 0).minute.any()
    assert not set_marks(Film(gap=0.0), 0.0, 130.0, 0).time.size


def test_marks_go_missing_and_come_false_as_often_as_is_said():
    marks = set_marks(Film(missing_marks=0.2, spurious_marks=30), 0.0, 3600.0, 4)
    assert marks.spurious.sum() == 30
    assert not (marks.missing & marks.spurious).any()
    part = marks.missing[marks.spurious == 0].mean()
    assert part == pytest.approx(0.2, abs=4 * (0.16 / 7261) ** 0.5)
    code = marks.time[marks.minute == 1]
    full = np.searchsorted(marks.time, code - 0.125)
    np.testing.assert_array_equal(marks.missing[marks.minute == 1], marks.missing[full])  # a missing minute misses both


def test_light_is_off_where_any_reason_says_so():
    film = Film(
        gap=0.1, minute_code=0.0, blackouts=[[0.6, 1.02]], dimmings=[[0.2, 0.7, 0.5], [0.3, 2.0, 0.5]], lamp=4.0
    )
    marks = set_marks(film, 0.0, 2.0, 0)
    light = light_of(film, marks, 0.0, 2.0, [(1.7, 1.8)])
    found = list(zip(light.begin.round(9), light.end.round(9), light.factor, strict=True))
    assert found == [
        (0.05, 0.2, 4.0), (0.2, 0.3, 2.0), (0.3, 0.45, 1.0), (0.55, 0.6, 1.0), (1.05, 1.45, 2.0), (1.55, 1.7, 2.0),
        (1.8, 1.95, 2.0),
    ]  # fmt: skip


@pytest.mark.parametrize("gap", [0.03, 0.2])
def test_a_gap_is_as_wide_as_the_shutter_is_closed_and_centred_on_its_mark(gap):
    film = Film(**SMALL | {"gap": gap, "minute_code": 0.0}, dpi=600)
    plan = planned(film, rest, seconds=3.0)
    light = latent(plan).sum(axis=1, dtype=float)
    light /= light.max()
    row = plan.geometry.row_at_left(plan.transport.travel(np.array([1.5])))[0]
    assert row == pytest.approx((2.0 + 7.5) * 600 / 25.4)
    near = np.arange(int(row) - 25, int(row) + 26)
    lost = 1.0 - light[near]
    assert lost.sum() == pytest.approx(gap * 5.0 * 600 / 25.4, rel=1e-5)
    assert (lost * (near + 0.5)).sum() / lost.sum() == pytest.approx(row, abs=1e-4)


def test_the_marks_of_the_truth_are_where_the_light_is_lost_however_the_film_lies():
    film = Film(**SMALL | {"gap": 0.1}, minute_code=0.0, skew=2.0, rotation=1.0)
    plan = planned(film, rest, seconds=2.0)
    lost = latent(planned(film.model_copy(update={"gap": 0.0}), rest, seconds=2.0)) - latent(plan)
    row = plan.geometry.row_at_left(plan.transport.travel(np.array([1.0])))[0]
    first = int(row) - 12  # the line of one moment runs down to the right by tan(skew - rotation)
    part = lost[first : first + 28]
    y, x = np.arange(len(part)) + first + 0.5, np.arange(part.shape[1]) + 0.5
    centre_row = (part.sum(axis=1) * y).sum() / part.sum()
    centre_column = (part.sum(axis=0) * x).sum() / part.sum()
    assert centre_row == pytest.approx(row + np.tan(np.radians(1.0)) * centre_column, abs=0.02)
