"""Laws of the latent image: light is kept, its density follows the dwell time, and it lies where the truth says."""

from __future__ import annotations

import math

import numpy as np
import pytest
from made_films import SMALL, crossings, latent, planned, ramp, record_of, rest, swing

from data_schemas.scene_recording import Film
from synth.film.layout import plan_film
from synth.film.source import source_of
from synth.film.strips import Exposure, spot_table


def line_light(film):
    """Light of a second of exposure, in units of pixels."""
    pixels = film.dpi / 25.4
    return film.speed * pixels * math.sqrt(2 * math.pi) * film.spot * pixels


def test_light_is_kept():
    # what is not in the spot's 5 sigmas, and straight lines in the table of the spot: 1e-6
    film = Film(**SMALL)
    assert latent(planned(film, swing())).sum(dtype=float) == pytest.approx(3.0 * line_light(film), rel=3e-6)


def test_light_is_kept_by_two_lines_through_gaps_dimming_and_blackout():
    film = Film(**SMALL | {"gap": 0.04}, blackouts=[[0.7, 0.9]], dimmings=[[1.1, 1.3, 0.25]], lamp=2.0)
    # marks at 0 (half of it on the record), 0.125, 0.5, ..., 2.5, 3.0 (half)
    lit = 3.0 - 0.04 * (0.5 + 1 + 5 + 0.5) - 0.2 - 0.75 * 0.2
    total = latent(planned(film, swing(0.01), swing(0.01, period=1.4))).sum(dtype=float)
    assert total == pytest.approx(2 * 2.0 * lit * line_light(film), rel=3e-6)


