"""Laws that every system of equations obeys, and the printed equations as an independent implementation."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from energies import SineFromTop, energy
from pantaleone_board import pantaleone
from system_examples import DRIVE, FREQUENCY, LENGTH, MASS, QUADRATIC, SIDEWAYS, SYSTEMS, UPWARDS, mirrored, state_for

from synth.kernels.compiled import kernel, making_kernel
from synth.phase import Floats
from synth.systems.dispatch import derivative, jacobian, plain_jacobian, response
from synth.systems.driven_pendulums import DrivenPendulums
from synth.systems.reduced_beam import ReducedBeam
from synth.systems.resistance import VanDerPol
from synth.systems.yielding import ElasticBeam, FlexibleFrame, Metronomes, stiffness_of_ratio

EVERY = pytest.mark.parametrize("system", SYSTEMS.values(), ids=list(SYSTEMS))


@kernel
def _slope(time: float, state: Floats, system: Any, out: Floats) -> None:
    derivative(time, state, system, out)


@making_kernel
def _matrix(time: float, state: Floats, system: Any, out: Floats) -> None:
    jacobian(time, state, system, out, np.empty(state.size), np.empty(state.size))


@kernel
def _joules(state: Floats, system: Any) -> float:
    return energy(state, system)


@kernel
def _pushed(state: Floats, index: int, system: Any, out: Floats) -> None:
    response(state, index, system, out)


def slope(system: Any, state: Floats, time: float = 0.7) -> Floats:
    out = np.full(state.size, np.nan)
    _slope(time, state, system, out)
    return out


def matrix(system: Any, state: Floats, time: float = 0.7) -> Floats:
    out = np.full((state.size, state.size), np.nan)
    _matrix(time, state, system, out)
    return out


def numerical(function: Any, state: Floats) -> Floats:
    """Derivative by every component: central differences of three steps, error h^6."""
    columns = []
    for i in range(state.size):
        step = np.zeros(state.size)
        step[i] = 2e-3
        each = [(function(state + k * step) - function(state - k * step)) / (2 * k * 2e-3) for k in (1, 2, 3)]
        columns.append(1.5 * each[0] - 0.6 * each[1] + 0.1 * each[2])
    return np.array(columns).T


@EVERY
def test_jacobian_is_the_derivative_of_the_derivative(system: Any) -> None:
    state = state_for(system)
    expected, before = numerical(lambda where: slope(system, where), state), state.copy()
    # 3e-8 of the second derivatives, which are up to ten times the first
    np.testing.assert_allclose(matrix(system, state), expected, atol=3e-7 * np.abs(expected).max())
    np.testing.assert_array_equal(state, before)
    np.testing.assert_allclose(plain_jacobian(0.7, state, system), expected, atol=3e-7 * np.abs(expected).max())


def test_jacobian_of_the_stiff_reference_problem() -> None:
    system, state = VanDerPol(7.0), np.array([0.6, -1.3])
    exact = [[0.0, 1.0], [-14.0 * 0.6 * -1.3 - 1.0, 7.0 * (1.0 - 0.36)]]
    np.testing.assert_allclose(matrix(system, state), exact, rtol=0.0, atol=1e-6)  # 3e-8 of 14 x 1.3
    assert slope(system, state) == pytest.approx([-1.3, 7.0 * (1.0 - 0.36) * -1.3 - 0.6])


@EVERY
def test_mirror_image_moves_as_the_mirror_image_bitwise(system: Any) -> None:
    state = state_for(system)
    image, reflected = mirrored(system, state)
    np.testing.assert_array_equal(slope(image, reflected), mirrored(system, slope(system, state))[1])


@pytest.mark.parametrize("name", ["beam", "driven beam", "reduced beam"])
def test_mirror_of_one_clock_alone_bitwise(name: str) -> None:
    system, state = SYSTEMS[name], state_for(SYSTEMS[name])
    sign = np.array([1, 1, -1, -1, 1, 1, 1, 1.0])
    np.testing.assert_array_equal(slope(system, sign * state), sign * slope(system, state))


CONSERVATIVE: dict[str, Any] = {
    "pendulums": SYSTEMS["pendulums"],
    "from the top": DrivenPendulums(FREQUENCY, restoring=SineFromTop()),
    "linear": SYSTEMS["linear, still"],
    "beam": SYSTEMS["beam"],
    "reduced beam": SYSTEMS["reduced beam"]._replace(beam_damping=0.0, drive=0.0),
    "frame": SYSTEMS["frame"],
    "metronomes": SYSTEMS["metronomes"],
}


@pytest.mark.parametrize("system", CONSERVATIVE.values(), ids=list(CONSERVATIVE))
def test_energy_is_stationary_along_the_motion(system: Any) -> None:
    state = state_for(system)
    gradient = numerical(lambda where: np.array([_joules(where, system)]), state)[0]
    power = gradient * slope(system, state)
    assert abs(power.sum()) < 1e-9 * np.abs(power).max()  # error of the gradient: h^4


@pytest.mark.parametrize("name", ["pendulums", "beam", "frame", "metronomes"])
def test_response_is_the_inverse_mass_matrix(name: str) -> None:
    """An impulse changes the kinetic energy by J x mean rate: the law that makes a kick's energy exact."""
    system, state = SYSTEMS[name], state_for(SYSTEMS[name])
    out = np.empty(state.size)
    for index in range(3):
        _pushed(state, index, system, out)
        rate = system.first_angle + 2 * index + 1
        push = 0.37
        gained = _joules(state + push * out, system) - _joules(state, system)
        assert gained == pytest.approx(push * (state[rate] + 0.5 * push * out[rate]), rel=1e-11)  # rounding
        assert np.all(out[0 : rate - 1 : 2] == 0.0)  # no position jumps


