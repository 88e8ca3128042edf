"""The Cramer-Rao bound: its printed limit, the algebra behind it, and the physics of its response."""

from __future__ import annotations

import numpy as np
import pytest
from fisher import Pair, bound, gravity_bound, jacobian, respond

from pipeline.benchmarks.bars import BOUNDS, RATES
from pipeline.benchmarks.scenes import linear, real, two_pendulums
from synth import simulate

SINGLE = Pair(frequency=6.2, ratio=1.0, damping_rate=0.0, damping_difference=0.0, swing=0.015 * np.exp(0.3j))
DAMPED = Pair(frequency=6.2, ratio=1.001, damping_rate=1e-3, damping_difference=2e-4, swing=0.015 * np.exp(0.3j))
STEP = 0.04


def swing(count: int) -> np.ndarray:
    return 0.01 * np.cos(6.2 * STEP * np.arange(count) + 0.4)


def printed_bound(samples: int, noise: float, rate: float, amplitude: float) -> float:
    """`sqrt(24/(N (N^2-1))) sigma fs/a`: frequency of one sinusoid in white noise, rad s-1."""
    return float(np.sqrt(24.0 / (samples * (samples**2 - 1.0))) * noise * rate / amplitude)


def test_equal_pendulums_have_the_printed_bound_of_one_sinusoid() -> None:
    # sqrt(24/(N(N^2-1))) neglects the offset and the double frequency: terms of order 1/(n T), here 1/1200
    found = bound(SINGLE, swing(5000), STEP, 1e-4, 1e-4)
    assert found == pytest.approx(printed_bound(5000, 1e-4, 1.0 / STEP, 0.015), rel=2e-3)


def test_bound_is_that_of_the_dense_covariance() -> None:
    count = 200
    response = np.stack([respond(DAMPED, unit, STEP) for unit in np.eye(count)], axis=-1)
    covariance = (1e-4) ** 2 * np.eye(count) + (3e-3) ** 2 * response @ response.T
    columns = jacobian(DAMPED, swing(count), STEP, damping_known=False)
    information = columns.T @ np.linalg.solve(covariance, columns)
    dense = np.sqrt(np.linalg.inv(information)[0, 0])
    # conjugate gradients stop at 1e-8 of the residual
    assert bound(DAMPED, swing(count), STEP, 3e-3, 1e-4, damping_known=False) == pytest.approx(dense, rel=1e-6)


def test_adjoint_is_the_transpose() -> None:
    one, other = np.random.default_rng(0).normal(size=(2, 300))
    forward = respond(DAMPED, one, STEP) @ other
    assert respond(DAMPED, other, STEP, adjoint=True) @ one == pytest.approx(forward, rel=1e-12)


def test_noise_of_the_first_pendulum_raises_the_bound() -> None:
    quiet, loud = (bound(DAMPED, swing(5000), STEP, sigma, 1e-4) for sigma in (0.0, 1e-4))
    assert loud > 1.05 * quiet


def test_more_unknowns_raise_the_bound() -> None:
    known, fitted = (bound(DAMPED, swing(500), STEP, 1e-4, 1e-4, damping_known=known) for known in (True, False))
    assert fitted > known


def test_readings_at_marks_cost_the_square_root_of_their_number() -> None:
    every = 12  # 0.48 s: 2.1 readings a swing
    full, few = (bound(SINGLE, swing(24001), STEP, 0.0, 1e-4, every=k) for k in (1, every))
    # the double frequency is an image of a slow beat there, which 960 s average to a per cent
    assert few / full == pytest.approx(np.sqrt(every), rel=0.02)


def test_response_is_the_exact_linear_identity() -> None:
    """What the simulator's two pendulums do differs by L theta1 and a free swing of the second."""
    scene = two_pendulums("identity", 1e-3, damping_rates=(2e-3, 1e-3), duration=40.0, sampling_rate=100)
    known = simulate(scene)[1]["truth"].dataset
    theta, (n1, n2) = np.asarray(known["theta"].values), np.asarray(known["frequency"].values)
    pair = Pair(n2, n1 / n2, 1e-3, 1e-3, 0.0)
    rest = theta[0] - theta[1] - respond(pair, theta[0], 0.01)
    time = 0.01 * np.arange(rest.size)
    growth = np.exp(pair.eigenvalue * time)
    basis = np.stack([growth.real, growth.imag], axis=-1)
    left = rest - basis @ np.linalg.lstsq(basis, rest, rcond=None)[0]
    # trapezoidal sum: (n step)^2/12 of the response, 3e-4 of it
    assert np.abs(left).max() < 1e-3 * np.abs(respond(pair, theta[0], 0.01)).max()


def test_bound_of_a_scene_is_in_mgal_and_scales_with_its_noise() -> None:
    scenes = [linear(1e-5, noise=noise, duration=60.0) for noise in (1e-5, 1e-4)]
    small, large = map(gravity_bound, scenes)
    assert large == pytest.approx(10.0 * small, rel=1e-6)
    amplitude = abs(0.006 * np.exp(0.4j) - 0.012 * np.exp(2.2j))
    sinusoid = printed_bound(1500, 1e-4, 25.0, amplitude) * 2.0 * 9.8123456 / 6.22 / 1e-5
    # a minute of record: offset and double frequency count by a per cent, damping and resonance by a few
    assert large == pytest.approx(sinusoid, rel=0.1)


@pytest.mark.parametrize("words", [*BOUNDS])
@pytest.mark.parametrize("rate", [pytest.param(rate, marks=[pytest.mark.campaign] * (rate < 25)) for rate in RATES])
def test_the_bounds_of_the_bars(words: str, rate: int) -> None:
    scene = {"linear": linear, "real": real}[words](1e-5, noise=1e-4, sampling_rate=rate)
    assert gravity_bound(scene) == pytest.approx(BOUNDS[words][RATES.index(rate)], rel=1e-5)
