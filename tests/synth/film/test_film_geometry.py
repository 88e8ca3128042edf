"""Where the paper lies on the scanner, and what is refused because it would not fit."""

from __future__ import annotations

import numpy as np
import pytest
from made_films import SMALL, planned, ramp, rest, swing

from data_schemas.errors import UsageError
from data_schemas.scene_recording import Film
from synth.film.layout import geometry_of

NONE = np.zeros(1)


def test_the_size_of_the_image():
    map_ = geometry_of(Film(margin=10.0), 300.0, NONE)
    assert (map_.rows, map_.columns) == (round(320 * 300 / 25.4), 1500)
    assert map_.row_at_left(np.array([0.0]))[0] == pytest.approx(10 * 300 / 25.4)


@pytest.mark.parametrize("rotation", [-2.0, 0.0, 3.0])
@pytest.mark.parametrize("skew", [-3.0, 0.0, 1.0])
def test_the_map_keeps_lengths_and_has_its_inverse(rotation, skew):
    map_ = geometry_of(Film(rotation=rotation, skew=skew, stretch_along=0.01), 300.0, np.array([-1.5, 2.0]))
    along, across = np.array([0.0, 300.0, 0.0]), np.array([0.0, 0.0, 127.0])
    row, column = map_.rows_of(along, across), map_.columns_of(along, across)
    assert np.hypot(row[1] - row[0], column[1] - column[0]) == pytest.approx(300 * 1.01 * 300 / 25.4)
    assert np.hypot(row[2] - row[0], column[2] - column[0]) == pytest.approx(1500 / np.cos(np.radians(skew)))
    np.testing.assert_allclose(map_.along_at_left(map_.row_at_left(along)), along, atol=1e-9)
    # everything that is written lies on the paper: margins and offsets are inside
    left, right = map_.paper_edges(0, map_.rows)
    y = np.clip(row.astype(int), 0, map_.rows - 1)
    assert np.all(column >= left[y] - 0.6)
    assert np.all(column <= right[y] + 0.6)


@pytest.mark.parametrize("rotation", [-2.0, 0.5])
def test_the_paper_has_its_area(rotation):
    map_ = geometry_of(Film(rotation=rotation), 100.0, NONE)
    left, right = map_.paper_edges(0, map_.rows)
    assert np.sum(right - left) == pytest.approx(map_.length * map_.width, rel=1e-4)
    assert np.all(left >= -1e-9)
    assert np.all(right <= map_.columns + 0.6)


def test_a_swing_over_the_edge_is_refused_with_a_lever_that_fits():
    with pytest.raises(UsageError, match=r"trace '1' would reach from -?[\d.]+ to [\d.]+ mm.*lever = (\d+)") as fault:
        planned(Film(**SMALL | {"lever": 2000.0}), swing())
    lever = float(str(fault.value).split("lever = ")[1].split()[0])
    planned(Film(**SMALL | {"lever": lever}), swing())


@pytest.mark.parametrize("position", [4.0, 21.0])
def test_one_edge_is_enough_to_refuse(position):
    film = Film(**SMALL, traces=[{"name": "1", "position": position}])
    with pytest.raises(UsageError, match=r"over the edge of a paper of 25 mm"):
        planned(film, swing(0.01))
    planned(film, swing(0.007))


def test_a_skew_that_turns_the_line_back_is_refused():
    film = Film(**SMALL, skew=8.0)
    planned(film, swing(0.006))
    with pytest.raises(UsageError, match="run backwards along the film; make their difference less than"):
        planned(film, swing(0.012))
    planned(Film(**SMALL, skew=4.0, rotation=4.0), swing(0.012))  # lit at once along the image's rows


def test_a_crooked_long_film_is_refused():
    with pytest.raises(UsageError, match=r"rotation = 5 degrees would spread a film of [\d.]+ m over \d+ columns"):
        geometry_of(Film(rotation=5.0), 20_000.0, NONE)
    with pytest.raises(UsageError, match="image would have"):
        geometry_of(Film(dpi=4800), 2e8, NONE)


def test_unknown_traces_are_refused_and_places_are_kept():
    with pytest.raises(UsageError, match=r"film\.traces names '7'; the record has 1, 2"):
        planned(Film(**SMALL, traces=[{"name": "7"}]), rest, rest)
    film = Film(**SMALL, traces=[{"name": "2", "position": 20.0, "offset": 1.5, "lever": 100.0}])
    layout = planned(film, ramp(1e-4, 0.0), rest).layout
    assert layout.position.tolist() == [6.25, 20.0]
    assert layout.offset.tolist() == [0.0, 1.5]
    assert layout.lever.tolist() == [500.0, 100.0]
