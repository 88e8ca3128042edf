"""Every misprint of Panteleev (1958): the printed form fails where the corrected one holds.

The motion is that of two linear pendulums under a slow harmonic and one close to resonance, in closed form; a test of
its own checks it against a Runge-Kutta integration of equations (1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from paper_formulas import near_resonant_motion, raw_components
from scipy.integrate import solve_ivp

from pipeline import phase_speed as formulas
from pipeline.phase_speed import disturbed_speed, leaking, near_resonant_amplitude, speed_of_difference

N1, N2 = 2.0 * np.pi / 1.009, 2.0 * np.pi / 1.010  # apart by 1e-3, so that an index in the wrong place shows
NU, ALPHA, DELTA = np.pi / 120.0, 4e-5, 0.7
SLOW_ALPHA, SLOW_M, SLOW_DELTA = 0.07, 2.0 * np.pi / 9.0, 1.1
TIME = np.linspace(0.0, 130.0, 4001)
ROUNDING = 1e-12  # closed forms of size 0.1 with derivatives of size 4
VISIBLE = 1e-4  # a wrong formula departs by far more than rounding


@dataclass(frozen=True)
class Harmonic:
    """A motion with its first two derivatives at TIME."""

    value: np.ndarray
    speed: np.ndarray
    acceleration: np.ndarray

    def __add__(self, other: Harmonic) -> Harmonic:
        return Harmonic(self.value + other.value, self.speed + other.speed, self.acceleration + other.acceleration)


def cosine(amplitude: float, frequency: float, phase: float) -> Harmonic:
    angle = frequency * TIME + phase
    return Harmonic(
        amplitude * np.cos(angle), -amplitude * frequency * np.sin(angle), -amplitude * frequency**2 * np.cos(angle)
    )


def forced(n: float, alpha: float, m: float, delta: float) -> Harmonic:
    return cosine(-(n**2) * alpha / (n**2 - m**2), m, delta)


M = N1 - 2.0 * NU
FREE = (cosine(0.012, N1, 0.4), cosine(0.006, N2, 2.2))
PSI = tuple(forced(n, SLOW_ALPHA, SLOW_M, SLOW_DELTA) for n in (N1, N2))
NEAR = tuple(forced(n, ALPHA, M, DELTA) for n in (N1, N2))
HARMONIC = tuple(free + near for free, near in zip(FREE, NEAR, strict=True))
THETA = tuple(harmonic + psi for harmonic, psi in zip(HARMONIC, PSI, strict=True))
SLOW_U = SLOW_ALPHA * np.cos(SLOW_M * TIME + SLOW_DELTA)
XI = ALPHA * np.cos(M * TIME + DELTA)  # xi / g
U = SLOW_U + XI  # x'' / g


def phasor(motion: Harmonic, n: float, sign: float = -1.0) -> tuple[np.ndarray, np.ndarray]:
    """`z = theta -+ i theta'/n` and z'."""
    return motion.value + sign * 1j * motion.speed / n, motion.speed + sign * 1j * motion.acceleration / n


Z1, Z1_SPEED = phasor(THETA[0], N1)
Z2, Z2_SPEED = phasor(THETA[1], N2)
V1, V1_SPEED = phasor(HARMONIC[0], N1)
V2, V2_SPEED = phasor(HARMONIC[1], N2)


def worst(values: np.ndarray) -> float:
    return float(np.abs(values).max())


def test_the_motion_solves_the_equations_of_the_pendulums() -> None:
    def right(t: float, y: np.ndarray) -> list[float]:
        u = SLOW_ALPHA * np.cos(SLOW_M * t + SLOW_DELTA) + ALPHA * np.cos(M * t + DELTA)
        return [y[1], -(N1**2) * (y[0] + u), y[3], -(N2**2) * (y[2] + u)]

    start = [THETA[0].value[0], THETA[0].speed[0], THETA[1].value[0], THETA[1].speed[0]]
    found = solve_ivp(right, (0.0, TIME[-1]), start, "DOP853", TIME, rtol=1e-12, atol=1e-14)
    assert worst(found.y[0] - THETA[0].value) < 1e-9  # 130 s at a tolerance of 1e-12 a step
    assert worst(found.y[2] - THETA[1].value) < 1e-9


def test_2_the_support_is_added_to_the_second_pendulum() -> None:
    left = THETA[0].acceleration - THETA[1].acceleration + N1**2 * (THETA[0].value - THETA[1].value)
    assert worst(left - (N2**2 - N1**2) * (THETA[1].value + U)) < ROUNDING
    assert worst(left - (N2**2 - N1**2) * (THETA[1].value - U)) > VISIBLE


