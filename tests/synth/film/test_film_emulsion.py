"""The characteristic curve, the grain and the scanner."""

from __future__ import annotations

import numpy as np
import pytest
from made_films import SMALL, planned, rest

from data_schemas.scene_recording import Film
from synth.film.strips import Development, blurred, develop, quantised, scan


def developed(exposure, film):
    image = np.array(exposure)[None]
    paper = np.array([0]), np.array([image.size])
    develop(image, *paper, np.array([film.fog]), 0.0, film)
    return image[0]


def test_the_curve_rises_from_the_fog_to_its_maximum():
    film = Film(fog=0.2, density_max=1.8, half_exposure=0.3, gamma=1.3)
    density = developed(np.logspace(-6, 6, 500), film)
    assert np.all(np.diff(density) > 0)
    assert density[0] == pytest.approx(0.2, abs=1e-6)
    assert density[-1] == pytest.approx(1.8, abs=1e-6)
    assert developed([0.3], film)[0] == pytest.approx(1.0)
    assert developed([0.0], film)[0] == 0.2


def test_the_kernel_is_the_curve():
    film = Film(fog=0.2, gamma=2.0)
    exposure = np.array([[0.0, 0.001, 0.2, 5.0]], np.float32)
    image = exposure.copy()
    all_of_it = np.array([0]), np.array([4])
    develop(image, *all_of_it, np.array([0.2]), 0.0, film)
    with np.errstate(divide="ignore"):
        curve = film.fog + (film.density_max - film.fog) / (1.0 + (film.half_exposure / exposure) ** film.gamma)
    np.testing.assert_allclose(image, curve, rtol=1e-6)
    off_paper = exposure.copy()
    develop(off_paper, np.array([1]), np.array([3]), np.array([0.2]), 0.0, film)
    assert off_paper[0, 0] == 0.0
    assert off_paper[0, 3] == 0.0


def test_a_scan_shows_densities_as_powers_of_ten():
    density = np.array([[0.0, 1.1, 2.2]], np.float32)
    scan(density, np.float32(-np.log(10) / 2.2), np.ones(3, np.float32))
    np.testing.assert_allclose(density, [[1.0, 10**-0.5, 0.1]], rtol=1e-6)


def grainy(film):
    plan = planned(film, rest, seconds=1.0)
    development = Development(plan)
    image = np.zeros((min(1024, plan.geometry.rows), plan.geometry.columns), np.float32)
    return development.strip(0, image)


@pytest.mark.parametrize("dpi", [150, 300])
def test_grain_goes_with_the_root_of_density_and_with_the_pixel(dpi):
    """Selwyn's law: twice the pixel, half the grain."""
    light = grainy(Film(**SMALL, dpi=dpi, grain=0.05, fog=0.4))[5:-5, 5:-5]
    density = -2.2 * np.log10(light)
    # half of 20 000 pixels' variance is known to 1 %; the curve of the logarithm plays no part, it is inverted
    assert density.mean() == pytest.approx(0.4, abs=2e-3)
    assert density.std() == pytest.approx(0.05 * 0.4**0.5 * dpi / 300, rel=0.03)
    residual = density - density.mean()
    beside = np.mean(residual[:, 1:] * residual[:, :-1]) / residual.var()
    below = np.mean(residual[1:] * residual[:-1]) / residual.var()
    assert abs(beside) < 0.04
    assert abs(below) < 0.04


def test_vignette_fog_gradient_and_polarity():
    even = grainy(Film(**SMALL))
    assert np.ptp(even) == 0.0
    columns = even.shape[1]
    place = (np.arange(columns) + 0.5) / columns
    dark = grainy(Film(**SMALL, vignette=0.2))
    np.testing.assert_allclose(dark[3] / even[3], 1 - 0.2 * (2 * place - 1) ** 2, rtol=1e-6)
    across = (np.arange(columns) + 0.5) / (25.0 * 300 / 25.4)
    veiled = grainy(Film(**SMALL, fog=0.2, fog_gradient=0.1))
    np.testing.assert_allclose(-2.2 * np.log10(veiled[3]), 0.2 + 0.1 * (across - 0.5), atol=2e-6)
    print_ = grainy(Film(**SMALL, polarity="positive"))
    np.testing.assert_allclose(print_, 1.0 - even, atol=1e-7)


def test_blur_is_the_same_in_strips_and_in_one():
    chance = np.random.default_rng(0)
    image = chance.random((200, 30), dtype=np.float32)
    whole = np.concatenate(list(blurred(iter([image]), 2.0)))
    cuts = [image[:64], image[64:128], image[128:192], image[192:]]  # the last is shorter than the kernel
    np.testing.assert_array_equal(np.concatenate(list(blurred(iter(cuts), 2.0))), whole)
    assert whole.mean() == pytest.approx(image.mean(), rel=0.01)
    np.testing.assert_array_equal(np.concatenate(list(blurred(iter(cuts), 0.0))), image)


def test_blur_is_gaussian():
    image = np.zeros((41, 41), np.float32)
    image[20, 20] = 1.0
    (seen,) = blurred(iter([image]), 1.5)
    place = np.arange(41) - 20.0
    assert (seen.sum(axis=0) * place**2).sum() == pytest.approx(1.5**2, rel=0.01)
    assert (seen.sum(axis=1) * place**2).sum() == pytest.approx(1.5**2, rel=0.01)


@pytest.mark.parametrize(("bits", "top"), [(8, 255), (16, 65535)])
def test_numbers_are_rounded_and_clipped(bits, top):
    light = np.array([[-0.1, 0.0, 0.49 / top, 0.51 / top, 1.0, 1.1]], np.float32)
    assert quantised(light, bits).tolist() == [[0, 0, 0, 1, top, top]]
