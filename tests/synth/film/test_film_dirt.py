"""Dirt: strokes where they are said to be, as much as is said, and the same however the film is cut."""

from __future__ import annotations

import numpy as np
import pytest
from made_films import SMALL, planned, rest

from data_schemas.errors import UsageError
from data_schemas.scene_recording import Film
from synth.film.dirt import Dirt, draw_strokes


def soiled(film, rows=1024, first=0, plan=None):
    plan = planned(film, rest, seconds=1.0) if plan is None else plan
    image = np.full((rows, plan.geometry.columns), 0.1, np.float32)
    Dirt(film, plan.geometry, 9).soil(image, first)
    return image


def test_a_stroke_covers_its_area():
    image = np.zeros((60, 80), np.float32)
    draw_strokes(image, 100, np.array([[120.0, 20.0, 140.0, 60.0, 3.0, 1.0]]))
    length = np.hypot(20, 40)
    assert image.sum() == pytest.approx(6.0 * length + np.pi * 9.0, rel=0.01)
    assert image[30, 40] == 1.0
    draw_strokes(image, 100, np.array([[130.0, 40.0, 130.0, 40.0, 50.0, 0.2]]))
    assert image[30, 40] == pytest.approx(0.2)


def test_a_clean_film_stays_clean():
    assert np.all(soiled(Film(**SMALL)) == np.float32(0.1))


def test_dust_is_as_much_as_is_said():
    plan = planned(Film(**SMALL), rest, seconds=1.0)
    specks = [len(Dirt(Film(**SMALL, dust=800), plan.geometry, 9)._dust(k)) for k in range(40)]
    area = 1024 * plan.geometry.columns / (300 / 25.4) ** 2 / 1e4
    assert np.mean(specks) == pytest.approx(800 * area, abs=4 * (800 * area / 40) ** 0.5)


@pytest.mark.parametrize("kind", [{"dust": 300.0}, {"scratches": 300.0}, {"handwriting": 3}])
def test_dirt_does_not_depend_on_the_strip_it_is_drawn_in(kind):
    film = Film(**SMALL, **kind)
    plan = planned(film, rest, seconds=1.0)
    dirt = Dirt(film, plan.geometry, 9)
    whole = np.full((2048, plan.geometry.columns), 0.1, np.float32)
    if film.dust:  # whatever lies on both strips comes from three
        for number in (-1, 0, 1, 2):
            draw_strokes(whole, 0, dirt._dust(number))
    else:
        draw_strokes(whole, 0, dirt._strokes)
    assert np.any(whole != np.float32(0.1))
    lower = soiled(film, 1024, 1024, plan)
    np.testing.assert_array_equal(soiled(film, 1024, 0, plan), whole[:1024])
    np.testing.assert_array_equal(lower, whole[1024:])


def test_a_torn_end_has_lost_at_least_what_is_said_and_not_much_more():
    film = Film(**SMALL, torn_end=3.0)
    plan = planned(film, rest, seconds=4.0)
    image = soiled(film, plan.geometry.rows, 0, plan)
    left = (image > 0).sum(axis=0) / (300 / 25.4)
    length = plan.geometry.length / (300 / 25.4)
    assert left.max() <= length - 3.0 + 0.1
    assert left.max() >= length - 3.0 - 0.2
    assert left.min() > length - 15.0
    assert np.ptp(left) > 0.3  # jagged
    with pytest.raises(UsageError, match="torn_end = 90 mm leaves nothing of a film of"):
        soiled(Film(**SMALL, torn_end=90.0))
