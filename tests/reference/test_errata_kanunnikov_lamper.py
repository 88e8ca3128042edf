"""Kanunnikov and Lamper: each misprint fails as printed and holds as corrected, by motion, energy or algebra."""

from __future__ import annotations

import math

import numpy as np
import pytest

from synth.huygens.balance import residuals, solutions
from synth.huygens.clocks import Clocks
from synth.huygens.orbit import orbit, start_of
from synth.huygens.paper import COUPLING, DAMPING, corrected, printed
from synth.systems.dispatch import plain_jacobian
from synth.systems.reduced_beam import ReducedBeam
from synth.systems.reduced_beam import _derivative as _reduced
from synth.systems.resistance import VanDerPolDrive
from synth.systems.yielding import ElasticBeam, _derivative
from tests.synth.energies import energy_yielding as _energy

M, MASS, LENGTH, STIFFNESS, G = 2.0, np.array([1.0, 0.7]), np.array([1.0, 0.9]), 150.0, 9.81
BEAM = ElasticBeam(M, MASS, LENGTH, STIFFNESS, 0.0, G)
STATE = np.array([0.05, 0.3, 1.0, 0.4, -0.5, -0.9])


def slope_of(energy, state: np.ndarray) -> float:
    """Rate of an energy along the motion of `BEAM`, by central differences."""
    rate = np.empty(6)
    python = getattr(_derivative, "py_func", _derivative)
    python(0.0, state, BEAM, rate)
    return (energy(state + 1e-6 * rate) - energy(state - 1e-6 * rate)) / 2e-6


def energy(state: np.ndarray, sine_of_product: bool = False, beam_square: float = STIFFNESS / M) -> float:
    """T + Pi as in section 1 of the paper; `beam_square` is the square of the frequency in Pi."""
    x, speed = state[:2]
    angles, rates = state[2::2], state[3::2]
    mixed = np.sin(angles * speed * rates) if sine_of_product else np.sin(angles) * speed * rates
    kinetic = 0.5 * M * speed**2 + 0.5 * np.sum(MASS * (speed**2 - 2.0 * LENGTH * mixed + (LENGTH * rates) ** 2))
    return float(kinetic + 0.5 * M * beam_square * x**2 - G * np.sum(MASS * LENGTH * np.cos(angles)))


def test_kinetic_energy_has_the_sine_of_the_angle_alone() -> None:
    assert abs(slope_of(energy, STATE)) < 1e-7
    assert abs(slope_of(lambda each: energy(each, sine_of_product=True), STATE)) > 1e-2
    python = getattr(_energy, "py_func", _energy)
    assert energy(STATE) == pytest.approx(python(STATE, BEAM), rel=1e-14)


def test_potential_energy_has_the_frequency_without_pendulums() -> None:
    """w_0 is that with them, w_0^2 = M w_b^2/(M + sum m): with it in Pi nothing is kept."""
    loaded = STIFFNESS / (M + MASS.sum())
    assert abs(slope_of(lambda each: energy(each, beam_square=loaded), STATE)) > 1e-2


def test_delta_is_2_eps_over_w_without_a_length() -> None:
    """Scaled to other units of length, the motion is the same; `2 eps S0^2/(w l)` is not."""
    rates = []
    for scale in (1.0, 100.0):  # metres, centimetres
        drive = VanDerPolDrive(np.full(2, 0.06), np.full(2, 0.1))
        system = ElasticBeam(M, MASS, LENGTH * scale, STIFFNESS, 0.0, G * scale, drive)
        out, state = np.empty(6), STATE * np.array([scale, scale, 1.0, 1.0, 1.0, 1.0])
        getattr(_derivative, "py_func", _derivative)(0.0, state, system, out)
        rates.append(
            (out[2:], 2.0 * 0.06 / 12.6, 2.0 * 0.06 * (0.1 * LENGTH[0] * scale) ** 2 / (12.6 * LENGTH[0] * scale))
        )
    assert rates[0][0] == pytest.approx(rates[1][0], rel=1e-12)
    assert rates[0][1] == rates[1][1]
    assert rates[1][2] == pytest.approx(100.0 * rates[0][2])


