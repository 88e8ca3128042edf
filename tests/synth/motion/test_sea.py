from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from data_schemas.scene_motion import SeaMotion
from synth.motion.harmonic_sum import LOWEST, PEAK_FACTOR, bin_variances, sea, spectral_shape

GRAVITY = 9.81
SPECTRA = sorted(PEAK_FACTOR)


def _rms(**parts: object) -> float:
    term = SeaMotion.model_validate(
        {"kind": "sea", "significant_height": 3.0, "peak_period": 10.0, "components": 4000} | parts
    )
    acceleration = sea(term, GRAVITY, np.random.default_rng(3)).acceleration
    return math.sqrt(np.sum(np.abs(acceleration) ** 2) / 2)


@pytest.mark.parametrize("spectrum", SPECTRA)
def test_significant_height_comes_back(spectrum: str) -> None:
    """Four times the root of the variance; 1e-4 for the integral's steps and the tail."""
    variances = bin_variances(np.array([LOWEST, 1.0, 3.0, 40.0]), spectrum, 3.0)
    assert 4 * math.sqrt(np.sum(variances)) == pytest.approx(3.0, rel=1e-4)


def test_pierson_moskowitz_has_a_closed_integral() -> None:
    """Variance below x is exp(-5/4 x^-4) of the whole."""
    edges = np.array([LOWEST, 0.8, 1.0, 1.5, 3.0, 10.0])
    expected = np.diff(np.exp(-1.25 * edges**-4)) * 3.0**2 / 16
    # trapezoids of 2.5e-4 relative width, and what lies below half the peak frequency
    np.testing.assert_allclose(bin_variances(edges, "pierson-moskowitz", 3.0), expected, rtol=1e-6, atol=1e-9)


def test_jonswap_against_adaptive_quadrature() -> None:
    def part(low: float, high: float) -> float:
        return float(quad(lambda x: spectral_shape(np.array([x]), 3.3)[0], low, high, epsabs=1e-13)[0])

    whole = part(0.3, 1.0) + part(1.0, 2.0) + part(2.0, 60.0) + 60.0**-4 / 4
    expected = np.array([part(0.9, 1.0), part(1.0, 1.2), part(1.2, 2.5)]) / whole * 9 / 16
    np.testing.assert_allclose(bin_variances(np.array([0.9, 1.0, 1.2, 2.5]), "jonswap", 3.0), expected, rtol=2e-6)


def test_peak_factor_at_the_peak() -> None:
    """JONSWAP over Pierson-Moskowitz: 3.3 at the peak, falling as a Gauss curve, wider above than below."""
    x = np.array([0.93, 1.0, 1.09])
    ratio = spectral_shape(x, 3.3) / spectral_shape(x, 1.0)
    np.testing.assert_allclose(np.log(ratio) / np.log(3.3), np.exp([-0.5, 0.0, -0.5]), rtol=1e-13)


def test_submarine_at_30_m() -> None:
    """Physics sheet, section 2: Hs 3 m, Tp 10 s, 30 m: 7.7 Gal rms."""
    assert _rms(depth=30.0) == pytest.approx(0.077, abs=0.0005)


@pytest.mark.parametrize("spectrum", SPECTRA)
def test_surface_acceleration_grows_with_the_cutoff(spectrum: str) -> None:
    at = [_rms(spectrum=spectrum, cutoff=cutoff) for cutoff in (2.0, 3.0, 5.0, 10.0)]
    assert at == sorted(at)
    assert at[-1] > 1.5 * at[0]
    assert at[1] > 0.5  # a surface ship: 50 Gal and more


def test_deep_water_attenuation_of_one_component() -> None:
    parts = {"kind": "sea", "significant_height": 3.0, "peak_period": 10.0, "components": 1, "cutoff": 1.5}
    above = sea(SeaMotion.model_validate(parts), GRAVITY, np.random.default_rng(0))
    below = sea(SeaMotion.model_validate(parts | {"depth": 20.0}), GRAVITY, np.random.default_rng(0))
    w = above.angular_frequency[0]
    assert abs(below.acceleration[0] / above.acceleration[0]) == pytest.approx(math.exp(-(w**2) / GRAVITY * 20))


def test_direction_projects_on_the_swing_plane() -> None:
    assert _rms(direction=60.0) == pytest.approx(_rms() / 2)
    assert _rms(direction=90.0) < 1e-15


def test_record_does_not_repeat() -> None:
    """Frequencies at the bins' own even spacing would bring the whole record back after 2 pi over it."""
    term = SeaMotion(significant_height=3.0, peak_period=10.0, components=32)
    rate = sea(term, GRAVITY, np.random.default_rng(1)).angular_frequency
    width = (3.0 - LOWEST) * 2 * math.pi / 10 / 32
    assert np.all(np.diff(rate) > 0)
    assert np.std(np.diff(rate)) > 0.2 * width
