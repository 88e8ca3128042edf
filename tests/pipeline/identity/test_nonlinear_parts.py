"""Filters, expansion, system, adjoint: each against its definition or a differently computed value."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from exact_pair import Pair
from heavy_pair import observe
from scipy.integrate import solve_ivp
from scipy.linalg.lapack import dtbtrs

from pipeline.harmonics.envelope import sliding_envelope
from pipeline.methods.exact import SWELL, Motion, design, invert, motion, nonlinear_fit, third_harmonic
from pipeline.methods.identity import Fit
from pipeline.prepared import Prepared, prepare


@pytest.mark.parametrize("step", [0.04, 0.1])
def test_filters_pass_the_swing_and_its_surroundings_exactly(step: float) -> None:
    frequency, damping = 6.22, 1e-3
    lowpass, bending = design(frequency, step, damping)
    age = step * (np.arange(lowpass.size) - lowpass.size // 2)

    def gains(rate: float) -> tuple[complex, complex]:
        wave = np.exp(1j * rate * age)
        return complex(lowpass @ wave), complex(bending @ wave)

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


def test_shift_is_what_noise_adds_on_average() -> None:
    noise, size = 1e-4 * np.random.default_rng(2).normal(size=400_000), 1e-4
    seen = Pair((1.1 * 6.22, 6.22)).observe(np.arange(noise.size) * 0.04, step=0.04, theta=noise)
    found = motion(seen, 6.22, 0.0, size)
    expected = np.mean(0.5 * 6.22**2 * found.low**2 + found.low * found.bend)
    assert found.shift == pytest.approx(expected, rel=0.02)


def moving(**changes: object) -> Motion:
    """Random motion of fifty samples."""
    random = np.random.default_rng(4)
    low, bend = random.uniform(-0.1, 0.1, (2, 50))
    seen = Pair((6.2, 6.2)).observe(np.arange(50) * 0.04, step=0.04, vertical=random.uniform(-1.0, 1.0, 50))
    plain = Motion(seen, 6.2, slice(0, 50), design(6.2, 0.04, 0.0), low, bend, 0.0)
    return replace(plain, **changes)  # type: ignore[arg-type]  # changes are fields of Motion


def test_expansion_is_the_derivative() -> None:
    about, move, moved = np.random.default_rng(5).uniform(-0.1, 0.1, 50), 1e-6, moving()
    here, by_angle, by_frequency = moved.expand(about, 6.1)
    assert (moved.expand(about + move, 6.1)[0] - here) / move == pytest.approx(by_angle, abs=1e-4)
    assert (moved.expand(about, 6.1 + move)[0] - here) / move == pytest.approx(by_frequency, abs=1e-5)
    w, theta = moved.bend / 6.1**2, moved.low
    pull = 1.0 + moved.observation.vertical / moved.observation.felt_gravity(6.1)
    bend = pull * np.sin(about) / np.cos(theta) + w * ((np.cos(about) - 1) + np.tan(theta) * np.sin(about))
    assert here == pytest.approx(6.2**2 * about - 6.1**2 * bend, abs=1e-13)
    noisy = moving(shift=1e-3).expand(about, 6.1)[0]
    assert noisy - here == pytest.approx(1e-3 * np.sin(about), abs=1e-13)


def fitted(seconds: float = 300.0) -> tuple[Prepared, Motion, Fit]:
    prepared = prepare(observe(seconds, 0.04, heave=True))
    return prepared, *nonlinear_fit(prepared)


def test_system_solves_the_linear_equation() -> None:
    """The tangent by the start angle against scipy's DOP853 on `s'' + 2 gamma s' + (held^2 - stiffness) s = 0`."""
    _, moved, fit = fitted()
    step, gamma = 0.04, fit.damping_rate
    time = np.arange(fit.model.size) * step

    def rates(t: float, y: np.ndarray) -> list[float]:
        return [y[1], -2.0 * gamma * y[1] - (moved.held**2 - np.interp(t, time, fit.stiffness)) * y[0]]

    rows = slice(0, 1500, 100)
    found = solve_ivp(rates, (0.0, 60.0), [1.0, 0.0], "DOP853", time[:1500], rtol=1e-9, atol=1e-12, max_step=0.04).y[0]
    matrix = fit.weights.system(fit.stiffness)
    start = np.zeros(fit.model.size)
    start[0], start[1] = found[0] * matrix[0, 0], found[1] * matrix[0, 1] + found[0] * matrix[1, 0]
    # the taps of a tangent are two: its phase drifts by some 2e-5 rad a second in this motion
    assert dtbtrs(matrix, start, uplo="L")[0][:1500][rows] == pytest.approx(found[rows], abs=2e-3)


def test_influence_of_both_traces_is_the_change_they_make() -> None:
    """A swing-like change of either trace moves n2 by the sum of influence times change."""
    prepared, moved, fit = fitted()
    seen, inside, frequency = prepared.observation, moved.inside, fit.frequency
    of_theta = moved.influence(fit)
    # a change that dies out at the ends, where the filters reach beyond the inversion
    change = 1e-6 * np.cos(1.02 * frequency * seen.time + 0.3) * np.sin(np.pi * seen.time / seen.time[-1]) ** 2
    turned = invert(prepare(replace(seen, difference=seen.difference + change))).frequency
    scale = float(np.sum(np.abs(fit.influence * change[inside])))
    assert turned - frequency == pytest.approx(float(fit.influence @ change[inside]), abs=1e-3 * scale)
    for rate in (1.0, 2.95):  # near the swing, and where the nonlinear terms bring it back to the swing
        change = 1e-6 * np.cos(rate * frequency * seen.time + 0.3) * np.sin(np.pi * seen.time / seen.time[-1]) ** 2
        turned = invert(prepare(replace(seen, theta=seen.theta + change))).frequency
        scale = float(np.sum(np.abs(of_theta * change)))
        assert turned - frequency == pytest.approx(float(of_theta @ change), abs=2e-3 * scale)


def test_adjoint_is_the_transpose_of_the_response() -> None:
    _, _, fit = fitted()
    right = np.random.default_rng(5).normal(size=fit.model.size)
    response = dtbtrs(fit.weights.system(fit.stiffness), right, uplo="L")[0]
    assert fit.adjoint @ right == pytest.approx(fit.influence @ response, rel=1e-9)


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
    envelope = sliding_envelope(time, step, swing, swing, own)
    assert third_harmonic(envelope, time) == pytest.approx(expected, abs=0.03 * size**3 / 192.0)


def test_a_notch_is_deaf_at_the_third_harmonic_alone() -> None:
    frequency, step = 6.22, 0.04
    plain, notched = (design(frequency, step, 0.0, notch)[1] for notch in (False, True))
    age = step * (np.arange(plain.size) - plain.size // 2)

    def gain(taps: np.ndarray, share: float) -> float:
        return float(taps @ np.cos(share * frequency * age)) / -((share * frequency) ** 2)

    assert abs(gain(notched, 3.0)) < 1e-12
    assert gain(plain, 3.0) == pytest.approx(1.0, abs=1e-5)
    for share in (0.1, SWELL, 1.0):
        assert gain(notched, share) == pytest.approx(1.0, abs=2e-6)


def test_a_reckoned_third_harmonic_serves_as_the_read_one() -> None:
    """Noise so small that both ways are open; the pendulums swing by 20 mrad in swell and heave."""
    from pipeline.methods import exact as module

    seen = observe(300.0, 0.04, heave=True)
    noise = 2e-6 * np.random.default_rng(9).normal(size=(2, seen.time.size))
    prepared = prepare(replace(seen, theta=seen.theta + noise[0], difference=seen.difference + noise[1]))
    assert prepared.noise_theta < module.NOISY * np.abs(prepared.sliding.first).min()
    read = invert(prepared)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "NOISY", 0.0)
        reckoned = invert(prepared)
    assert reckoned.sigma < read.sigma
    assert abs(reckoned.frequency - read.frequency) < 3.0 * read.sigma