def test_4_the_modulus_of_z1_is_a1_not_a() -> None:
    a = np.abs(Z1 - N1 / N2 * Z2)  # of the fictitious pendulum, (6)
    rebuilt = np.exp(1j * np.angle(Z1))
    assert worst(np.abs(Z1) * rebuilt - Z1) < ROUNDING
    assert worst(a * rebuilt - Z1) > VISIBLE


def test_11_the_derivative_is_divided_by_n1() -> None:
    (theta, theta_speed), (phase, phase_speed) = free_polar()
    for n, holds in ((N1, True), (N2, False)):
        right = -theta_speed / n * np.cos(phase) + phase_speed / n * theta * np.sin(phase) - PSI[0].speed / n
        assert (worst(-THETA[0].speed / N1 - right) < ROUNDING) == holds


def free_polar() -> tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """Theta1, Theta1' and Phi1, Phi1' of free and near-resonant harmonic together, as one analytic signal."""
    near = -(N1**2) * ALPHA / (N1**2 - M**2)
    signal = 0.012 * np.exp(1j * (N1 * TIME + 0.4)) + near * np.exp(1j * (M * TIME + DELTA))
    change = 0.012j * N1 * np.exp(1j * (N1 * TIME + 0.4)) + 1j * M * near * np.exp(1j * (M * TIME + DELTA))
    size = np.abs(signal)
    return (size, (change / signal).real * size), (np.angle(signal), (change / signal).imag)


def test_12_the_first_is_the_elongation() -> None:
    a1, phi1 = np.abs(Z1), np.angle(Z1)
    assert worst(a1 * np.cos(phi1) - THETA[0].value) < ROUNDING
    assert worst(a1 * np.cos(phi1) - THETA[0].speed) > VISIBLE
    assert worst(a1 * N1 * np.sin(phi1) + THETA[0].speed) < 10 * ROUNDING


def without_resonance() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """a, phi, a' and phi' of the fictitious pendulum (6) where (14) neglects nothing: no forcing near resonance."""
    one, one_speed = phasor(FREE[0] + PSI[0], N1)
    two, two_speed = phasor(FREE[1] + PSI[1], N2)
    z, speed = one - N1 / N2 * two, one_speed - N1 / N2 * two_speed
    return np.abs(z), np.angle(z), (speed / z).real * np.abs(z), (speed / z).imag


def test_14_the_leak_is_of_the_slow_speed() -> None:
    a, phi, _, phase_speed = without_resonance()
    lead = N1 * TIME + 0.4 - phi
    assert worst(leaking(N1, N2, 0.012, a, lead, phi, PSI[0].value, PSI[0].speed) - phase_speed) < 1e-11
    omega_speed = np.zeros_like(TIME)  # as printed: the rate of change of a frequency, which is constant
    assert worst(leaking(N1, N2, 0.012, a, lead, phi, PSI[0].value, omega_speed) - phase_speed) > VISIBLE


def test_14_the_second_line_divides_by_n1_not_by_its_derivative() -> None:
    _, phi, growth, _ = without_resonance()
    free = 0.012 * np.sin(N1 * TIME + 0.4 - phi) - PSI[0].value * np.sin(phi)
    assert worst(-(N1 - N2) * (free - PSI[0].speed / N1 * np.cos(phi)) - growth) < ROUNDING
    n_speed = 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        assert not np.isfinite(-(N1 - N2) * (free - np.divide(PSI[0].speed, n_speed) * np.cos(phi))).any()


def test_after_14_the_leaking_terms_have_n1() -> None:
    a, phi, _, phase_speed = without_resonance()
    clean = formulas.phase_speed(N1, N2, 0.012, a, N1 * TIME + 0.4 - phi)
    leak = phase_speed - clean
    for n, holds in ((N1, True), (N2, False)):
        said = (N1 - N2) * (PSI[0].value / a * np.cos(phi) - PSI[0].speed / (a * n) * np.sin(phi))
        assert (worst(said - leak) < 1e-11) == holds


def test_15_defines_the_slow_motion_by_the_slow_acceleration() -> None:
    for n, psi, theta in zip((N1, N2), PSI, THETA, strict=True):
        assert worst(psi.acceleration + n**2 * psi.value + n**2 * SLOW_U) < ROUNDING
        assert worst(theta.acceleration + n**2 * theta.value + n**2 * SLOW_U) > VISIBLE  # theta for psi
        displacement = -SLOW_U / SLOW_M**2  # x~ without its dots
        assert worst(psi.acceleration + n**2 * psi.value + n**2 * displacement) > VISIBLE


def test_19_has_minus_i() -> None:
    for sign, holds in ((-1.0, True), (1.0, False)):
        z, speed = phasor(HARMONIC[0], N1, sign)
        assert (worst(speed - 1j * N1 * (z + XI)) < ROUNDING) == holds  # (23)


