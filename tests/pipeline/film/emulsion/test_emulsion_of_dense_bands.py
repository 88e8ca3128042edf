"""The emulsion of slow films, told from their dense bands."""

from __future__ import annotations

import numpy as np
import pytest
from spot_film import CONTRAST, DENSEST, FOG, MIDDLE, SCANNER, SPOT, Sheet, Swinging, developed, exposure_of, shutter

from pipeline.film.emulsion import FilmEmulsion, ToneCurve, measure_blank
from pipeline.film.marks.dense import dense_emulsion, fitted_curve, grain_growth
from pipeline.film.marks.dense_kernels import NODES, SIZE, draw_curve, node_table

PERIOD, LAMP = 17.9, 4.0
TRUE = ToneCurve((DENSEST - FOG) / SCANNER, MIDDLE / LAMP, CONTRAST)


def pixels(curve: ToneCurve, grain: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    light = np.exp(rng.uniform(np.log(4e-3), np.log(0.4), 40_000))
    shade = curve.darkness(light)
    return light, shade + np.sqrt(grain[0] + grain[1] * shade) * rng.normal(size=light.size)


def test_a_curve_is_fitted_to_what_pixels_show_though_one_in_ten_lies_in_a_gap():
    light, dark = pixels(TRUE, (5e-5, 1e-3))
    dark[::10] = 0.0
    found = fitted_curve(light, dark, ToneCurve(1.05 * TRUE.darkest, 0.2, 1.6))
    assert found is not None
    grid = np.geomspace(0.01, 0.3, 20)
    # gaps draw each median down by a tenth of a half of its pixels: 0.14 sigma
    assert found.darkness(grid) == pytest.approx(TRUE.darkness(grid), rel=0.04)


def test_too_few_pixels_tell_no_curve():
    assert fitted_curve(np.full(20, 0.1), np.full(20, 0.3), TRUE) is None
    assert fitted_curve(np.full(4000, 0.1), np.full(4000, 0.3), TRUE) is None  # all of one light


def test_grain_is_told_where_errors_of_the_curves_add_least():
    light, dark = pixels(TRUE, (5e-5, 1e-3))
    shade = TRUE.darkness(light)
    blurred = dark + TRUE.rate(light) * light * np.random.default_rng(2).normal(scale=0.3, size=light.size)
    assert grain_growth(dark, shade, 5e-5) == pytest.approx(1e-3, rel=0.1)
    assert 1e-3 < grain_growth(blurred, shade, 5e-5) < 3e-3


def test_a_curve_is_drawn_as_a_spot_draws_it():
    trace = Swinging(100.0, 45.0, 0.0, PERIOD)
    light = exposure_of([trace], 60, 200)
    shape = np.zeros(SIZE)
    middle = 30.0
    angle = 2.0 * np.pi * middle / PERIOD
    shape[0], shape[4], shape[7] = 100.0, 45.0 * np.cos(angle), -45.0 * np.sin(angle)
    course, slope = node_table(PERIOD, SPOT) @ shape
    node = PERIOD / NODES
    away = (np.arange(course.size) - 0.5 * (course.size - 1)) * node
    assert course == pytest.approx(trace.column(middle + away), abs=1e-9)
    picture = np.zeros((60, 180))
    draw_curve(picture, middle + away[0], 10, node, course, slope, SPOT)
    # a spot ends at 3 sigma, where 0.011 of its light is left
    assert picture[20:40] == pytest.approx(light[20:40, 10:190], abs=0.015 * light.max())


def test_exposure_is_that_of_the_darkness():
    image = np.random.default_rng(3).integers(1, 256, (300, 200)).astype(np.uint8)
    emulsion = FilmEmulsion(0.0, 0.0, TRUE, np.array([5e-5, 1e-3]), 255, measure_blank(Sheet(image)))
    expected = TRUE.exposure(emulsion.darkness(image, 0))
    seen = emulsion.exposure(image, 0)
    inside = expected < 1.0  # in the table's steps, which are wide where the film is saturated
    assert seen[inside] == pytest.approx(expected[inside], rel=0.02, abs=1e-3)


@pytest.mark.compiled
def test_the_emulsion_of_a_slow_film_is_told_from_its_bands():
    traces = [Swinging(100.0, 45.0, 0.3, PERIOD, slow=40.0, slow_period=150.0), Swinging(290.0, 60.0, 2.0, PERIOD)]
    film = LAMP * exposure_of(traces, 700, 370, shutter(700, 8.86, 0.52))
    emulsion = dense_emulsion(Sheet(developed(film, grain=0.04)), 2)
    grid = np.geomspace(0.01, 0.3, 20)
    assert emulsion.curve.darkness(grid) == pytest.approx(TRUE.darkness(grid), rel=0.1)
    assert emulsion.curve.darkest == pytest.approx(TRUE.darkest, rel=0.05)
    growth = (0.04 / SCANNER) ** 2 * SCANNER
    assert 0.7 * growth < emulsion.grain[1] < 2.5 * growth  # rather too much than too little
