"""One step of Radau IIA: linear algebra, order, stability."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from synth.integrators.radau_linear import factor, factor_pair, solve, solve_pair
from synth.integrators.radau_step import (
    DIVERGED,
    NOT_FINITE,
    SOLVED,
    Work,
    collocate,
    differences,
    evaluate,
    guess,
)
from synth.phase import Floats
from synth.systems.dispatch import jacobian
from synth.systems.driven_pendulums import plain
from synth.systems.resistance import VanDerPol
from tests.synth.integrators.conftest import Cliff, Linear

STAGES = pytest.mark.parametrize("stages", [3, 5, 7])


def _space(stages: int, n: int) -> Work:
    z, f, g = (np.zeros(stages * n) for _ in range(3))
    return Work(z, f, g, np.zeros(stages * n * n), np.zeros(stages * n, dtype=np.int64), np.zeros(n), np.zeros(n))


def _step(system: Any, time: float, state: Floats, step: float, stages: int) -> tuple[int, Floats]:
    """Outcome and increments at the nodes of one step solved to rounding."""
    n = state.size
    count, size = (0,) * stages, (0,) * n
    work = _space(stages, n)
    slopes = np.zeros((n, n))
    jacobian(time, state, system, slopes, work.point, work.slope)
    scale = 1.0 / np.maximum(np.abs(state), 1e-3)
    outcome, _, _ = collocate(time, step, state, scale, 1e-15, slopes.ravel(), count, size, work, system)
    return outcome, work.z.reshape(stages, n)


@pytest.mark.parametrize("n", [1, 3, 6])
def test_systems_are_solved_with_all_exchanges(n: int) -> None:
    """A dominant anti-diagonal forces an exchange at every stage; forgetting one shows from n = 3 on."""
    random = np.random.default_rng(n)
    slopes = random.normal(size=(n, n)) + 5.0 * np.roll(np.eye(n)[::-1], 1, axis=0)
    stack, exchanges = np.zeros(3 * n * n), np.zeros(3 * n, dtype=np.int64)
    right = random.normal(size=(3, n))
    real, pair = right[0].copy(), right[1] + 1j * right[2]
    assert factor(0.3, slopes.ravel(), (0,) * n, stack, exchanges)
    assert factor_pair(1, 0.2, 0.7, slopes.ravel(), (0,) * n, stack, exchanges)
    solve((0,) * n, stack, exchanges, right.reshape(-1))
    solve_pair(1, (0,) * n, stack, exchanges, right.reshape(-1))
    exact = np.linalg.solve(0.3 * np.eye(n) - slopes, real)
    exact_pair = np.linalg.solve((0.2 + 0.7j) * np.eye(n) - slopes, pair)
    np.testing.assert_allclose(right[0], exact, rtol=0.0, atol=1e-12 * np.abs(exact).max())  # condition below 1e3
    np.testing.assert_allclose(right[1] + 1j * right[2], exact_pair, rtol=0.0, atol=1e-12 * np.abs(exact_pair).max())


def test_singular_and_infinite_matrices_are_told() -> None:
    stack, exchanges = np.zeros(12), np.zeros(6, dtype=np.int64)
    assert not factor(1.0, np.eye(2).ravel(), (0, 0), stack, exchanges)
    assert not factor(1.0, np.full(4, np.nan), (0, 0), stack, exchanges)
    assert not factor_pair(1, 1.0, 0.0, np.eye(2).ravel(), (0, 0), stack, exchanges)


@pytest.mark.parametrize(("stages", "steps"), [(3, 24), (5, 12), (7, 6)])
def test_order_is_twice_the_stages_less_one(stages: int, steps: int) -> None:
    """A pendulum of 1 rad over 1.5 s, against the finer grid of the method of 7 stages."""
    system = plain(6.2)
    errors = []
    exact = None
    for number, order in ((30, 7), (steps, stages), (2 * steps, stages)):
        state = np.array([1.0, 0.0])
        for k in range(number):
            outcome, z = _step(system, k * 1.5 / number, state, 1.5 / number, order)
            assert outcome == SOLVED
            state = state + z[-1]
        if exact is None:
            exact = state
        else:
            errors.append(np.max(np.abs(state - exact)))
    measured = math.log2(errors[0] / errors[1])
    assert abs(measured - (2 * stages - 1)) < 0.5  # higher terms of the error at these steps


@STAGES
def test_a_stiff_component_is_gone_after_one_step(stages: int) -> None:
    """L-stability: |R(z)| tends to s/|z| at most for the Pade approximant (s - 1, s)."""
    outcome, z = _step(Linear(np.array([[-1e6]])), 0.0, np.array([1.0]), 1.0, stages)
    assert outcome == SOLVED
    assert abs(1.0 + z[-1, 0]) < stages * 1.1e-6


@STAGES
@pytest.mark.parametrize("angle", [0.5, 2.0, 7.0, 50.0])
def test_an_oscillation_never_grows(stages: int, angle: float) -> None:
    """A-stability on its boundary: |R(i y)| <= 1, and equal to the Pade approximant of the exponential."""
    outcome, z = _step(Linear(np.array([[0.0, angle], [-angle, 0.0]])), 0.0, np.array([1.0, 0.0]), 1.0, stages)
    grown = complex(1.0 + z[-1, 0], -z[-1, 1])
    numerator = sum(_pade(stages - 1, stages, k) * (1j * angle) ** k for k in range(stages))
    denominator = sum(_pade(stages, stages - 1, k) * (-1j * angle) ** k for k in range(stages + 1))
    assert outcome == SOLVED
    assert abs(grown) <= 1.0 + 1e-13
    assert abs(grown - numerator / denominator) < 1e-12  # sums of powers up to 50^7 cancel no further than this


def _pade(top: int, bottom: int, k: int) -> float:
    return math.comb(top, k) * math.factorial(top + bottom - k) / math.factorial(top + bottom)


@STAGES
def test_the_polynomial_goes_through_its_nodes(stages: int) -> None:
    outcome, z = _step(VanDerPol(1.0), 0.0, np.array([2.0, 0.0]), 0.1, stages)
    polynomial, increments, point = np.zeros((stages + 1) * 2), np.zeros(stages * 2), np.zeros(2)
    differences(stages, (0, 0), z.ravel(), polynomial)
    assert outcome == SOLVED
    evaluate(0.0, stages, (0, 0), polynomial, point, 0)
    assert np.max(np.abs(point)) < 1e-16
    guess(stages, stages, 0.0, 1.0, (0, 0), polynomial, increments, point)
    np.testing.assert_allclose(increments, z.ravel(), rtol=0.0, atol=1e-16)
    # in between it keeps the order s: 0.1^(s + 1) of a solution of size 1 with rates up to 3
    _, half = _step(VanDerPol(1.0), 0.0, np.array([2.0, 0.0]), 0.05, stages)
    evaluate(0.5, stages, (0, 0), polynomial, point, 0)
    assert abs(point[0] - half[-1, 0]) < 0.3 ** (stages + 1) / 10.0


def test_a_step_too_long_for_newton_is_told() -> None:
    outcome, _ = _step(VanDerPol(1000.0), 0.0, np.array([1.001, -2.0]), 1.0, 7)
    assert outcome == DIVERGED
    outcome, _ = _step(Cliff(0.5), 0.0, np.array([1.0]), 1.0, 3)
    assert outcome == NOT_FINITE