def second_harmonic(nu_over_mu: float, mu: float = 1e-3) -> float:
    """What (8) with a factor nu leaves of the beam's own equation in (2), relative, by a Fourier sum."""
    z = np.arange(256) * 2.0 * math.pi / 256
    alpha, size, beta, damping = -0.6, 2.0, 0.3, 0.05
    # beam's equation at given clocks: u'' + 2 delta0 u' + 4 (1 + beta) u = mu sum (y^2)''
    forcing = 2.0 * mu * (-2.0 * size**2 * np.cos(2.0 * (z - alpha)))
    response = np.mean(forcing * np.exp(-2j * z)) / (
        -4.0 + 4j * damping + 4.0 * (1.0 + beta)
    )  # u = 2 Re(response e^{2iz})
    q = -4.0 * response
    nu = nu_over_mu * mu
    asked = -1j * (nu / 8.0) * 2.0 * size**2 * np.exp(-2j * alpha) / complex(damping, -beta)
    return float(abs(asked / q - 1.0))


def test_nu_of_3_and_8_is_8_mu_over_l() -> None:
    assert second_harmonic(8.0) < 1e-12
    assert second_harmonic(32.0) == pytest.approx(3.0)


def test_the_factor_of_3_is_mu_over_2l() -> None:
    """(3) divides the beam's equation by -2 q's share: mu sum (y^2)'' for x/l = -(q/2) cos 2z becomes mu/2 of it."""
    z = np.arange(64) * 2.0 * math.pi / 64
    q, beta, delta0 = 0.003, 0.01, 0.02
    u = -0.5 * q * np.cos(2.0 * z)
    left = 2.0 * q * np.cos(2.0 * z) + 2.0 * delta0 * q * np.sin(2.0 * z) + 4.0 * (1.0 + beta) * u
    assert 0.5 * left == pytest.approx(-beta * q * np.cos(2.0 * z) + delta0 * q * np.sin(2.0 * z), abs=1e-15)


def test_4_has_the_rate_of_the_same_clock() -> None:
    """y' without an index could only be one clock's: in (2) each is driven by its own rate alone."""
    system = ReducedBeam(0.02, 0.02, 0.0, np.zeros(2))  # no coupling: only the drive is left
    matrix = plain_jacobian(0.0, np.array([0.0, 0.0, 0.5, 0.1, 0.2, -0.3]), system)
    assert matrix[3, 3] == pytest.approx(0.02 * (1.0 - 0.25))
    assert matrix[5, 5] == pytest.approx(0.02 * (1.0 - 0.04))
    assert matrix[3, 5] == matrix[5, 3] == 0.0


def test_the_expansion_of_the_frequencies_has_an_eighth() -> None:
    """So chi = 2 (1 + tau) n T/day, twice the printed one, and the largest for n = 1 is 2.3e-5."""
    tau, chi = -0.03, 1e-4
    apart = [0.5 * math.sqrt(1.0 + tau + sign * chi / 2.0) - 0.5 * math.sqrt(1.0 + tau) for sign in (1.0, -1.0)]
    for sign, each in zip((1.0, -1.0), apart, strict=True):
        assert each == pytest.approx(sign * chi / (8.0 * math.sqrt(1.0 + tau)), rel=1e-4)
        assert each != pytest.approx(sign * chi / (4.0 * math.sqrt(1.0 + tau)), rel=0.1)


def test_eta_for_one_swing_a_day_is_twice_the_printed() -> None:
    """0.0041 to 0.0345 with the chain's own tau, where the paper has 0.002 to 0.018."""
    chain = printed(np.array([-0.25 * math.pi, -0.175]))
    eta = chain.slope * 2.0 * (1.0 + chain.tau) / 86400.0
    assert eta == pytest.approx([0.00405, 0.0345], rel=2e-3)
    assert eta / 2.0 == pytest.approx([0.002, 0.018], rel=0.05)