def test_before_23_the_harmonics_are_replaced_not_the_slow_motion() -> None:
    assert worst(V2_SPEED - 1j * N2 * (V2 + XI)) < ROUNDING
    z, speed = phasor(PSI[1], N2)
    assert worst(speed - 1j * N2 * (z + XI)) > VISIBLE


def test_24_follows_from_20_as_there_is_no_21() -> None:
    difference, speed = V1 - V2, V1_SPEED - V2_SPEED
    eliminated = 1j * N2 * difference + 1j * (N1 - N2) * (V1 + XI)  # z2 = z1 - z put in
    assert worst(speed - eliminated) < ROUNDING


def test_25_has_the_form_of_9_not_of_16() -> None:
    one, one_speed = phasor(FREE[0], N1)
    two, two_speed = phasor(FREE[1], N2)
    for z, speed in ((one - two, one_speed - two_speed), (one - N1 / N2 * two, one_speed - N1 / N2 * two_speed)):
        said = formulas.phase_speed(N1, N2, np.abs(one), np.abs(z), np.angle(one / z))  # the same function serves both
        assert worst(said - (speed / z).imag) < 1e-11
    assert worst(FREE[0].value + PSI[0].value - (speed / z).imag) > VISIBLE  # (16) is no phase speed


def test_26_has_the_raw_phase_on_the_left() -> None:
    (theta, theta_speed), (phase, phase_speed) = free_polar()
    phi = np.angle(V1 - V2)
    cosine_part, sine_part = raw_components(N1, theta, phase - phi, phi, phase, phase_speed, theta_speed / theta)
    raw = np.angle(V1)
    assert worst(np.abs(V1) * np.cos(raw - phi) - cosine_part) < ROUNDING
    assert worst(np.abs(V1) * np.sin(raw - phi) - sine_part) < ROUNDING
    assert worst(np.abs(V1) * np.cos(phase - phi) - cosine_part) > 1e-6  # Phi1: departs by (Phi1' - n1)/n1 of 0.012
    assert worst(np.abs(V1) * np.sin(phase - phi) - sine_part) > 1e-6


def test_29_is_of_the_first_pendulum_and_of_alpha() -> None:
    one, two = HARMONIC
    drive = N1**2 * np.cos(M * TIME + DELTA)
    a = np.abs(V1 - V2)
    assert worst(one.acceleration + N1**2 * one.value + drive * ALPHA) < ROUNDING
    assert worst(two.acceleration + N1**2 * two.value + drive * ALPHA) > VISIBLE
    assert worst(one.acceleration + N1**2 * one.value + drive * a) > VISIBLE


def integrated_beat(nu: float, alpha: float) -> tuple[np.ndarray, np.ndarray]:
    """(29) by Runge-Kutta from theta01 cos, phi01."""
    m = N1 - 2.0 * nu
    start = near_resonant_motion(np.array([0.0, 1e-4, -1e-4]), N1, nu, alpha, DELTA, 0.010, 0.4)
    found = solve_ivp(
        lambda t, y: [y[1], -(N1**2) * (y[0] + alpha * np.cos(m * t + DELTA))],
        (0.0, 120.0),
        [start[0], (start[1] - start[2]) / 2e-4],
        "DOP853",
        np.linspace(0.0, 120.0, 2001),
        rtol=1e-12,
        atol=1e-14,
    )
    return found.t, found.y[0]


@pytest.mark.parametrize("nu", [NU, -NU, 1e-9, 0.0])
def test_30_and_31_with_a_minus(nu: float) -> None:
    time, theta = integrated_beat(nu, ALPHA)
    # the start's speed by differences of 1e-4 s is good to 1e-9 of the amplitude
    assert worst(theta - near_resonant_motion(time, N1, nu, ALPHA, DELTA, 0.010, 0.4)) < 1e-9
    assert worst(theta - near_resonant_motion(time, N1, nu, -ALPHA, DELTA, 0.010, 0.4)) > VISIBLE  # beta as printed
    if abs(nu) > 1e-6:
        beta = near_resonant_amplitude(N1, nu, ALPHA)
        written = 0.010 * np.cos(N1 * time + 0.4) + beta * np.sin(nu * time) * np.sin((N1 - nu) * time + DELTA)
        assert worst(theta - written) < 1e-9
        assert beta * nu < 0.0


def beat_speed(beta: float) -> np.ndarray:
    """Phase speed of the sum (30), from its analytic signal and that signal's exact derivative."""
    free = 0.010 * np.exp(1j * (N1 * TIME + 0.4))
    carrier = np.exp(1j * ((N1 - NU) * TIME + DELTA))
    wave, wave_speed = beta * np.sin(NU * TIME), beta * NU * np.cos(NU * TIME)
    signal = free - 1j * wave * carrier
    change = 1j * N1 * free - 1j * (wave_speed + 1j * (N1 - NU) * wave) * carrier
    return (change / signal).imag


