"""The slow motion beside a swing, what it does to the phase, and the filters and weights that show it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import kaiser_beta

from pipeline.harmonics.envelope import (
    LEAST_COVERAGE,
    SlowMotion,
    fit_windows,
    kaiser,
    reach_of,
    sliding_envelope,
    slow_motion,
    weighted_inverse,
    window,
    windowed,
)

N = 6.2
G = 9.81


@pytest.mark.parametrize("rejection", [60.0, 80.0, 95.0])
def test_the_window_is_kaisers(rejection: float) -> None:
    np.testing.assert_allclose(kaiser(51, rejection), np.kaiser(51, kaiser_beta(rejection)), rtol=1e-12)


@pytest.mark.parametrize(("width", "step", "rejection"), [(0.5, 0.1, 80.0), (2.0, 0.04, 60.0)])
def test_its_reach_is_the_shortest_that_rejects_so_much(width: float, step: float, rejection: float) -> None:
    """In the stop band what is left is below the rejection; two fifths shorter it is not."""
    cut = 1.5 * width

    def worst(reach: int) -> float:
        low = windowed(cut, reach, step, rejection)[0]
        time = step * np.arange(-reach, reach + 1)
        beyond = np.linspace(cut + 0.5 * width, np.pi / step, 400)
        return float(20.0 * np.log10(np.abs(np.cos(np.outer(beyond, time)) @ low).max()))

    reach = reach_of(width, step, rejection)
    assert worst(reach) < -rejection + 1.0
    assert worst(round(0.6 * reach)) > -rejection + 6.0


@pytest.mark.parametrize("turn", [0.0, 0.4, 1.1])
def test_taps_pass_a_wave_and_its_two_derivatives(turn: float) -> None:
    step, reach = 0.1, reach_of(2.0, 0.1, 80.0)
    time = step * np.arange(-reach, reach + 1)
    wave = np.exp(1j * (turn * time + 0.3))
    low, slope, bend = windowed(3.0, reach, step, 80.0)
    bend = bend - bend.sum() / low.sum() * low  # a level has no curvature
    for order, taps in enumerate((low, slope, bend)):
        assert abs(np.sum(taps[::-1] * wave) - (1j * turn) ** order * np.exp(0.3j)) < 2e-3


@pytest.mark.parametrize("step", [0.04, 0.1])
def test_slow_motion_is_told_from_the_swing_at_its_own_time(step: float) -> None:
    time = step * np.arange(round(300.0 / step))
    wave = 0.03 * np.exp(1j * (0.7 * time + 0.4))
    heave = 0.2 * np.cos(0.9 * time)
    swing = 0.02 * np.cos(N * time)
    found = slow_motion(swing + wave.real, heave, step, N, G)
    at = found.time
    assert found.begin == pytest.approx(at[0])
    assert time[-1] - (at[-1] - at[0]) < 16.0
    np.testing.assert_allclose(found.angle, 0.03 * np.cos(0.7 * at + 0.4), atol=1e-5)
    np.testing.assert_allclose(found.curvature, -0.49 * 0.03 * np.cos(0.7 * at + 0.4), atol=3e-5)
    assert found.zeta is not None
    np.testing.assert_allclose(found.zeta, 0.2 / G * np.cos(0.9 * at), atol=1e-5)
    level = slow_motion(np.full(time.size, 0.01), None, step, N, G)
    np.testing.assert_allclose(level.angle, 0.01, rtol=1e-12)
    np.testing.assert_allclose(level.curvature, 0.0, atol=1e-14)
    assert level.zeta is None


def motion(angle: np.ndarray, curvature: np.ndarray, zeta: np.ndarray | None, step: float = 0.2) -> SlowMotion:
    return SlowMotion(10.0, step, angle, curvature, zeta)


def test_a_steady_tilt_and_heave_strengthen_gravity() -> None:
    """n sqrt((1 + zeta)/cos psi), also beyond the ends."""
    slow = motion(np.full(500, 0.1), np.zeros(500), np.full(500, 0.02))
    time = np.array([0.0, 20.0, 50.0, 300.0])
    expected = N * (np.sqrt(1.02 / np.cos(0.1)) - 1.0) * time
    found = slow.phase(N, time)
    np.testing.assert_allclose(found - found[0], expected, rtol=1e-12)
    turning = motion(np.full(500, 0.1), np.full(500, 0.5), None)
    np.testing.assert_allclose(turning.gamma(N), 1.0 / np.cos(0.1) + np.tan(0.1) * 0.5 / N**2, rtol=1e-14)


@pytest.mark.parametrize("turn", [0.8, 1.6])
def test_the_phase_gained_is_that_of_a_modulated_swing(turn: float) -> None:
    """theta'' + n^2 (1 + m cos wt) theta = 0 integrated over whole waves."""
    depth, length = 0.05, 20 * 2.0 * np.pi / turn

    def right(t: float, y: np.ndarray) -> list[float]:
        return [y[1], -(N**2) * (1.0 + depth * np.cos(turn * t)) * y[0]]

    found = [
        solve_ivp(right, (0.0, length), start, "DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
        for start in ([1.0, 0.0], [0.0, N])
    ]
    trace = found[0][0] + found[1][1] / N  # 2 cos of the whole phase
    whole = N * length
    turned = np.arccos(trace / 2.0)
    candidates = np.concatenate([[k * 2.0 * np.pi + turned, k * 2.0 * np.pi - turned] for k in range(400)])
    exact = candidates[np.argmin(np.abs(candidates - whole * (1.0 - depth**2 / 16.0 / (1.0 - turn**2 / (4 * N**2)))))]
    time = 0.01 * np.arange(round(length / 0.01) + 1)
    slow = SlowMotion(0.0, 0.01, np.zeros(time.size), np.zeros(time.size), depth * np.cos(turn * time))
    gained = slow.phase(N, np.array([0.0, time[-1]]))
    # third order in the depth; the second alone is 0.1 rad, its part by the wave's speed 2 %
    assert gained[1] - gained[0] == pytest.approx(exact - whole, rel=3e-3)


def test_influence_is_what_a_sample_does() -> None:
    """Of every sample of the difference on a sum over the instants."""
    draw = np.random.default_rng(6)
    step = 0.1
    time = step * np.arange(600)
    series = draw.normal(size=600)
    envelope = sliding_envelope(time, step, series, series, N)
    weights = draw.normal(size=envelope.time.size) + 1j * draw.normal(size=envelope.time.size)
    influence = envelope.influence(weights, 600, round(envelope.hop / step))
    for sample in (0, 7, 100, 313, 599):
        bent = series.copy()
        bent[sample] += 1.0
        moved = sliding_envelope(time, step, series, bent, N).difference - envelope.difference
        assert (np.conj(weights) @ moved).real == pytest.approx(influence[sample], abs=1e-12)


def test_windows_with_too_little_in_them_have_no_value() -> None:
    """Less than the least share of the weight, or fewer samples than twice the terms."""
    basis, weight, taps = window(20, 0.1, N)
    series = np.cos(N * 0.1 * np.arange(200)) + 0.2
    order = np.argsort(-weight)
    share = np.cumsum(weight[order]) / weight.sum()
    most = int(np.searchsorted(share, 1.0 - LEAST_COVERAGE, side="right"))  # samples that may be missing
    for missing, valued in ((most, True), (most + 1, False)):
        broken = series[: basis.shape[0]].copy()
        broken[order[:missing]] = np.nan
        fit, coverage = fit_windows(broken, basis, weight, taps, 10)
        assert np.isfinite(fit[:, 0]).all() == valued
        assert coverage[0] == pytest.approx(1.0 - share[missing - 1])
    whole, coverage = fit_windows(series, basis, weight, taps, 7)
    assert coverage.tolist() == [1.0] * whole.shape[1] == [1.0] * ((200 - 41) // 7 + 1)
    for k in range(whole.shape[1]):
        direct = weighted_inverse(basis, weight)[:6] @ series[7 * k : 7 * k + 41]
        np.testing.assert_allclose(whole[:, k], direct, atol=1e-12)
    short = window(8, 0.1, N)
    few = series[:17].copy()
    few[[0, 16]] = np.nan
    assert np.isnan(fit_windows(few, *short, 1)[0]).all()
    few = series[:17].copy()
    few[0] = np.nan
    assert np.isfinite(fit_windows(few, *short, 1)[0]).all()


def test_the_share_is_missing_where_either_is() -> None:
    step = 0.1
    time = step * np.arange(600)
    one, two = 0.02 * np.cos(N * time + 0.3), 0.01 * np.cos(N * time - 0.4)
    envelope = sliding_envelope(time, step, one, two, N)
    np.testing.assert_allclose(envelope.share, 2.0 * np.exp(0.7j), rtol=1e-9)
    assert envelope.hop == pytest.approx(1.0)
    assert np.isnan(sliding_envelope(time, step, one, 0.0 * two, N).share).all()
    assert np.isnan(sliding_envelope(time, step, one + np.nan, two, N).share).all()
