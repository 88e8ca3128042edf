"""Filters, taps, recursion, adjoint: each against its definition or a differently computed value."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from heavy_pair import observe
from scipy.integrate import solve_ivp

from pipeline.harmonics.envelope import block_envelope
from pipeline.inversion.iteration import Iteration, theta_influence
from pipeline.inversion.kernels import adjoint, expand, past_taps
from pipeline.inversion.motion import SWELL, design, motion, third_harmonic
from pipeline.methods.projection import linear_fit
from pipeline.methods.shooting import invert
from pipeline.prepared import Prepared, prepare


@pytest.mark.parametrize("step", [0.04, 0.1])
def test_filters_pass_the_swing_and_its_surroundings_exactly(step: float) -> None:
    frequency, damping = 6.22, 1e-3
    filters = design(frequency, step, damping)
    age = step * np.arange(-filters.reach, filters.reach + 1)

    def gains(rate: float) -> tuple[complex, complex]:
        wave = np.exp(1j * rate * age)
        return complex(filters.low @ wave), complex(filters.curvature @ wave)

    for share, allowed in (
        (0.0, 1e-14),
        (1.0, 1e-13),
        (SWELL, 1e-13),
        (0.1, 1e-10),
        (0.2, 1e-9),
        (0.95, 2e-9),
        (1.1, 2e-7),
        (2.0, 2e-6),
        (3.0, 1e-7),
    ):
        rate = share * frequency
        low, curvature = gains(rate)
        assert abs(low - 1.0) < allowed
        # the damping's part, 2 gamma theta', is as good as the window: 1e-6 of 1e-3
        assert abs(curvature - (-(rate**2) + 2j * damping * rate)) < 30 * allowed * frequency**2 + 2e-9
    for share in (6.0, 8.0):
        if share * frequency < np.pi / step:
            assert abs(gains(share * frequency)[0]) < 1e-6


def test_filters_know_what_noise_they_pass() -> None:
    filters = design(6.22, 0.04, 0.0)
    noise = np.random.default_rng(2).normal(size=400_000)
    low = np.convolve(noise, filters.low[::-1], "valid")
    bent = np.convolve(noise, filters.curvature[::-1], "valid")
    assert np.mean(low**2) == pytest.approx(filters.noise_low, rel=0.02)
    assert np.mean(low * bent) == pytest.approx(filters.noise_product, rel=0.02)


def test_past_taps_are_exact_for_a_swing() -> None:
    eigenvalue, step = complex(-2e-3, 6.2), 0.04
    taps = past_taps(eigenvalue, step)
    nodes, weights = np.polynomial.legendre.leggauss(20)
    x = 0.5 * step * (nodes + 1.0)
    kernel = 0.5 * step * weights * np.exp(eigenvalue * (step - x))
    for wave in (np.cos, np.sin):
        values = wave(eigenvalue.imag * np.array([0.0, -step]))
        whole = complex(taps @ values)
        assert abs(whole - kernel @ wave(eigenvalue.imag * x)) < 1e-15


def test_expansion_is_the_derivative() -> None:
    random = np.random.default_rng(4)
    about, theta, curvature = random.uniform(-0.1, 0.1, (3, 50))
    pull = 1.0 + random.uniform(-0.1, 0.1, 50)
    move = 1e-6
    here, there, faster = np.empty((3, 3, 50))
    expand(about, theta, curvature, pull, 6.2, 6.1, 0.0, *here)
    expand(about + move, theta, curvature, pull, 6.2, 6.1, 0.0, *there)
    expand(about, theta, curvature, pull, 6.2, 6.1 + move, 0.0, *faster)
    assert (there[0] - here[0]) / move == pytest.approx(here[1], abs=1e-4)
    assert (faster[0] - here[0]) / move == pytest.approx(here[2], abs=1e-5)
    w = curvature / 6.1**2
    bend = pull * np.sin(about) / np.cos(theta) + w * ((np.cos(about) - 1) + np.tan(theta) * np.sin(about))
    assert here[0] == pytest.approx(6.2**2 * about - 6.1**2 * bend, abs=1e-13)


def fitted(seconds: float = 300.0) -> tuple[Prepared, Iteration, np.ndarray]:
    seen = observe(seconds, 0.04, heave=True)
    prepared = prepare(seen)
    held = linear_fit(prepared)
    moved = motion(seen.theta, seen.vertical, seen.step, held.frequency, seen.frequency_ratio, 2e-4, 0.0)
    iteration = Iteration(seen, moved, held, prepared.gravity_of)
    return prepared, iteration, iteration.influence(iteration.fit(fit_damping=False).covariance[2])


def test_recursion_solves_the_linear_equation() -> None:
    """The tangent by the start angle against scipy's DOP853 on `s'' + 2 gamma s' + (held^2 - slope) s = 0`."""
    _, iteration, _ = fitted()
    step, slope, lam = 0.04, iteration.slope, iteration.eigenvalue
    time = np.arange(slope.size) * step
    square = lam.imag**2 + lam.real**2

    def rates(t: float, y: np.ndarray) -> list[float]:
        return [y[1], 2.0 * lam.real * y[1] - (square - np.interp(t, time, slope)) * y[0]]

    rows = slice(0, 1500, 100)
    found = solve_ivp(rates, (0.0, 60.0), [1.0, 0.0], "DOP853", time[rows], rtol=1e-9, atol=1e-12, max_step=0.04)
    # the taps of a tangent reach two points back only: its phase drifts by some 3e-5 rad a second in this motion
    assert iteration.columns[1][rows] == pytest.approx(found.y[0], abs=5e-3)


def test_influence_of_both_traces_is_the_change_they_make() -> None:
    """A swing-like change of either trace moves n2 by the sum of influence times change."""
    prepared, iteration, of_difference = fitted()
    seen, inside, frequency = prepared.observation, iteration.motion.inside, iteration.frequency
    of_theta = theta_influence(
        iteration, of_difference, prepared.gravity_of(frequency), seen.frequency_ratio, seen.damping_difference
    )
    # a change that dies out at the ends, where the filters reach beyond the inversion
    change = 1e-6 * np.cos(1.02 * frequency * seen.time + 0.3) * np.sin(np.pi * seen.time / seen.time[-1]) ** 2
    moved = invert(prepare(replace(seen, difference=seen.difference + change))).frequency
    scale = float(np.sum(np.abs(of_difference * change[inside])))
    assert moved - frequency == pytest.approx(float(of_difference @ change[inside]), abs=1e-3 * scale)
    for rate in (1.0, 2.95):  # near the swing, and where the nonlinear terms bring it back to the swing
        change = 1e-6 * np.cos(rate * frequency * seen.time + 0.3) * np.sin(np.pi * seen.time / seen.time[-1]) ** 2
        moved = invert(prepare(replace(seen, theta=seen.theta + change))).frequency
        scale = float(np.sum(np.abs(of_theta * change[inside])))
        assert moved - frequency == pytest.approx(float(of_theta @ change[inside]), abs=0.03 * scale)


def test_adjoint_is_the_transpose_of_the_response() -> None:
    random = np.random.default_rng(5)
    count, step, lam = 60, 0.05, complex(-1e-3, 6.2)
    influence = random.normal(size=count)
    out = np.empty(count)
    adjoint(influence, np.zeros(count), complex(np.exp(lam * step)), lam.imag, step, out)
    lag = (np.arange(count)[:, None] - np.arange(count)) * step
    response = np.where(lag > 0, np.exp(lam.real * lag) * np.sin(lam.imag * lag) / lam.imag, 0.0)
    assert out == pytest.approx(response.T @ influence, abs=1e-13)


def test_the_third_harmonic_is_that_of_a_real_pendulum() -> None:
    """`theta3 = -(A^3/192) cos 3 phi` (to A^2 of itself), from scipy's DOP853."""
    size, step = 0.1, 0.04
    time = np.arange(3000) * step
    swing = solve_ivp(
        lambda t, y: [y[1], -np.sin(y[0]) * 6.22**2], (0.0, 120.0), [size, 0.0], "DOP853", time, rtol=1e-12, atol=1e-14
    ).y[0]
    own = 6.22 * (1.0 - size**2 / 16.0)
    basis = np.stack([np.cos(k * own * time) for k in (1, 3, 5)], axis=-1)
    expected = np.linalg.lstsq(basis, swing, rcond=None)[0][1] * basis[:, 1]
    envelope = block_envelope(time, step, swing, swing, own)
    assert third_harmonic(envelope, time) == pytest.approx(expected, abs=0.03 * size**3 / 192.0)


def test_a_notch_is_deaf_at_the_third_harmonic_alone() -> None:
    frequency, step = 6.22, 0.04
    plain, notched = design(frequency, step, 0.0), design(frequency, step, 0.0, True)
    age = step * np.arange(-plain.reach, plain.reach + 1)

    def gain(taps: np.ndarray, share: float) -> float:
        return float(taps @ np.cos(share * frequency * age)) / -((share * frequency) ** 2)

    assert abs(gain(notched.curvature, 3.0)) < 1e-12
    assert gain(plain.curvature, 3.0) == pytest.approx(1.0, abs=1e-5)
    for share in (0.1, SWELL, 1.0):
        assert gain(notched.curvature, share) == pytest.approx(1.0, abs=2e-6)


def test_a_reckoned_third_harmonic_serves_as_the_read_one() -> None:
    """Noise so small that both ways are open; the pendulums swing by 20 mrad in swell and heave."""
    from pipeline.methods import shooting as module

    seen = observe(300.0, 0.04, heave=True)
    noise = 2e-6 * np.random.default_rng(9).normal(size=(2, seen.time.size))
    prepared = prepare(replace(seen, theta=seen.theta + noise[0], difference=seen.difference + noise[1]))
    assert not module.begin(prepared, linear_fit(prepared)).motion.third
    read = invert(prepared)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "NOISY", 0.0)
        reckoned = invert(prepared)
    assert reckoned.sigma < read.sigma
    assert abs(reckoned.frequency - read.frequency) < 3.0 * read.sigma
