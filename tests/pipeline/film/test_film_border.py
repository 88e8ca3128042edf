"""The scanner's border beside a film is overlaid, also where it is oblique; vignettes, scratches and traces are not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.film.scan.files import ImageFile, in_memory
from pipeline.film.scan.opening import border_of, lines_are_light, without_border

ROWS, COLUMNS = 1200, 400


def film(*, left=0.0, right=0.0, tilt=0.0, border=250.0, vignette=0.0, seed=0) -> ImageFile:
    rows, columns = np.arange(ROWS)[:, None], np.arange(COLUMNS)
    grey = 205.0 * (1.0 - vignette * ((columns - 200.0) / 200.0) ** 2) + np.zeros((ROWS, 1))
    line = 200.0 + 60.0 * np.sin(rows / 9.0)
    grey = grey - 100.0 * np.exp(-0.5 * ((columns - line) / 3.0) ** 2)
    grey[:, 330:332] = 120.0  # a scratch along the film
    outside = (columns < left + tilt * rows) | (columns >= COLUMNS - right + tilt * rows)
    if left or right:
        grey[outside] = border
    grey += 3.0 * np.random.default_rng(seed).standard_normal(grey.shape)
    return in_memory(np.clip(np.round(grey), 0, 255).astype(np.uint8), Path("a"))


@pytest.mark.parametrize("border", [250.0, 30.0])
@pytest.mark.parametrize("tilt", [0.0, 0.01, -0.01])
def test_border_shows_blank_film_and_the_film_stays(border, tilt):
    image = film(left=35.0, right=50.0, tilt=tilt, border=border)
    covered = without_border(image)
    assert all(border_of(image))
    shown = covered.read(0, ROWS).astype(float)
    assert np.abs(shown[:, :20] - 205.0).max() < 15.0
    assert np.abs(shown[:, -20:] - 205.0).max() < 15.0
    np.testing.assert_array_equal(shown[:, 70:320], image.read(0, ROWS)[:, 70:320])
    np.testing.assert_array_equal(covered.read(700, 731), shown[700:731])


def test_one_side_alone():
    left, right = border_of(film(left=40.0))
    assert right is None
    assert left.start == pytest.approx(40.0, abs=4.0)


def test_a_border_that_leaves_the_image_is_overlaid_as_far_as_it_goes():
    image = film(left=15.0, tilt=-0.03)
    covered = without_border(image)
    assert border_of(image)[0].slope == pytest.approx(-0.03, abs=0.003)
    assert np.abs(covered.read(0, ROWS)[:, :60].astype(float) - 205.0).max() < 18.0


@pytest.mark.parametrize("vignette", [0.0, 0.15, 0.3])
def test_film_without_border_is_left_alone(vignette):
    image = film(vignette=vignette)
    assert without_border(image) is image


def test_what_lies_above_and_below_a_film_does_not_tell_whether_its_lines_are_light():
    covered = without_border(film(left=35.0, right=50.0, seed=2))
    grey = np.array(covered.read(0, ROWS))
    grey[:70] = grey[-70:] = 250  # the scanner's bed
    edge = np.arange(COLUMNS) < 200
    grey[70:76, edge] = grey[-76:-70, edge] = 250  # oblique
    assert lines_are_light(in_memory(grey, Path("a"))) is False
    assert lines_are_light(in_memory(255 - grey, Path("a"))) is True
