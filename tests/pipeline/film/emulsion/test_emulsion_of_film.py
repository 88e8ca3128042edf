"""Blank film, curve and grain, found on small films of known make."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, gaussian_filter1d
from spot_film import (
    CONTRAST,
    DENSEST,
    FOG,
    MIDDLE,
    SCANNER,
    SPOT,
    Sheet,
    Swinging,
    developed,
    exposure_of,
    shutter,
)

from pipeline.film.emulsion import (
    HIGHEST_EXPOSURE,
    UNTOLD,
    Blank,
    FilmEmulsion,
    ToneCurve,
    measure_blank,
    plain_emulsion,
)
from pipeline.film.tracking.probing import measure_emulsion


def test_curve_of_a_long_shoulder_is_exponential():
    exposure = np.geomspace(1e-3, 2.0, 40)
    expected = 0.6 * (1.0 - np.exp(-((exposure / 0.2) ** 1.5)))
    assert ToneCurve(0.6, 0.2, 1.5, 1e6).darkness(exposure) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("shoulder", [1.0, 3.0, 20.0])
def test_the_curve_and_its_inverse_are_one_another(shoulder):
    curve = ToneCurve(0.6, 0.6, 1.5, shoulder)
    exposure = np.geomspace(1e-3, 2.0, 40)
    assert curve.exposure(curve.darkness(exposure)) == pytest.approx(exposure, rel=1e-6)
    steps = (curve.darkness(exposure * 1.0001) - curve.darkness(exposure * 0.9999)) / (0.0002 * exposure)
    assert curve.rate(exposure) == pytest.approx(steps, rel=1e-4)
    assert curve.exposure(1.0) == HIGHEST_EXPOSURE
    assert curve.darkness([0.0, -1.0]) == pytest.approx(0.0)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_blank_film_is_told_under_lines_and_vignette(kind):
    top = np.iinfo(kind).max
    rng = np.random.default_rng(0)
    light = 0.8 * (1.0 - 0.3 * (np.linspace(-1, 1, 1000) ** 2))[None, :] * np.linspace(1.0, 0.9, 400)[:, None]
    image = light * 10.0 ** (-0.01 * rng.normal(size=(400, 1000)))
    image[::7, 40:700] *= 0.4  # a seventh of the film is line
    blank = measure_blank(Sheet(np.round(top * image).astype(kind)))
    expected = -np.log10(light[np.ix_(blank.rows.astype(int), blank.columns.astype(int))])
    assert np.abs(blank.darkness - expected).max() < 0.006
    assert blank.sigma == pytest.approx(0.01, rel=0.15)


@pytest.mark.compiled  # a whole film is read
def test_blank_film_between_dark_lines_is_measured_beside_their_wings():
    rng, rows = np.random.default_rng(1), np.arange(1500)
    lines = 0.6 * np.exp(-0.5 * ((rows % 14.3 - 7.0) / 1.4) ** 2)
    image = 0.8 * 10.0 ** -(lines[:, None] + 0.01 * rng.normal(size=(1500, 640)))
    blank = plain_emulsion(Sheet(np.round(65535 * image).astype(np.uint16))).blank
    assert blank.across is not None
    assert np.abs(blank.darkness + np.log10(0.8)).max() < 0.002
    assert blank.sigma == pytest.approx(0.01, rel=0.05)


def test_faint_lines_that_sweep_over_a_block_do_not_darken_blank_film():
    rng, swept = np.random.default_rng(2), np.zeros((400, 1000), dtype=bool)
    for row in range(400):
        swept[row, (37 * row) % 450 : (37 * row) % 450 + 120] = True
    image = 0.8 * 10.0 ** -(0.01 * swept + 0.01 * rng.normal(size=swept.shape))
    scan = Sheet(np.round(65535 * image).astype(np.uint16))

    def unlit(first, rows, columns):
        return ~swept[first : first + rows, :columns]

    off = [np.abs(measure_blank(scan, None, each).darkness + np.log10(0.8)).max() for each in (None, unlit)]
    assert off[0] > 0.0018
    assert off[1] < 0.0012


def test_pixels_become_darkness_and_exposure():
    curve = ToneCurve(0.6, 0.2, 1.5)
    image = np.full((64, 128), 200, np.uint8)
    blank = measure_blank(Sheet(image))
    emulsion = FilmEmulsion(0.0, 0.0, curve, np.array([1e-4, 1e-3]), 255, blank)
    exposures = np.array([0.05, 0.3, 1.0])
    pixels = np.tile(np.round(200 * 10.0 ** -curve.darkness(exposures)), (2, 1)).astype(np.uint8)
    wide = np.pad(pixels, ((0, 0), (0, 125)), constant_values=200)
    assert emulsion.exposure(wide, 10)[:, :3] == pytest.approx(np.tile(exposures, (2, 1)), rel=0.06)
    assert np.abs(emulsion.darkness(wide, 10)[:, 3:]).max() < 1e-6
    sigma = np.sqrt(1e-4 + 1e-3 * curve.darkness(0.3)) / curve.rate(0.3)
    assert emulsion.noise(np.float32([0.3]))[0] == pytest.approx(sigma, rel=1e-5)


def test_blur_of_the_scanner_is_taken_out():
    away = np.arange(61) - 30.2
    dark = 1.2 * np.exp(-0.5 * (np.hypot(away[:, None], away) / 4.0) ** 2)
    seen = gaussian_filter(10.0**-dark, 0.45)
    pixels = np.rint(60000 * seen).astype(np.uint16)
    blank = Blank(np.array([30.0]), np.array([30.0]), np.array([[np.log10(65535 / 60000)]]), 1e-3)
    kernel = gaussian_filter1d(np.eye(1, 21, 10)[0], 0.45)
    half_variance = 0.5 * float(kernel @ (np.arange(21) - 10.0) ** 2)
    sharp = FilmEmulsion(0.0, 0.0, UNTOLD, np.array([1e-4, 1e-3]), 65535, blank, blur=half_variance)
    off = np.abs(np.stack([replace(sharp, blur=0.0).darkness(pixels, 0), sharp.darkness(pixels, 0)]) - dark)
    assert off[0].max() > 0.01
    assert off[1].max() < 0.05 * off[0].max()


@pytest.mark.compiled
@pytest.mark.parametrize(("blur", "half_variance"), [(0.0, 0.0), (0.4, 0.04)])
def test_the_curve_is_told_from_the_film_itself(blur, half_variance):
    traces = [Swinging(110.0, 60.0, 0.3), Swinging(290.0, 55.0, 2.0, slow=8.0)]
    film = exposure_of(traces, 700, 400, shutter(700))
    pixels = developed(film, grain=0.03)
    pixels = np.rint(gaussian_filter(pixels.astype(float), blur)).astype(pixels.dtype) if blur else pixels
    emulsion = measure_emulsion(Sheet(pixels))
    curve = emulsion.curve
    assert emulsion.blur == pytest.approx(half_variance, abs=0.008)
    assert emulsion.spot == pytest.approx(SPOT, rel=0.02)
    assert curve.darkest == pytest.approx((DENSEST - FOG) / SCANNER, rel=0.06)
    assert curve.contrast == pytest.approx(CONTRAST, rel=0.06)
    true = ToneCurve((DENSEST - FOG) / SCANNER, MIDDLE, CONTRAST)
    grid = np.linspace(0.02, 0.9, 40)
    assert np.abs(curve.darkness(grid) / true.darkness(grid) - 1.0).max() < 0.03  # what its use rests on
    assert emulsion.grain[0] == pytest.approx((0.03 / SCANNER) ** 2 * FOG, rel=0.3)
    assert emulsion.grain[1] == pytest.approx((0.03 / SCANNER) ** 2 * SCANNER, rel=0.35)


@pytest.mark.compiled
@pytest.mark.parametrize("strength", [1.0, 3.0])
def test_fine_grain_does_not_hide_dark_turning_points(strength):
    traces = [Swinging(110.0, 60.0, 0.3), Swinging(290.0, 55.0, 2.0, slow=8.0)]
    film = strength * exposure_of(traces, 700, 400, shutter(700))
    curve = measure_emulsion(Sheet(developed(film, grain=0.004))).curve
    true = ToneCurve((DENSEST - FOG) / SCANNER, MIDDLE / strength, CONTRAST)
    grid = np.linspace(0.05, 0.9, 40)
    assert np.abs(curve.darkness(grid) / true.darkness(grid) - 1.0).max() < 0.025


@pytest.mark.compiled
def test_the_curve_is_told_by_traces_of_different_sizes():
    """One shows steep strokes, the other slow ones: with lamps as the first guess of the curve has them, it stays."""
    traces = [Swinging(110.0, 80.0, 0.3), Swinging(290.0, 18.0, 2.0, slow=8.0)]
    film = 1.5 * exposure_of(traces, 700, 400, shutter(700), spot=0.8)
    emulsion = measure_emulsion(Sheet(developed(film, grain=0.01)))
    assert emulsion.curve.contrast == pytest.approx(CONTRAST, rel=0.006)
    assert emulsion.spot == pytest.approx(0.8, rel=0.003)


@pytest.mark.compiled
@pytest.mark.parametrize("shear", [0.0, 0.0052, -0.0087, 0.031])
def test_the_slant_of_the_slit_is_measured(shear):
    traces = [Swinging(110.0, 60.0, 0.3), Swinging(290.0, 55.0, 2.0, slow=8.0)]
    film = exposure_of(traces, 700, 400, shutter(700), shear=shear)
    assert measure_emulsion(Sheet(developed(film, grain=0.03))).shear == pytest.approx(shear, abs=2e-4, rel=0.01)


@pytest.mark.compiled
def test_most_of_a_strong_blur_is_taken_out():
    traces = [Swinging(110.0, 60.0, 0.3), Swinging(290.0, 55.0, 2.0, slow=8.0)]
    pixels = developed(exposure_of(traces, 700, 400, shutter(700)), grain=0.03)
    emulsion = measure_emulsion(Sheet(np.rint(gaussian_filter(pixels.astype(float), 0.6)).astype(pixels.dtype)))
    assert emulsion.blur == pytest.approx(0.176, rel=0.15)
    assert emulsion.spot == pytest.approx(SPOT, rel=0.03)  # the scan shows one that is wider by 12 %


def test_a_bed_beside_the_film_does_not_make_it_black():
    darkness = np.full((3, 8), 0.2)
    blank = Blank(np.arange(3.0), np.arange(8.0), darkness, 0.01)
    film = FilmEmulsion(1.0, 0.0, UNTOLD, np.array([1e-4, 1e-3]), 255, blank)
    darkness_of_bed = darkness.copy()
    darkness_of_bed[:, 0] = 1.6
    beside = replace(film, blank=blank._replace(darkness=darkness_of_bed))
    assert beside.blackest == film.blackest == pytest.approx(np.log10(255 / 0.75) - 0.2)
