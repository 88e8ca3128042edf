"""Sliding envelopes: exact on what they are made for, deaf to swell, honest about gaps and noise."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.harmonics.envelope import (
    KAISER_SHAPE,
    LEAST_COVERAGE,
    WINDOW_SECONDS,
    fill,
    image_distance,
    sliding_envelope,
    window_length,
)

N0 = 2.0 * np.pi / 1.01
STEP = 0.1
TIME = np.arange(1200) * STEP


def harmonic(z: complex, frequency: float = N0, time: np.ndarray = TIME) -> np.ndarray:
    return (z * np.exp(1j * frequency * time)).real


def test_a_pure_harmonic_on_a_line_is_returned_exactly() -> None:
    one, two = 0.012 * np.exp(0.4j), 0.006 * np.exp(2.0j)
    theta = harmonic(one) + 0.03 - 1e-4 * TIME
    found = sliding_envelope(TIME, STEP, theta, harmonic(two), N0)
    assert np.abs(found.first - one).max() < 1e-13
    assert np.abs(found.difference - two).max() < 1e-13
    assert np.abs(found.slow[0] - (0.03 - 1e-4 * found.time)).max() < 1e-13
    assert np.abs(found.first_speed).max() < 1e-12
    assert found.coverage == pytest.approx(1.0, abs=0.05)


def test_sliding_follows_a_changing_amplitude_and_its_rate() -> None:
    """z(t) quadratic in time lies in the basis; a detuned harmonic is followed to the cubic remainder."""
    tau = TIME - 60.0
    z = 0.01 * (1.0 + 2e-3j * tau + 1e-5 * tau**2) * np.exp(0.3j)
    found = sliding_envelope(TIME, STEP, (z * np.exp(1j * N0 * TIME)).real, harmonic(0.01 + 0j), N0)
    tau = found.time - 60.0
    assert np.abs(found.first - 0.01 * (1.0 + 2e-3j * tau + 1e-5 * tau**2) * np.exp(0.3j)).max() < 1e-13
    assert np.abs(found.first_speed - 0.01 * (2e-3j + 2e-5 * tau) * np.exp(0.3j)).max() < 1e-13
    near = sliding_envelope(TIME, STEP, harmonic(0.01 + 0j, N0 + 0.02), harmonic(0.01 + 0j), N0)
    exact = 0.01 * np.exp(0.02j * near.time)
    assert np.abs(near.first - exact).max() < 0.01 * (0.02 * 8.0) ** 3 / 6.0 * 0.1


@pytest.mark.parametrize("period", [4.0, 5.0, 7.0, 10.0, 14.0, 20.0])
def test_sliding_is_deaf_to_swell(period: float) -> None:
    """What a unit of swell leaves in the harmonic: below -95 dB, so 75 mrad of psi leave about a microradian."""
    left = [
        np.abs(sliding_envelope(TIME, STEP, np.cos(2 * np.pi * TIME / period + p), harmonic(0.1), N0).first).max()
        for p in (0.0, 1.0, 2.0)
    ]
    assert max(left) < 1.75e-5


def _weighted_fit(time: np.ndarray, values: np.ndarray, centre: float, half: float) -> np.ndarray:
    """The eight-term fit in a Kaiser window, by another way than the code's (scaled rows, QR)."""
    x = (time - centre) / half
    inside = (np.abs(x) <= 1.0 + 1e-12) & np.isfinite(values)
    x, t = x[inside], time[inside] - centre
    c, s = np.cos(N0 * t), np.sin(N0 * t)
    basis = np.column_stack([c, s, x * c, x * s, x**2 * c, x**2 * s, x**0, x])
    root = np.sqrt(np.i0(KAISER_SHAPE * np.sqrt(np.clip(1 - x**2, 0, None))))
    q, r = np.linalg.qr(basis * root[:, None])
    return np.linalg.solve(r, q.T @ (values[inside] * root))


def test_sliding_with_gaps_is_the_weighted_fit_of_what_is_left() -> None:
    random = np.random.default_rng(3)
    theta = harmonic(0.01 * np.exp(1j)) + 0.02 * np.cos(2 * np.pi * TIME / 9.0) + random.normal(0, 1e-4, TIME.size)
    difference = harmonic(0.02 + 0j) + random.normal(0, 1e-4, TIME.size)
    theta[random.random(TIME.size) < 0.1] = np.nan
    difference[300:318] = np.nan
    difference[700:860] = np.nan
    found = sliding_envelope(TIME, STEP, theta, difference, N0)
    half = 0.5 * WINDOW_SECONDS
    for k, centre in enumerate(found.time):
        for series, got in ((theta, found.first), (difference, found.difference)):
            if np.isfinite(got[k]):
                fit = _weighted_fit(TIME, series, centre, half)
                assert abs(got[k] - (fit[0] - 1j * fit[1]) * np.exp(-1j * N0 * centre)) < 1e-12
    hole = (found.time > 71.0) & (found.time < 85.0)
    assert np.isnan(found.difference[hole]).all()
    assert np.isfinite(found.first).all()
    assert found.coverage.min() < LEAST_COVERAGE < found.coverage[np.isfinite(found.difference)].min()


def test_noise_gain_is_the_variance_of_an_envelope() -> None:
    random = np.random.default_rng(8)
    time = np.arange(40_000) * STEP
    found = sliding_envelope(time, STEP, random.normal(0, 1.0, time.size), random.normal(0, 1.0, time.size), N0)
    every = max(1, round(8.0 / found.hop))  # instants whose windows hardly overlap under the Kaiser weight
    seen = [z.real[::every].var() for z in (found.first, found.difference)]
    seen += [z.imag[::every].var() for z in (found.first, found.difference)]
    # 2000 and more values: the mean of their variances is good to 2 %, four sigmas 8 %
    assert np.mean(seen) == pytest.approx(found.noise_gain, rel=0.08)


def test_a_dead_trace_gives_no_envelope() -> None:
    dead = np.full(TIME.size, np.nan)
    found = sliding_envelope(TIME, STEP, harmonic(0.01 + 0j), dead, N0)
    assert np.isnan(found.difference).all()
    assert np.isfinite(found.first).all()


def test_the_image_at_half_second_marks_lengthens_the_window() -> None:
    n = 2.0 * np.pi / 1.01
    assert image_distance(n, 0.5) == pytest.approx(4.0 * np.pi - 2.0 * n)
    assert image_distance(n, 0.1) == pytest.approx(2.0 * n)
    assert window_length(n, 0.1, 1800.0) == 16.0
    assert window_length(n, 0.5, 1800.0) == pytest.approx(4.0 * np.pi / (4.0 * np.pi - 2.0 * n))
    assert window_length(n, 0.1, 30.0) == 10.0


def test_fill_is_linear_and_leaves_a_whole_series_alone() -> None:
    values = np.array([1.0 + 1j, np.nan, 3.0 + 3j, np.nan])
    assert fill(values).tolist() == [1 + 1j, 2 + 2j, 3 + 3j, 3 + 3j]
    whole = values[[0, 2]]
    assert fill(whole) is whole