MISPRINTS_OF_39 = {
    "sin(phi01 - delta) for cos": lambda t, b: (0.4 - DELTA, np.sin, b, lambda w: np.sin(w + 0.4 - DELTA), None),
    "alpha for beta in a^2": lambda t, b: (0.4 - DELTA, np.cos, ALPHA, lambda w: np.sin(w + 0.4 - DELTA), None),
    "cos(nu t - phi0 + delta) for sin": lambda t, b: (0.4 - DELTA, np.cos, b, lambda w: np.cos(w - 0.4 + DELTA), None),
    "a_2 for a^2": lambda t, b: (0.4 - DELTA, np.cos, b, lambda w: np.sin(w + 0.4 - DELTA), b * np.sin(NU * t)),
}


def written_39(offset: float, outer: object, inner: float, wave: object, denominator: object) -> np.ndarray:
    beta = near_resonant_amplitude(N1, NU, ALPHA)
    sine = np.sin(NU * TIME)
    square = 0.010**2 + beta * sine * (inner * sine - 2.0 * 0.010 * wave(NU * TIME))  # type: ignore[operator]
    below = square if denominator is None else denominator
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(N1 + NU * ((0.010**2 - 0.010 * beta * outer(offset)) / below - 1.0))  # type: ignore[operator]


def test_39_corrected_is_the_phase_speed_of_the_sum() -> None:
    beta = near_resonant_amplitude(N1, NU, ALPHA)
    assert worst(disturbed_speed(TIME, N1, NU, beta, DELTA, 0.010, 0.4) - beat_speed(beta)) < 1e-11
    corrected = written_39(0.4 - DELTA, np.cos, beta, lambda w: np.sin(w + 0.4 - DELTA), None)
    assert worst(corrected - beat_speed(beta)) < 1e-11


@pytest.mark.parametrize("misprint", MISPRINTS_OF_39)
def test_39_fails_with_each_misprint_alone(misprint: str) -> None:
    beta = near_resonant_amplitude(N1, NU, ALPHA)
    departure = written_39(*MISPRINTS_OF_39[misprint](TIME, beta)) - beat_speed(beta)
    assert not worst(departure) < 1e-3  # rad/s, of nu = 0.026; infinite where a_2 passes through zero


def test_32_turns_the_sine_into_a_cosine_for_36() -> None:
    """(36) with the harmonic of (32) as the second one gives (39): the way the paper derives it."""
    beta = near_resonant_amplitude(N1, NU, ALPHA)
    wave = beta * np.sin(NU * TIME)
    lead = NU * TIME + 0.4 - DELTA - 0.5 * np.pi
    by_36 = speed_of_difference((0.010, wave), lead, (N1, N1 - NU), (0.0, beta * NU * np.cos(NU * TIME)))
    assert worst(by_36 - beat_speed(beta)) < 1e-11


def test_the_text_nu_is_0_026_not_0_03() -> None:
    """A beat of two minutes: |sin(nu t)| returns after 120 s."""
    returns = np.pi / np.array([0.02618, 0.03])
    assert returns[0] == pytest.approx(120.0, rel=1e-4)
    assert abs(returns[1] - 120.0) > 10.0


def test_the_text_half_period_disturbed_by_21250e_7() -> None:
    """`more than 20 000e-7 s`: T/2 times nu/n, T = 1.01 s; and seen as a phase speed of (39)."""
    n = 2.0 * np.pi / 1.01
    assert 0.505 * NU / n == pytest.approx(21250e-7, rel=2e-4)
    from_rest = disturbed_speed(np.linspace(1.0, 119.0, 50), n, NU, 0.01, DELTA, 0.0, 0.0)
    assert np.pi / from_rest - 0.505 == pytest.approx(21250e-7 * n / (n - NU), rel=2e-4)


@pytest.mark.parametrize(("period", "millimetres"), [(10.0, 2e-5), (2.0, 7e-4)])
def test_the_text_slow_difference_on_the_film(period: float, millimetres: float) -> None:
    """psi of 10 cm, T1 - T2 = 1e-5 s; the paper's own bound of a few thousandths is far above the true maximum."""
    n = 2.0 * np.pi / np.array([1.01 + 1e-5, 1.01])
    transfer = n**2 / (n**2 - (2.0 * np.pi / period) ** 2)
    largest = 100.0 * abs(transfer[0] / transfer[1] - 1.0)
    assert largest == pytest.approx(millimetres, rel=0.05)  # printed to one figure
    assert largest < 3e-3
