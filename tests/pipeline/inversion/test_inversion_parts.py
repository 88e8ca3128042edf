"""Filters, taps, recursion, adjoint: each against its definition or a differently computed value."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from heavy_pair import observe
from scipy.integrate import solve_ivp

from pipeline.inversion import kernels
from pipeline.inversion.filters import SWELL, design
from pipeline.inversion.influence import adjoint
from pipeline.inversion.iteration import Iteration, past_taps
from pipeline.inversion.motion import Motion
from pipeline.inversion.prepare import invert
from pipeline.inversion.solve import fit_inversion
from pipeline.methods.projection import linear_fit
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


def test_both_filters_at_once() -> None:
    filters = design(6.22, 0.04, 1e-3)
    theta = np.random.default_rng(3).normal(size=1300)
    out = np.empty((2, theta.size - 2 * filters.reach))
    kernels.filter_both(theta, filters.low, filters.curvature, *out)
    for row, taps in zip(out, (filters.low, filters.curvature), strict=True):
        assert row == pytest.approx(np.convolve(theta, taps[::-1], "valid"), abs=1e-9)


def test_past_taps_are_exact_for_a_swing() -> None:
    eigenvalue, step = complex(-2e-3, 6.2), 0.04
    taps = past_taps(eigenvalue, step)
    nodes, weights = np.polynomial.legendre.leggauss(20)
    x = 0.5 * step * (nodes + 1.0)
    kernel = 0.5 * step * weights * np.exp(eigenvalue * (step - x))
    for wave in (np.cos, np.sin):
        values = wave(eigenvalue.imag * np.array([0.0, -step]))
        whole = complex(taps[0] @ values, taps[1] @ values)
        assert abs(whole - kernel @ wave(eigenvalue.imag * x)) < 1e-15


def test_expansion_is_the_derivative() -> None:
    random = np.random.default_rng(4)
    about, theta, curvature = random.uniform(-0.1, 0.1, (3, 50))
    pull = 1.0 + random.uniform(-0.1, 0.1, 50)
    here, there, faster = np.empty((3, 3, 50))
    move = 1e-6
    kernels.expand_small(about, theta, curvature, pull, 6.2, 6.1, 0.0, *here)
    kernels.expand_small(about + move, theta, curvature, pull, 6.2, 6.1, 0.0, *there)
    kernels.expand_small(about, theta, curvature, pull, 6.2, 6.1 + move, 0.0, *faster)
    assert (there[0] - here[0]) / move == pytest.approx(here[1], abs=1e-4)
    assert (here[0] - faster[0]) / move == pytest.approx(here[2], abs=1e-5)
    w = curvature / 6.1**2
    bend = pull * np.sin(about) / np.cos(theta) + w * ((np.cos(about) - 1) + np.tan(theta) * np.sin(about))
    assert here[0] == pytest.approx(6.2**2 * about - 6.1**2 * bend, abs=1e-13)


def fitted(seconds: float = 300.0) -> tuple[Prepared, Iteration, float]:
    seen = observe(seconds, 0.04, heave=True)
    prepared = prepare(seen)
    held = linear_fit(prepared)
    motion = Motion(seen.theta, seen.vertical, seen.step, held.frequency, seen.frequency_ratio, 2e-4, 0.0)
    iteration = Iteration(seen, motion, held, prepared.gravity_of)
    fit = fit_inversion(iteration, fit_damping=False)
    return prepared, iteration, fit.frequency


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
    prepared, iteration, frequency = fitted()
    seen, inside = prepared.observation, iteration.motion.inside
    from pipeline.inversion.influence import theta_influence

    grid_fit = fit_inversion(iteration, fit_damping=False)
    of_difference = iteration.least_squares_influence(grid_fit.weights)
    motion = iteration.motion
    of_theta = theta_influence(
        of_difference,
        iteration.slope,
        motion.low,
        motion.curvature,
        iteration.about,
        frequency**2 * motion.pull(prepared.gravity_of(frequency)),
        motion.step,
        iteration.eigenvalue,
        seen.frequency_ratio,
        frequency,
        seen.damping_difference,
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
    adjoint(influence, np.zeros(count), complex(np.exp(lam * step)), lam.imag, step, 0.0j, out)
    lag = (np.arange(count)[:, None] - np.arange(count)) * step
    response = np.where(lag > 0, np.exp(lam.real * lag) * np.sin(lam.imag * lag) / lam.imag, 0.0)
    assert out == pytest.approx(response.T @ influence, abs=1e-13)


def test_a_turning_envelope() -> None:
    """Against interpolation and the exponential written out; beyond its ends the envelope is steady."""
    random = np.random.default_rng(7)
    envelope = random.normal(size=12) + 1j * random.normal(size=12)
    begin, hop, rate, step = 1.5, 4.0, 18.6, 0.07
    out = np.empty(800)
    kernels.turning(envelope, begin, hop, rate, step, out)
    time = step * np.arange(800)
    knots = begin + hop * np.arange(12)
    slow = np.interp(time, knots, envelope.real) + 1j * np.interp(time, knots, envelope.imag)
    assert out == pytest.approx((slow * np.exp(1j * rate * time)).real, abs=1e-11)


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
    from pipeline.inversion import prepare as module

    seen = observe(300.0, 0.04, heave=True)
    noise = 2e-6 * np.random.default_rng(9).normal(size=(2, seen.time.size))
    prepared = prepare(replace(seen, theta=seen.theta + noise[0], difference=seen.difference + noise[1]))
    assert module.third_harmonic(prepared) is None
    read = invert(prepared)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "NOISY", 0.0)
        reckoned = invert(prepared)
    assert reckoned.sigma < read.sigma
    assert abs(reckoned.frequency - read.frequency) < 3.0 * read.sigma
