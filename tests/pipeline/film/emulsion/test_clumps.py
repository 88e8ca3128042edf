"""Grain that is alike on pixels near by: measured on blank film, and what it does to the place of a line."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, gaussian_filter1d

from pipeline.film.emulsion import UNTOLD, Blank, FilmEmulsion, clumps_of

SIGMA, LEVEL = 0.012, 0.1


@dataclass
class Sheet:
    pixels: np.ndarray
    full_scale: int = 65535

    @property
    def rows(self) -> int:
        return len(self.pixels)

    @property
    def columns(self) -> int:
        return self.pixels.shape[1]

    def read(self, first: int, stop: int) -> np.ndarray:
        return self.pixels[first:stop]


def sheet(clump: float) -> tuple[Sheet, FilmEmulsion]:
    noise = np.random.default_rng(3).normal(size=(2000, 700))
    noise = gaussian_filter(noise, clump) if clump else noise
    darkness = LEVEL + SIGMA * noise / noise.std()
    pixels = np.rint(65535 * 10.0**-darkness).astype(np.uint16)
    blank = Blank(np.array([1000.0]), np.array([350.0]), np.array([[LEVEL]]), SIGMA)
    return Sheet(pixels), FilmEmulsion(1.3, 0.0, UNTOLD, np.array([SIGMA**2, 0.0]), 65535, blank)


@pytest.mark.parametrize("clump", [0.6, 1.0, 1.4])
def test_correlation_is_that_of_the_grain(clump):
    found, _ = clumps_of(*sheet(clump))
    impulse = gaussian_filter1d(np.eye(1, 81, 40)[0], clump)
    alike = np.correlate(impulse, impulse, "full")[80:]
    # what lies beyond 3.5 sigmas with its neighbours is left out
    np.testing.assert_allclose(found, (alike / alike[0])[: found.size], atol=0.03)


def test_white_grain_changes_nothing():
    scan, emulsion = sheet(0.0)
    known = replace(emulsion, clumps=clumps_of(scan, emulsion)[0])
    assert known.clumps.size == 1
    np.testing.assert_array_equal(known.clumped(np.array([0.0, 9.0])), 1.0)


@pytest.mark.parametrize("slope", [0.0, 2.0, 8.0])
def test_a_line_s_place_scatters_as_it_says(slope):
    """Least squares for the place of a line of known profile on many rows of grain alone."""
    scan, emulsion = sheet(1.0)
    known = replace(emulsion, clumps=clumps_of(scan, emulsion)[0])
    width = known.spot * np.hypot(1.0, slope)
    u = np.arange(-4.0 * width, 4.0 * width + 1.0)
    derivative = u * np.exp(-0.5 * (u / width) ** 2)
    grain = -np.log10(scan.pixels / 65535.0) - LEVEL
    starts = np.arange(0, scan.columns - u.size, u.size)
    place = np.stack([grain[:, a : a + u.size] @ derivative for a in starts]) / np.sum(derivative**2)
    white = SIGMA / np.sqrt(np.sum(derivative**2))
    assert np.std(place) / white == pytest.approx(np.sqrt(known.clumped(np.array(slope))), rel=0.04)
