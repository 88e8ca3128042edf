"""The phase-speed formulas against phases of integrated or exactly known motion, differentiated numerically."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from exact_pair import Pair, swell
from hypothesis import given
from hypothesis import strategies as st
from paper_formulas import (
    difference_amplitude,
    near_resonant_motion,
    quadrature_form,
    raw_components,
)
from scipy.integrate import solve_ivp

from pipeline.phase_speed import (
    amplitude_rate,
    disturbed_speed,
    leaking,
    near_resonant_amplitude,
    phase_speed,
    speed_of_difference,
)

STEP = 0.02
_STENCIL = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0.0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])
INNER = slice(4, -4)
DIFFERENTIATED = 1e-8  # rad/s: eighth-order differences at 0.02 s of phases good to 1e-11


def derivative(values: np.ndarray) -> np.ndarray:
    """Eighth-order central differences at INNER."""
    return np.convolve(values, _STENCIL[::-1], mode="valid") / STEP


def integrated(pair: Pair, duration: float = 60.0) -> tuple[np.ndarray, np.ndarray]:
    """State (theta1, theta1', theta2, theta2') by DOP853."""
    (n1, n2), (g1, g2) = pair.frequency, pair.damping
    zero = np.zeros(1)
    start = [pair.elongation(which, zero, order)[0] for which in (0, 1) for order in (0, 1)]

    def right(t: float, y: np.ndarray) -> list[float]:
        u = float(pair.acceleration_ratio(np.array([t]))[0])
        return [y[1], -2 * g1 * y[1] - n1**2 * (y[0] + u), y[3], -2 * g2 * y[3] - n2**2 * (y[2] + u)]

    time = np.arange(0.0, duration, STEP)
    found = solve_ivp(right, (0.0, duration), start, "DOP853", time, rtol=1e-12, atol=1e-14)
    return time, found.y


@pytest.fixture(scope="module")
def heavy() -> tuple[Pair, np.ndarray, np.ndarray]:
    """psi of 75 mrad on 12 and 6 mrad, with a near-resonant part."""
    n1 = 2.0 * np.pi / 1.01 * 1.001
    pair = Pair.apart(1e-3, forcing=(*swell(4, 0.05), (4e-5, n1 - 0.052, 0.7)))
    return pair, *integrated(pair)


def test_closed_form_agrees_with_runge_kutta(heavy: tuple[Pair, np.ndarray, np.ndarray]) -> None:
    pair, time, state = heavy
    assert np.abs(state[0] - pair.elongation(0, time)).max() < 1e-10
    assert np.abs(state[2] - pair.elongation(1, time)).max() < 1e-10


def test_9_is_exact_for_the_fictitious_pendulum_under_any_motion(heavy: tuple[Pair, np.ndarray, np.ndarray]) -> None:
    pair, _, (one, one_speed, two, two_speed) = heavy
    n1, n2 = pair.frequency
    z1, z2 = one - 1j * one_speed / n1, two - 1j * two_speed / n2
    z = z1 - n1 / n2 * z2
    said = phase_speed(n1, n2, np.abs(z1), np.abs(z), np.angle(z1) - np.angle(z))[INNER]
    assert np.abs(said - derivative(np.unwrap(np.angle(z)))).max() < DIFFERENTIATED
    growth = amplitude_rate(n1 - n2, np.abs(z1), np.abs(z), np.angle(z1) - np.angle(z))[INNER]
    assert np.abs(growth - derivative(np.abs(z))).max() < DIFFERENTIATED


def test_14_differs_from_9_by_what_it_neglects_only(heavy: tuple[Pair, np.ndarray, np.ndarray]) -> None:
    pair, time, (one, one_speed, two, two_speed) = heavy
    n1, n2 = pair.frequency
    z1, z2 = one - 1j * one_speed / n1, two - 1j * two_speed / n2
    z = z1 - n1 / n2 * z2
    slow = Pair(pair.frequency, forcing=pair.forcing[:-1])
    near = Pair(pair.frequency, free=pair.free, forcing=pair.forcing[-1:])
    signal = near.harmonic(0, time)
    alpha, m, delta = near.forcing[0]
    signal = signal - n1**2 / (n1**2 - m**2) * alpha * np.exp(1j * (m * time + delta))
    phi = np.angle(z)
    said = leaking(
        n1, n2, np.abs(signal), np.abs(z), np.angle(signal) - phi, phi, slow.slow(0, time), slow.slow(0, time, 1)
    )
    exact = phase_speed(n1, n2, np.abs(z1), np.abs(z), np.angle(z1) - phi)
    change = np.abs(derivative(signal) / signal[INNER] - 1j * n1).max()
    bound = (n1 - n2) * change / n1 * (np.abs(signal) / np.abs(z)).max()
    assert np.abs(said - exact).max() <= bound
    assert bound < 0.02 * np.abs(exact - n2).max()


def test_14_leak_is_the_whole_difference_of_raw_and_separated() -> None:
    """Free pendulums and swell: (14) is exact, and its leak is what (9) on raw readings errs by."""
    pair = Pair.apart(1e-4, forcing=swell(3))
    n1, n2 = pair.frequency
    time = np.arange(0.0, 40.0, STEP)
    z1 = pair.elongation(0, time) - 1j * pair.elongation(0, time, 1) / n1
    z2 = pair.elongation(1, time) - 1j * pair.elongation(1, time, 1) / n2
    z, free = z1 - n1 / n2 * z2, pair.harmonic(0, time)
    arguments = (np.abs(free), np.abs(z), np.angle(free / z))
    raw = phase_speed(n1, n2, np.abs(z1), np.abs(z), np.angle(z1 / z))
    said = leaking(n1, n2, *arguments, np.angle(z), pair.slow(0, time), pair.slow(0, time, 1))
    assert np.abs(raw - said).max() < 1e-12
    assert np.abs(raw - phase_speed(n1, n2, *arguments)).max() > 1e-3


def test_27_undamped_is_exact_for_the_separated_harmonics() -> None:
    pair = Pair.apart(1e-3, forcing=swell(4))
    n1, n2 = pair.frequency
    time, state = integrated(pair)
    v1 = state[0] - pair.slow(0, time) - 1j * (state[1] - pair.slow(0, time, 1)) / n1
    v2 = state[2] - pair.slow(1, time) - 1j * (state[3] - pair.slow(1, time, 1)) / n2
    z = v1 - v2
    lead = np.angle(v1 / z)
    said = phase_speed(n1, n2, np.abs(v1), np.abs(z), lead)[INNER]
    assert np.abs(said - derivative(np.unwrap(np.angle(z)))).max() < DIFFERENTIATED
    assert np.abs(amplitude_rate(n1 - n2, np.abs(v1), np.abs(z), lead)[INNER] - derivative(np.abs(z))).max() < 1e-9


@pytest.mark.parametrize("damping", [(2e-4, 2e-4), (5e-4, 1e-4), (0.0, 3e-4)])
def test_27_with_damping_of_decaying_harmonics(damping: tuple[float, float]) -> None:
    pair = Pair.apart(1e-3, damping=damping)
    time = np.arange(0.0, 60.0, STEP)
    one = pair.harmonic(0, time)
    z = one - pair.harmonic(1, time)
    w1, w2 = (np.sqrt(n**2 - g**2) for n, g in zip(pair.frequency, damping, strict=True))
    lead = np.angle(one / z)
    difference = damping[0] - damping[1]
    said = phase_speed(w1, w2, np.abs(one), np.abs(z), lead, difference)[INNER]
    assert np.abs(said - derivative(np.unwrap(np.angle(z)))).max() < DIFFERENTIATED
    growth = amplitude_rate(w1 - w2, np.abs(one), np.abs(z), lead, damping[1], difference)[INNER]
    assert np.abs(growth - derivative(np.abs(z))).max() < 1e-9
    if difference:  # the damping's term counts, and with this sign
        wrong = phase_speed(w1, w2, np.abs(one), np.abs(z), lead, -difference)[INNER]
        assert np.abs(wrong - said).max() > 1e-5


def test_27_integrated_over_a_near_resonant_beat(heavy: tuple[Pair, np.ndarray, np.ndarray]) -> None:
    """With forcing near resonance (27) neglects dn xi/(g a) only; integrated it is what is left of the phase."""
    pair, time, state = heavy
    n1, n2 = pair.frequency
    slow = Pair(pair.frequency, forcing=pair.forcing[:-1])
    v1 = state[0] - slow.slow(0, time) - 1j * (state[1] - slow.slow(0, time, 1)) / n1
    z = v1 - (state[2] - slow.slow(1, time) - 1j * (state[3] - slow.slow(1, time, 1)) / n2)
    said = phase_speed(n1, n2, np.abs(v1), np.abs(z), np.angle(v1 / z))[INNER]
    neglected = (n1 - n2) * pair.forcing[-1][0] / np.abs(z).min()
    departure = np.abs(said - derivative(np.unwrap(np.angle(z)))).max()
    assert 0.1 * neglected < departure < 1.001 * neglected


def _two_harmonics(time: np.ndarray) -> tuple[Callable[[int], np.ndarray], ...]:
    """Amplitude, its rate, phase and its rate of two quite arbitrary harmonics."""
    size = [0.01 * (1.2 + 0.3 * np.sin(0.11 * time)), 0.007 * np.exp(-0.004 * time)]
    size_speed = [0.01 * 0.3 * 0.11 * np.cos(0.11 * time), -0.004 * size[1]]
    phase = [6.2 * time + 0.3 * np.sin(0.2 * time), 6.18 * time - 0.001 * time**2 + 1.0]
    speed = [6.2 + 0.06 * np.cos(0.2 * time), 6.18 - 0.002 * time]
    return tuple(lambda k, row=row: row[k] for row in (size, size_speed, phase, speed))


def test_36_37_38_are_identities_for_any_two_harmonics() -> None:
    time = np.arange(0.0, 80.0, STEP)
    size, size_speed, phase, speed = _two_harmonics(time)
    z = size(0) * np.exp(1j * phase(0)) - size(1) * np.exp(1j * phase(1))
    lead = phase(0) - phase(1)
    assert np.abs(difference_amplitude(size(0), size(1), lead) - np.abs(z)).max() < 1e-15
    exact = derivative(np.unwrap(np.angle(z)))
    by_36 = speed_of_difference((size(0), size(1)), lead, (speed(0), speed(1)), (size_speed(0), size_speed(1)))
    decay = size_speed(1) / size(1) - size_speed(0) / size(0)
    by_38 = phase_speed(speed(0), speed(1), size(0), np.abs(z), phase(0) - np.angle(z), decay)
    assert np.abs(by_36[INNER] - exact).max() < 1e-7  # a comes down to a quarter: its phase turns fast
    assert np.abs(by_38 - by_36).max() < 1e-11


@given(
    sizes=st.tuples(st.floats(1e-3, 1.0), st.floats(1e-3, 1.0)),
    rates=st.tuples(*[st.floats(-5.0, 5.0)] * 4),
    lead=st.floats(0.2, 6.0),
)
def test_36_laws(sizes: tuple[float, float], rates: tuple[float, ...], lead: float) -> None:
    """Exchange of the harmonics changes z to -z, not its speed; a common rotation is carried over."""
    (a1, a2), (p1, p2, g1, g2) = sizes, rates
    value = speed_of_difference((a1, a2), lead, (p1, p2), (g1, g2))
    swapped = speed_of_difference((a2, a1), -lead, (p2, p1), (g2, g1))
    scale = (
        1e-9 * (1.0 + max(a1, a2) / difference_amplitude(a1, a2, lead)) ** 2 * (1.0 + max(map(abs, rates)) / min(sizes))
    )
    assert abs(value - swapped) < scale
    assert abs(speed_of_difference((a1, a2), lead, (p1 + 3.0, p2 + 3.0), (g1, g2)) - value - 3.0) < scale


def test_36_fed_with_model_speeds_is_27() -> None:
    """Undamped, arcs neglected: constant speeds and amplitudes in (36) give (27)."""
    n1, n2, one, two, lead = 6.2215, 6.2209, 0.012, 0.006, np.linspace(0.1, 6.0, 50)
    z = one * np.exp(1j * lead) - two
    said = speed_of_difference((one, two), lead, (n1, n2), (0.0, 0.0))
    assert np.abs(said - phase_speed(n1, n2, one, np.abs(z), lead - np.angle(z))).max() < 1e-14


def test_26_at_the_free_harmonic_has_no_extra_term() -> None:
    phase = np.linspace(0.0, 6.0, 20)
    cosine, sine = raw_components(6.2, 0.01, phase - 0.3, 0.3, phase, 6.2, 0.0)
    assert np.abs(cosine - 0.01 * np.cos(phase - 0.3)).max() < 1e-16
    assert np.abs(sine - 0.01 * np.sin(phase - 0.3)).max() < 1e-16


@pytest.mark.parametrize("nu", [0.026, -0.05, 1e-5])
def test_30_31_39_against_runge_kutta(nu: float) -> None:
    n, alpha, delta = 6.2209, 4e-5, 0.7
    beta = near_resonant_amplitude(n, nu, alpha)
    time = np.arange(0.0, 60.0, STEP)
    start = near_resonant_motion(np.array([0.0]), n, nu, alpha, delta, 0.01, 0.4)[0]
    # speed at the start: -theta01 n sin(phi01) + beta nu sin(delta)
    speed = -0.01 * n * np.sin(0.4) + beta * nu * np.sin(delta)
    found = solve_ivp(
        lambda t, y: [y[1], -(n**2) * (y[0] + alpha * np.cos((n - 2 * nu) * t + delta))],
        (0.0, 60.0),
        [start, speed],
        "DOP853",
        time,
        rtol=1e-12,
        atol=1e-14,
    )
    assert np.abs(found.y[0] - near_resonant_motion(time, n, nu, alpha, delta, 0.01, 0.4)).max() < 1e-10
    wave = beta * np.sin(nu * time)
    signal = 0.01 * np.exp(1j * (n * time + 0.4)) - 1j * wave * np.exp(1j * ((n - nu) * time + delta))
    assert np.abs(signal.real - found.y[0]).max() < 1e-10
    said = disturbed_speed(time, n, nu, beta, delta, 0.01, 0.4)[INNER]
    assert np.abs(said - derivative(np.unwrap(np.angle(signal)))).max() < DIFFERENTIATED


def test_30_at_exact_resonance_grows_linearly() -> None:
    time = np.linspace(0.0, 50.0, 400)
    found = near_resonant_motion(time, 6.2, 0.0, 1e-4, 0.3, 0.0, 0.0)
    assert np.abs(found + 0.5 * 6.2 * 1e-4 * time * np.sin(6.2 * time + 0.3)).max() < 1e-15


def test_32_is_the_same_motion_as_a_cosine() -> None:
    angle = np.linspace(-10.0, 10.0, 500)
    assert np.abs(quadrature_form(0.3 * angle, angle) - 0.3 * angle * np.sin(angle)).max() < 1e-14
