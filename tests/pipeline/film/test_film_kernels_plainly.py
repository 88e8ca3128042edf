"""The kernels of marks and strobe on a few gaps, small enough to run uncompiled."""

from __future__ import annotations

import math

import numpy as np
import pytest
from mark_lists import Case, made, slips
from small_film import Film, film

from pipeline.film.marks import gap_kernels
from pipeline.film.marks.axis import axis_of
from pipeline.film.marks.dense_kernels import SIZE, Known, fit_block, node_table, values
from pipeline.film.marks.gap_kernels import Patch, draw, place
from pipeline.film.marks.search import brightness_along, fitted, light_at_rest
from pipeline.film.parts import Marking


@pytest.fixture(scope="module")
def moment() -> Film:
    return film(2.6, columns=220, sizes=(60.0,), middles=(110.0,), course_error=0.0)


def test_a_minute_of_marks_is_counted() -> None:
    truth = made(Case(minutes=1.1, missing=0.1, unseen=0.0, start=58.0))
    found = axis_of(truth.search(), truth.tracks, Marking(minute_code=0.125))
    away = slips(found.index, found.row, truth)
    assert np.all(away == away[0])


def test_gaps_of_three_swings_are_fitted(moment: Film) -> None:
    exposure = moment.emulsion.exposure(moment.scan.image, 0)
    inside = (moment.row[0] > 40) & (moment.row[0] < moment.scan.rows - 40)
    guesses = moment.row[0][inside] + 0.4
    traces = np.zeros(guesses.size, dtype=np.int64)
    out = fitted(exposure, 0, moment.emulsion, moment.tracks, traces, guesses, 0.03 * moment.speed)
    assert np.allclose(out[:, gap_kernels.ROW], moment.row[0][inside], atol=0.12)
    assert np.allclose(out[:, gap_kernels.COLUMN], moment.column[0][inside], atol=0.6)
    assert np.allclose(out[:, gap_kernels.DEPTH], 1.0, atol=0.15)


def test_a_gap_at_the_end_of_a_trace_is_not_fitted(moment: Film) -> None:
    exposure = moment.emulsion.exposure(moment.scan.image, 0)
    out = fitted(exposure, 0, moment.emulsion, moment.tracks, np.zeros(1, dtype=np.int64), np.array([1.0]), 1.8)
    assert np.all(np.isnan(out))


def test_brightness_is_one_in_the_open_and_none_in_gaps(moment: Film) -> None:
    exposure, tracks = moment.emulsion.exposure(moment.scan.image, 0), moment.tracks
    rows = 50 + (np.arange(240) + 0.5) / 4
    line = tracks.course[0], tracks.slope[0], tracks.curvature[0]
    light, dark = brightness_along(exposure, 0, *line, rows, tracks.spot, 0.0, 1.8)
    assert np.nanmedian(light) == pytest.approx(1.0, abs=0.15)
    away = np.abs(rows[:, None] - moment.row[0][None, :]).min(axis=1)
    lean = np.abs(np.interp(rows - 0.5, np.arange(moment.scan.rows), tracks.slope[0]))
    assert np.all(light[(away < 0.3) & (lean > 3.0)] < 0.5)
    assert np.all((dark >= 0.0) & (dark <= 1.0 + 1e-9))


def test_a_spot_holds_its_light_and_its_derivatives() -> None:
    image, across, along = (np.zeros((15, 15)) for _ in range(3))
    draw(Patch(image, across, along, 0, 0), 7.3, 7.9, -3.0, 1.0, 1.2, True)
    assert image.sum() == pytest.approx(math.sqrt(2.0 * math.pi) * 1.2, rel=2e-3)
    assert (image.sum(axis=0) @ (np.arange(15) + 0.5)) / image.sum() == pytest.approx(7.9, abs=1e-2)
    moved = np.zeros((2, 15, 15))
    for k, by in enumerate((-1e-4, 1e-4)):
        draw(Patch(moved[k], across, along, 0, 0), 7.3, 7.9 + by, -3.0, 1.0, 1.2, False)
    assert np.allclose((moved[1] - moved[0]) / 2e-4, across, atol=1e-5)
    assert np.allclose(along, -3.0 * across)


def test_light_of_a_line_is_its_dwell_time() -> None:
    for slope in (0.0, 1.0, 3.0, 12.0):
        assert light_at_rest(slope, 0.0, 1.2, 1e3) == pytest.approx(1.0 / math.hypot(1.0, slope), rel=2e-3)


def test_a_curve_is_a_cubic_between_rows() -> None:
    rows = np.arange(12) + 0.5
    column, lean = place(rows**3, 3.0 * rows**2, 6.2)
    assert column == pytest.approx(6.2**3, rel=1e-12)
    assert lean == pytest.approx(3.0 * 6.2**2, rel=1e-12)
    assert math.isnan(place(rows**3, 3.0 * rows**2, 12.1)[0])


def test_a_block_of_swings_finds_its_line() -> None:
    made_slowly = film(3.2, speed=17.717, columns=120, sizes=(30.0,), middles=(60.0,))
    exposure = made_slowly.emulsion.exposure(made_slowly.scan.image, 0)
    period, middle = 1.00966 * 17.717, 0.5 * made_slowly.scan.rows
    phase = 2 * np.pi * np.interp(middle, *made_slowly.clock) / 1.00966 + 0.4
    shape = np.zeros(SIZE)
    shape[0], shape[4], shape[7] = 61.0, 29.0 * np.cos(phase + 0.15), -29.0 * np.sin(phase + 0.15)
    known = Known(period, 1.18, 1.0, 1.0, node_table(period, 1.18))
    assert fit_block(exposure, 0, shape, middle, known)[1] > 0.6
    away = np.linspace(-0.7, 0.7, 60) * period
    column, slope, _ = values(shape, away, period)
    true = np.interp(middle + away - 0.5, np.arange(made_slowly.scan.rows), made_slowly.tracks.course[0])
    away = (column - true) / np.hypot(1.0, slope)
    assert np.median(np.abs(away)) < 0.15