def _solved(mass: Floats, force: Floats) -> Floats:
    return np.linalg.solve(mass, force)


def test_beam_solves_the_printed_equations_1() -> None:
    system = SYSTEMS["driven beam"]
    state = state_for(system)
    x, v = state[:2]
    angle, rate = state[2::2], state[3::2]
    share = angle / DRIVE.angle
    torque = DRIVE.rate * (1 - share**2) * rate - QUADRATIC.coefficient * np.abs(rate) * rate
    whole = 2.0 + MASS.sum()
    mass = np.zeros((4, 4))
    mass[0, 0] = whole
    mass[0, 1:] = -MASS * LENGTH * np.sin(angle)
    mass[1:, 0] = -np.sin(angle)
    mass[1:, 1:] = np.diag(LENGTH)
    force = np.empty(4)
    force[0] = (MASS * LENGTH * np.cos(angle) * rate**2).sum() - 150.0 * x - whole * 0.25 * v
    force[1:] = -9.81 * np.sin(angle) + LENGTH * torque
    np.testing.assert_allclose(slope(system, state)[1::2], _solved(mass, force), rtol=1e-13)  # condition 10


def test_reduced_beam_solves_the_printed_equations_2() -> None:
    system = SYSTEMS["reduced beam"]
    state = state_for(system)
    y, rate = state[2::2], state[3::2]
    mass = np.eye(4)
    mass[0, 1:] = -2 * system.coupling * y
    mass[1:, 0] = -y
    force = np.empty(4)
    force[0] = 2 * system.coupling * (rate**2).sum() - 2 * system.beam_damping * state[1] - 4 * state[0]
    force[1:] = system.drive * (1 - y**2) * rate - (1 + system.detuning) * y
    np.testing.assert_allclose(slope(system, state)[1::2], _solved(mass, force), rtol=1e-13)


def test_frame_solves_the_printed_equations() -> None:
    system = FlexibleFrame(2.0, MASS, LENGTH, 150.0, 0.7, 9.81)
    state = state_for(system)
    angle, rate = state[2::2], state[3::2]
    mass = np.zeros((4, 4))
    mass[0, 0] = 2.0 + MASS.sum()
    mass[0, 1:] = MASS * LENGTH * np.cos(angle)
    mass[1:, 0] = np.cos(angle) / LENGTH
    mass[1:, 1:] = np.eye(3)
    force = np.empty(4)
    force[0] = (MASS * LENGTH * np.sin(angle) * rate**2).sum() - 150.0 * state[0] - 0.7 * state[1]
    force[1:] = -9.81 / LENGTH * np.sin(angle)
    np.testing.assert_allclose(slope(system, state)[1::2], _solved(mass, force), rtol=1e-13)


def test_metronomes_solve_the_printed_equations() -> None:
    detuning, drive, drive_angle, coupling = np.array([0.01, -0.01, 0.0]), 0.01, 0.39, 0.05
    system = pantaleone(detuning, drive, drive_angle, coupling)
    state = state_for(system)
    angle, rate = state[0::2], state[1::2]
    cosine = np.cos(angle)
    mass = np.eye(3) - coupling * np.outer(cosine, cosine)
    force = -(1 + detuning) * np.sin(angle) - drive * ((angle / drive_angle) ** 2 - 1) * rate
    force -= coupling * cosine * (np.sin(angle) * rate**2).sum()
    np.testing.assert_allclose(slope(system, state)[1::2], _solved(mass, force), rtol=1e-13)


def test_metronomes_are_a_frame_without_spring() -> None:
    """Pantaleone's board is the flexible frame with K = B = 0; on a ship, sideways motion leaves both behind."""
    system = Metronomes(np.full(2, math.sqrt(9.81 / 0.25)), 0.2 / 2.4, None, 9.81, UPWARDS)
    frame = FlexibleFrame(2.0, np.full(2, 0.2), np.full(2, 0.25), 0.0, 0.0, 9.81, None, SIDEWAYS, UPWARDS)
    state = np.array([0.5, 0.3, -0.2, 0.9])
    swing = np.concatenate([[0.0, 0.0], state])
    np.testing.assert_allclose(slope(system, state)[1::2], slope(frame, swing)[3::2], rtol=1e-12)


def test_singular_mass_matrix_gives_nan_and_a_name() -> None:
    system = ReducedBeam(0.02, 0.1, 0.125, np.zeros(2))  # 2 m0 sum y^2 = 1 at y = (2, 0)
    assert np.isnan(slope(system, np.array([0, 0, 2.0, 0, 0, 0]))[1])
    assert np.isnan(slope(system, np.array([0, 0, 2.5, 0, 0, 0]))[1])
    assert "singular" in str(system.difficulty(np.array([0, 0, 2.0, 0, 0, 0])))
    assert system.difficulty(np.array([0, 0, 1.0, 0, 0, 0])) is None
    weightless = Metronomes(np.ones(2), 0.6)
    assert np.isnan(slope(weightless, np.zeros(4))[1])
    assert "weigh nothing" in str(weightless.difficulty(np.zeros(4)))
    assert weightless._replace(coupling=0.1).difficulty(np.zeros(4)) is None


def test_full_beam_stands_where_the_reduced_one_breaks() -> None:
    heavy = ElasticBeam(1e-3, np.ones(1), np.ones(1), 150.0, 0.0, 9.81)
    assert np.isfinite(slope(heavy, np.array([0.0, 0.1, math.pi / 2, 3.0]))).all()
    ratio = heavy._replace(stiffness=stiffness_of_ratio(7.0, heavy))
    assert math.sqrt(ratio.stiffness / 1.001) == pytest.approx(7.0 * math.sqrt(9.81), rel=1e-14)
