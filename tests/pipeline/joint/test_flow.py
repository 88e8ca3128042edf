"""One step of the lattice: against an integrator of the equations as they are printed, and against its own laws."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.interpolate import CubicSpline

from pipeline.joint import filtering, kinds, remainder
from pipeline.joint.constants import Constant, starts
from pipeline.joint.flow import NODES, flow
from pipeline.joint.lattice import Lattice, lay
from pipeline.joint.problem import Assumed, Problem
from pipeline.joint.ship import Component, Engine, Sea, Ship, Vibration, density

KAPPA, DAMPING = np.array([38.7, 38.69]), np.array([1e-3, 2e-3])
PAIR = (tuple(KAPPA), tuple(DAMPING), *[(0.0, 0.0)] * 3)  # without kicks and friction
SHIP: tuple[Component, ...] = (Sea(0.7, 0.1, 0.02), Vibration(6.0, 1e-3), Sea(0.9, 0.1, 0.03, "vertical"))


GRAVITY = 0.999


def begun(pendulums: int, values: np.ndarray) -> tuple[Constant, ...]:
    """A start that is known."""
    free = starts(pendulums, np.sqrt(KAPPA), values)
    return tuple(replace(each, prior=1e-15, mean=each.value) for each in free)


def heave(time: np.ndarray) -> np.ndarray:
    return 0.02 * np.cos(0.8 * np.asarray(time) + 0.3)


def recording(lattice: Lattice) -> CubicSpline:
    time = np.arange(-1.0, lattice.duration + 1.0, 0.01)
    return CubicSpline(time, heave(lattice.start + time))


@pytest.mark.parametrize("sine", [False, True])
@pytest.mark.parametrize("step", [0.04, 0.1])
@pytest.mark.parametrize("rough", [0.0, 3e-3])
def test_steps_follow_the_printed_equations(sine: bool, step: float, rough: float) -> None:
    time = step * np.arange(60)
    lattice = lay(time, np.zeros((1, 60)), np.array([[1.0, 0.0]]), 6.2)
    nodes = lattice.start + lattice.step * np.arange(lattice.nodes)
    problem = Problem(lattice, KAPPA, DAMPING, heave=recording(lattice))
    begin = np.array([0.05, 0.2, -0.04, 0.1])
    constants = (
        *begun(2, begin),
        Constant("gravity", kinds.GRAVITY, 1e-9, mean=GRAVITY, value=GRAVITY),
        Constant("quadratic", kinds.QUADRATIC, 1e-9, mean=rough, value=rough),
    )
    # readings that say nothing: what is left is the prediction, the ship at rest
    deaf = Assumed((Vibration(6.0, 1e-12),), np.zeros(2), np.full(3, 1e9), sine)
    _, _, path = problem.fit(deaf, constants)

    def slope(t: float, state: np.ndarray) -> np.ndarray:
        out = np.empty(4)
        for i in range(2):
            angle, speed = state[2 * i : 2 * i + 2]
            back = (GRAVITY + heave(t)) * np.sin(angle) if sine else GRAVITY * angle
            out[2 * i] = speed
            out[2 * i + 1] = -2.0 * DAMPING[i] * speed - rough * abs(speed) * speed - KAPPA[i] * back
        return out

    expected = solve_ivp(slope, nodes[[0, -1]], begin, t_eval=nodes, rtol=1e-12, atol=1e-14, max_step=0.02).y.T
    # |speed| speed has a kink at each turn, of which nodes see 1e-3 of its effect (.015 mGal in a gravity of 50 mrad)
    assert np.abs(path[:, :4] - expected).max() < (5e-6 if rough else 5e-8)


@pytest.mark.parametrize("step", [0.04, 0.1])
def test_a_real_swing_is_exact_without_friction(step: float) -> None:
    time = step * np.arange(200)
    problem = Problem(lay(time, np.zeros((1, 200)), np.array([[1.0]]), 6.2), KAPPA[:1], np.zeros(1))
    begin = np.array([0.3, 0.0])
    constants = (*begun(1, begin), Constant("gravity", kinds.GRAVITY, 1e-9, mean=1.0, value=1.0))
    deaf = Assumed((Vibration(6.0, 1e-12),), np.zeros(1), np.full(3, 1e9), sine=True)
    path = problem.fit(deaf, constants)[2].astype(np.float64)
    energy = 0.5 * path[:, 1] ** 2 - KAPPA[0] * np.cos(path[:, 0])
    # of the energy above rest; it comes back each swing
    assert np.abs(energy[-20:].max() - energy[:20].max()) < 1e-7 * (energy[0] + KAPPA[0])

    def slope(t: float, state: np.ndarray) -> np.ndarray:
        return np.array([state[1], -KAPPA[0] * np.sin(state[0])])

    nodes = problem.lattice.step * np.arange(problem.lattice.nodes)
    expected = solve_ivp(slope, nodes[[0, -1]], begin, t_eval=nodes, rtol=1e-12, atol=1e-14).y[0]
    assert np.abs(path[:, 0] - expected).max() < 1e-6 * begin[0]  # 2e-8 of a swing in its phase after thirty


@pytest.mark.parametrize("component", [Sea(0.7, 0.1, 0.02), Vibration(6.0, 1e-3), Engine(12.0, 0.05, 1e-3)])
def test_stationary_variance_is_the_integral_of_the_spectrum(component: Component) -> None:
    ship = Ship.of((component,))
    row = ship.horizontal
    assert row @ ship.stationary @ row == pytest.approx(component.rms**2, rel=1e-9)
    edges = [0.0, 0.5 * component.peak, component.peak, 2.0 * component.peak, 100.0 * component.peak]
    area = sum(
        quad(lambda w: density((component,), np.array([w]), "horizontal")[0], low, high, limit=400)[0]
        for low, high in itertools.pairwise(edges)
    )
    assert area / np.pi == pytest.approx(component.rms**2, rel=1e-4)


def test_the_sea_vanishes_at_zero_frequency_as_the_fourth_power() -> None:
    low = density((Sea(0.7, 0.1, 0.02),), np.array([1e-3, 2e-3]), "horizontal")
    assert low[1] / low[0] == pytest.approx(16.0, rel=1e-4)


def test_process_noise_keeps_the_stationary_covariance() -> None:
    ship = Ship.of(SHIP)
    step = flow(0.1, SHIP, *PAIR, gravity=1.0, sine=False)
    transition = step.ahead[4:, 4:]
    again = transition @ ship.stationary @ transition.T + step.noise[4:, 4:]
    scale = np.sqrt(np.outer(np.diag(ship.stationary), np.diag(ship.stationary)))
    assert np.abs((again - ship.stationary) / scale).max() < 1e-8


def test_kicks_add_their_variance() -> None:
    quiet = flow(0.05, SHIP, *PAIR, gravity=1.0, sine=False)
    loud = flow(0.05, SHIP, *PAIR[:2], (1e-5, 0.0), *PAIR[3:], gravity=1.0, sine=False)
    # d theta' = n k dW over a short step
    assert (loud.noise - quiet.noise)[1, 1] == pytest.approx(KAPPA[0] * 1e-10 * 0.05, rel=0.05)
    assert np.abs((loud.noise - quiet.noise)[2:]).max() == 0.0


def test_readings_off_the_nodes_are_exact_under_heave() -> None:
    time = 0.04 * np.arange(1500)
    lattice = lay(time, np.zeros((1, time.size)), np.array([[1.0]]), 6.2)
    nodes = lattice.start + lattice.step * np.arange(lattice.nodes)
    assert lattice.nodes == time.size / 5

    def slope(t: float, state: np.ndarray) -> np.ndarray:
        return np.array([state[1], -KAPPA[0] * (1.0 + heave(t)) * np.sin(state[0])])

    done = solve_ivp(slope, (0.0, time[-1]), [0.02, 0.0], dense_output=True, rtol=1e-12, atol=1e-15, max_step=0.02)
    angles = done.sol(time)[0]
    problem = Problem(replace(lattice, value=angles), KAPPA[:1], np.zeros(1), heave=recording(lattice))
    constants = (
        *begun(1, done.sol(lattice.start)),
        Constant("gravity", kinds.GRAVITY, 1e-12, mean=1.0, value=1.0),
    )
    told = Assumed((Vibration(6.0, 1e-12),), np.zeros(1), np.array([1e-6, 1.0, 1.0]), sine=True)
    about = np.zeros((lattice.nodes, 5), dtype=np.float32)
    about[:, :2] = done.sol(nodes).T
    _, of = problem.run(told, constants, about=about)
    assert np.abs(of.whitened[1:]).max() < 0.05  # 5e-8 rad of 2e-2
    assert abs(of.whitened[0]) < 0.3  # before the first node nothing is known of the heave


def test_remainder_within_a_step_follows_the_path_to_its_end() -> None:
    """A ship that vibrates on is assumed to fade: the remainder is that of the motion, not of the assumption."""
    step, turning, size, kappa = 0.04, 18.85, 0.01, KAPPA[:1]

    def slope(t: float, state: np.ndarray) -> np.ndarray:
        pull = np.sin(state[0]) + size * np.sin(turning * t) * np.cos(state[0])
        return np.array([state[1], -kappa[0] * pull])

    done = solve_ivp(slope, (0.0, step), [0.05, 0.1], dense_output=True, rtol=1e-12, atol=1e-15).sol
    one = flow(step, (Vibration(18.0, size),), (kappa[0],), *[(0.0,)] * 4, gravity=1.0, sine=True)
    phases = turning * np.array([0.0, step])
    ship = size * np.stack([np.sin(phases), turning * np.cos(phases), -(turning**2) * np.sin(phases)])
    about = np.ascontiguousarray(np.concatenate([done(np.array([0.0, step])), ship]).T)
    angle, across = done(NODES * step)[0], size * np.sin(turning * NODES * step)
    exact = -kappa[0] * (np.sin(angle) - angle + across * (np.cos(angle) - 1.0))
    steps = remainder.room_for(one, 0, 1)
    filtering.follow(one, about, 0, np.zeros((2, one.ends.shape[1])), steps)
    remainder.collocate(one, False, 1, steps)
    faded = np.abs(steps.rest[0, remainder.LEFT, :, 0] - exact).max()
    remainder.join_ends(one, 1, steps)
    assert np.abs(steps.rest[0, remainder.JOINED, :, 0] - exact).max() < 0.1 * faded


def test_derivatives_by_start_gravity_and_ship_follow_the_variational_equations() -> None:
    ship, kappa = Ship.of((Sea(1.3, 0.3, 0.01), Sea(0.9, 0.2, 0.01, "vertical"))), float(KAPPA[0])
    size = 2 + ship.drift.shape[0]
    time = 0.1 * np.arange(200)
    lattice = lay(time, np.zeros((1, time.size)), np.array([[1.0]]), 6.2)
    nodes = lattice.start + lattice.step * np.arange(lattice.nodes)
    begin = np.concatenate([[0.03, 0.1], 0.01 * np.random.default_rng(3).normal(size=size - 2)])

    def slope(_: float, state: np.ndarray) -> np.ndarray:
        angle, speed, moved = *state[:2], state[2:size]
        across, along = ship.horizontal @ moved, ship.vertical @ moved
        drift = np.zeros((size, size))
        drift[0, 1], drift[2:, 2:] = 1.0, ship.drift
        drift[1, 0] = -kappa * ((1.0 + along) * np.cos(angle) - across * np.sin(angle))
        drift[1, 2:] = -kappa * (np.cos(angle) * ship.horizontal + np.sin(angle) * ship.vertical)
        by = drift @ state[size:].reshape(size, -1)
        by[1, -1] -= kappa * np.sin(angle)  # the last column is gravity's
        turn = -kappa * ((1.0 + along) * np.sin(angle) + across * np.cos(angle))
        return np.concatenate([[speed, turn], ship.drift @ moved, by.ravel()])

    start = np.concatenate([begin, np.eye(size, size + 1).ravel()])
    done = solve_ivp(slope, nodes[[0, -1]], start, t_eval=nodes, rtol=1e-10, atol=1e-13, max_step=0.05).y
    expected = done[size:, -1].reshape(size, -1)[:2]
    problem = Problem(lattice, KAPPA[:1], np.zeros(1))
    seas = (Sea(1.3, 0.3, 0.01), Sea(0.9, 0.2, 0.01, "vertical"))
    deaf, about = Assumed(seas, np.zeros(1), np.full(3, 1e9), sine=True), done[:size].T.astype(np.float32)
    free = tuple(Constant(f"start {q}", kinds.START, 1.0, q) for q in range(size))
    constants = (*free, Constant("gravity", kinds.GRAVITY, 1.0, mean=1.0, value=1.0))
    found = problem.run(deaf, constants, about=about)[1].state[:2, :-1]
    assert np.abs(found - expected).max() < 2e-6 * np.abs(expected).max()
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-6 * np.abs(expected).max())