def test_k_reaches_1600_at_01733() -> None:
    assert float(printed(-0.175).slope) == pytest.approx(1569.9, abs=0.05)
    assert float(printed(-0.1733).slope) == pytest.approx(1600.0, abs=1.0)


def test_the_shifts_left_out_are_larger_than_what_was_kept_of_q() -> None:
    """delta^2/8 against q^2/8 at delta = 0.05; and a lone clock's frequency really falls by it."""
    drive = 0.05
    assert drive > float(printed(-0.25 * math.pi).q)
    pair = Clocks(DAMPING, drive, COUPLING, (0.01, 0.01))
    plain, shifted = (min(solutions(pair, shifts=each), key=lambda one: one.q).beta for each in (False, True))
    assert shifted - plain == pytest.approx(drive**2 / 8.0, rel=0.03)
    state, turn = start_of(solutions(pair, shifts=True)[0])[2:4], 0.0
    step, system = 0.02, ReducedBeam(1.0, drive, 0.0, np.array([0.01, 0.01]))
    python, out = getattr(_reduced, "py_func", _reduced), np.empty(6)

    def rate(y: np.ndarray) -> np.ndarray:
        python(0.0, np.array([0.0, 0.0, *y, 0.0, 0.0]), system, out)
        return out[2:4].copy()

    times = []
    for _ in range(8000):  # Runge-Kutta of order 4, from crossing to crossing
        k1 = rate(state)
        k2 = rate(state + 0.5 * step * k1)
        k3 = rate(state + 0.5 * step * k2)
        after = state + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + rate(state + step * k3))
        if state[0] < 0.0 <= after[0]:
            times.append(turn - step * state[0] / (after[0] - state[0]))
        state, turn = after, turn + step
    frequency = 2.0 * math.pi * (len(times) - 1) / (times[-1] - times[0])
    assert frequency**2 == pytest.approx(1.01 - drive**2 / 8.0, abs=6e-5)
    assert frequency**2 != pytest.approx(1.01, abs=2e-4)


def test_k_needs_its_second_term() -> None:
    """1/(2 delta) of k, which the paper omits, is 25 of 200 at delta = 0.02; by the six equations themselves."""
    clocks = Clocks(DAMPING, 0.02, COUPLING, (0.02**2 / 8.0, 0.02**2 / 8.0))
    ends = []
    for chi in (1e-6, -1e-6):
        found = [each for each in solutions(clocks.detuned(chi), shifts=True) if abs(each.offset) < 0.1]
        assert np.abs(residuals(found[0], clocks.detuned(chi), shifts=True)).max() < 1e-12
        ends.append(found[0].offset)
    slope = (ends[0] - ends[1]) / 2e-6
    assert slope == pytest.approx(float(corrected(-0.25 * math.pi, 0.02).slope), rel=1e-4)
    assert slope - float(printed(-0.25 * math.pi).slope) == pytest.approx(25.0, rel=1e-3)


@pytest.mark.compiled
def test_alpha_is_shifted_by_delta_over_8() -> None:
    """The true orbit's alpha stands delta/8 above the chain's: van der Pol's third harmonic, which the paper omits."""
    drive = 0.04
    chain = corrected(-0.6, drive)
    stretch = math.sqrt(1.0 + float(chain.beta))
    clocks = Clocks(DAMPING / stretch, drive / stretch, COUPLING, (float(chain.tau),) * 2)
    regime = min(solutions(clocks, shifts=True), key=lambda each: abs(each.alpha[0] + 0.6) + abs(each.offset))
    assert orbit(regime, clocks).regime.alpha[0] + 0.6 == pytest.approx(drive / 8.0, rel=0.02)