@pytest.mark.parametrize("slope", [0.0, 0.7, 5.0])
def test_density_on_the_axis_follows_the_dwell_time(slope):
    """1 / sqrt(1 + slope^2); pixels widen the spot by their own variance of 1/12."""
    film = Film(**SMALL | {"paper_width": 48.0, "speed": 2.0}, dpi=100, spot=0.75)
    rate = slope * film.speed / film.lever
    image = latent(planned(film, ramp(rate, -2.0 * rate), seconds=4.0))
    sigma = 0.75 * 100 / 25.4
    middle = image[image.shape[0] // 2 - 3 : image.shape[0] // 2 + 3]
    # the brightest pixel of six rows lies within 0.15 px of the axis: 1 - 0.15^2 / (2 sigma^2) = 1 - 1.3e-3
    assert middle.max() == pytest.approx((1 + slope**2) ** -0.5 * (1 + 1 / (12 * sigma**2)) ** -0.5, rel=1.5e-3)


def test_a_line_across_has_its_profile():
    """The profile of a line at rest is the spot, averaged over pixels."""
    film = Film(**SMALL, dpi=300)
    image = latent(planned(film, rest))
    row = image[image.shape[0] // 2].astype(float)
    sigma = film.spot * film.dpi / 25.4
    centre = 12.5 * film.dpi / 25.4
    edges = np.arange(row.size + 1)
    table = np.array([0.5 * math.erf((edge - centre) / sigma / math.sqrt(2)) for edge in edges])
    np.testing.assert_allclose(row, np.diff(table) * math.sqrt(2 * math.pi) * sigma, atol=2e-6)


@pytest.mark.parametrize("film", [{}, {"skew": 2.0}, {"rotation": -1.0, "skew": 0.5}, {"rotation": 2.0}])
def test_the_centroid_of_a_row_is_the_truth_and_its_curvature(film):
    """Light of a row comes from those around it: the centroid is u + s^2 u''/2 + s^4 u''''/8, s^2 = sigma^2 + 1/12."""
    plan = planned(Film(**SMALL | {"speed": 20.0, **film}), swing(0.008))
    image = latent(plan).astype(float)
    _, _, column, _ = crossings(plan)
    u = column[0]
    light = image.sum(axis=1)
    centroid = (image * (np.arange(image.shape[1]) + 0.5)).sum(axis=1) / np.where(light > 0, light, 1)
    square = (0.1 * 300 / 25.4) ** 2 + 1 / 12
    second = u[2:] - 2 * u[1:-1] + u[:-2]
    expected = u[1:-1] + 0.5 * square * second
    expected[1:-1] += (square**2 / 8 - 0.5 * square / 12) * (second[2:] - 2 * second[1:-1] + second[:-2])
    inside = np.isfinite(expected)
    inside[: np.argmax(inside) + 12] = False  # the line's own ends
    inside[-np.argmax(inside[::-1]) - 12 :] = False
    assert inside.sum() > 500
    np.testing.assert_allclose(centroid[1:-1][inside], expected[inside], atol=2e-3)


def direct(plan, rows, steps=4000):
    """An independent image: a plain sum over short steps of time, each a spot integrated over every pixel."""
    film, map_ = plan.film, plan.geometry
    pixels = film.dpi / 25.4
    image = np.zeros((rows.size, map_.columns))
    sigma = film.spot * pixels
    erf = np.vectorize(math.erf)
    edges = np.arange(map_.columns + 1)
    time = (np.arange(steps) + 0.5) * 3.0 / steps
    open_ = np.abs((time + 0.25) % 0.5 - 0.25) > 0.02
    open_ &= np.abs(time - 0.125) > 0.02
    for t in time[open_]:
        u = (12.5 + 500 * 0.012 * math.cos(2 * math.pi * t + 0.3)) * pixels
        s = (2.0 + film.speed * t) * pixels + math.tan(math.radians(film.skew)) * u
        if abs(s - rows.mean()) > rows.size:
            continue
        down = np.diff(0.5 * erf((np.append(rows, rows[-1] + 1) - s) / sigma / math.sqrt(2)))
        over = np.diff(0.5 * erf((edges - u) / sigma / math.sqrt(2)))
        image += np.outer(down, over) * 3.0 / steps * film.speed * pixels * math.sqrt(2 * math.pi) * sigma
    return image


@pytest.mark.parametrize("skew", [0.0, 1.5])
def test_an_independent_sum_gives_the_same_image(skew):
    film = Film(**SMALL | {"gap": 0.04}, skew=skew)
    plan = planned(film, swing())
    rows = np.arange(75, 110)
    ours = latent(plan)[rows]
    # steps of 0.75 ms cut gaps to 2 % of their 40 ms: compare what lies away from their edges closely, all coarsely
    difference = np.abs(ours - direct(plan, rows))
    assert difference.max() < 0.03
    assert np.quantile(difference, 0.98) < 2e-4


def test_portions_do_not_change_a_bit(monkeypatch):
    film = Film(**SMALL | {"gap": 0.04}, skew=1.0)
    record = record_of(swing(0.01), swing(0.01, period=1.3), seconds=6.0)
    whole = latent(plan_film(source_of(record), film, 1))
    monkeypatch.setattr("synth.film.strips.STRIP", 97)
    plan = plan_film(source_of(record), film, 1)
    exposure = Exposure(plan)
    pieces = [exposure.strip(k)[0] for k in range(-(-plan.geometry.rows // 97))]
    np.testing.assert_array_equal(np.concatenate(pieces), whole)


def test_crossings_lie_on_the_curve():
    plan = planned(Film(**SMALL, skew=1.0, rotation=0.5, wow=0.02, wow_period=0.7), swing())
    time, elongation, column, slope = (each[0] for each in crossings(plan))
    good = np.isfinite(time)
    # the record's spline is right to 1e-9 of the swing at 50 samples a period, away from its ends to 1e-6
    np.testing.assert_allclose(elongation[good], swing()(time[good]), atol=1e-7)
    along, across = plan.transport.travel(time[good]), 12.5 + 500.0 * elongation[good]
    np.testing.assert_allclose(plan.geometry.rows_of(along, across), np.flatnonzero(good) + 0.5, atol=1e-6)
    np.testing.assert_allclose(plan.geometry.columns_of(along, across), column[good], atol=1e-6)
    near = np.gradient(column[good])
    np.testing.assert_allclose(slope[good][2:-2], near[2:-2], atol=0.12)
    assert abs(slope[good]).max() > 5


def test_the_table_of_the_spot():
    for sigma in (0.2, 1.18, 20.0):
        table = spot_table(sigma)
        assert table[table.size // 2] == 0.5
        assert table[0] < 3e-7
        assert np.all(np.diff(table) >= 0)
