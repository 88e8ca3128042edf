"""One step of Radau IIA: linear algebra, order, stability."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from synth.integrators.radau_newton import factor, factor_pair, solve, solve_pair
from synth.integrators.radau_step import (
    DIVERGED,
    NOT_FINITE,
    SOLVED,
    Space,
    addresses,
    collocate,
    differences,
    evaluate,
    guess,
    space,
)
from synth.kernels.compiled import kernel
from synth.phase import Floats
from synth.systems.dispatch import jacobian
from synth.systems.resistance import VanDerPol
from tests.synth.integrators.conftest import Cliff, Linear
from tests.synth.systems.system_examples import plain

STAGES = pytest.mark.parametrize("stages", [5, 7])


def _step(system: Any, time: float, state: Floats, step: float, stages: int) -> tuple[int, Space]:
    """Outcome and arrays of one step solved to rounding; its increments at the nodes are `z[:stages]`."""
    n = state.size
    arrays = space(state)
    jacobian(time, arrays.state, system, arrays.slopes, arrays.slope, arrays.other)
    arrays.scale[:] = 1.0 / np.maximum(np.abs(state), 1e-3)
    return _collocate(time, step, (0,) * stages, (0,) * n, arrays, system), arrays


@kernel
def _collocate(time: float, step: float, count: Any, size: Any, arrays: Space, system: Any) -> int:
    return collocate(time, step, 1e-15, count, size, addresses(arrays), system)[0]


@kernel
def _solved(rate: float, pair: complex, size: Any, arrays: Space) -> bool:
    """Solve the real system for row 0 of `g` and a complex one for rows 1 and 2; False if one of them is singular."""
    work = addresses(arrays)
    good = factor(rate, work.slopes, size, work.stack, work.exchanges)
    good &= factor_pair(1, pair.real, pair.imag, work.slopes, size, work.stack, work.exchanges)
    solve(size, work.stack, work.exchanges, work.g)
    solve_pair(1, size, work.stack, work.exchanges, work.g)
    return good


@kernel
def _read(at: float, count: Any, size: Any, arrays: Space) -> None:
    """The polynomial at a place of the step, into `other`; then the guess of the same step anew, into `z`."""
    work = addresses(arrays)
    differences(count, size, work)
    evaluate(at, count, size, work.polynomial, work.other, 0)
    guess(True, 0.0, 1.0, count, size, work)


@pytest.mark.parametrize("n", [1, 3, 6])
def test_systems_are_solved_with_all_exchanges(n: int) -> None:
    """A dominant anti-diagonal forces an exchange at every stage; forgetting one shows from n = 3 on."""
    random = np.random.default_rng(n)
    slopes = random.normal(size=(n, n)) + 5.0 * np.roll(np.eye(n)[::-1], 1, axis=0)
    arrays = space(np.zeros(n))
    real, pair = random.normal(size=n), random.normal(size=n) + 1j * random.normal(size=n)
    arrays.slopes[:], arrays.g[:3] = slopes, [real, pair.real, pair.imag]
    assert _solved(0.3, 0.2 + 0.7j, (0,) * n, arrays)
    exact = np.linalg.solve(0.3 * np.eye(n) - slopes, real)
    exact_pair = np.linalg.solve((0.2 + 0.7j) * np.eye(n) - slopes, pair)
    np.testing.assert_allclose(arrays.g[0], exact, rtol=0.0, atol=1e-12 * np.abs(exact).max())  # condition below 1e3
    np.testing.assert_allclose(
        arrays.g[1] + 1j * arrays.g[2], exact_pair, rtol=0.0, atol=1e-12 * np.abs(exact_pair).max()
    )


def test_singular_and_infinite_matrices_are_told() -> None:
    for slopes, rate, pair in ((np.eye(2), 1.0, 2j), (np.full((2, 2), np.nan), 1.0, 2j), (np.eye(2), 2.0, 1.0 + 0j)):
        arrays = space(np.zeros(2))
        arrays.slopes[:] = slopes
        assert not _solved(rate, pair, (0, 0), arrays)


@pytest.mark.parametrize(("stages", "steps"), [(5, 12), (7, 6)])
def test_order_is_twice_the_stages_less_one(stages: int, steps: int) -> None:
    """A pendulum of 1 rad over 1.5 s, against the finer grid of the method of 7 stages."""
    system = plain(6.2)
    errors = []
    exact = None
    for number, order in ((30, 7), (steps, stages), (2 * steps, stages)):
        state = np.array([1.0, 0.0])
        for k in range(number):
            outcome, arrays = _step(system, k * 1.5 / number, state, 1.5 / number, order)
            assert outcome == SOLVED
            state = state + arrays.z[order - 1]
        if exact is None:
            exact = state
        else:
            errors.append(np.max(np.abs(state - exact)))
    measured = math.log2(errors[0] / errors[1])
    assert abs(measured - (2 * stages - 1)) < 0.5  # higher terms of the error at these steps


@STAGES
def test_a_stiff_component_is_gone_after_one_step(stages: int) -> None:
    """L-stability: |R(z)| tends to s/|z| at most for the Pade approximant (s - 1, s)."""
    outcome, arrays = _step(Linear(np.array([[-1e6]])), 0.0, np.array([1.0]), 1.0, stages)
    assert outcome == SOLVED
    assert abs(1.0 + arrays.z[stages - 1, 0]) < stages * 1.1e-6


@STAGES
@pytest.mark.parametrize("angle", [0.5, 2.0, 7.0, 50.0])
def test_an_oscillation_never_grows(stages: int, angle: float) -> None:
    """A-stability on its boundary: |R(i y)| <= 1, and equal to the Pade approximant of the exponential."""
    outcome, arrays = _step(Linear(np.array([[0.0, angle], [-angle, 0.0]])), 0.0, np.array([1.0, 0.0]), 1.0, stages)
    grown = complex(1.0 + arrays.z[stages - 1, 0], -arrays.z[stages - 1, 1])
    numerator = sum(_pade(stages - 1, stages, k) * (1j * angle) ** k for k in range(stages))
    denominator = sum(_pade(stages, stages - 1, k) * (-1j * angle) ** k for k in range(stages + 1))
    assert outcome == SOLVED
    assert abs(grown) <= 1.0 + 1e-13
    assert abs(grown - numerator / denominator) < 1e-12  # sums of powers up to 50^7 cancel no further than this


def _pade(top: int, bottom: int, k: int) -> float:
    return math.comb(top, k) * math.factorial(top + bottom - k) / math.factorial(top + bottom)


@STAGES
def test_the_polynomial_goes_through_its_nodes(stages: int) -> None:
    outcome, arrays = _step(VanDerPol(1.0), 0.0, np.array([2.0, 0.0]), 0.1, stages)
    assert outcome == SOLVED
    increments = arrays.z.copy()
    _read(0.0, (0,) * stages, (0, 0), arrays)
    assert np.max(np.abs(arrays.other)) < 1e-16
    np.testing.assert_allclose(arrays.z, increments, rtol=0.0, atol=1e-16)
    # in between it keeps the order s: 0.1^(s + 1) of a solution of size 1 with rates up to 3
    _, half = _step(VanDerPol(1.0), 0.0, np.array([2.0, 0.0]), 0.05, stages)
    _read(0.5, (0,) * stages, (0, 0), arrays)
    assert abs(arrays.other[0] - half.z[stages - 1, 0]) < 0.3 ** (stages + 1) / 10.0


def test_a_step_too_long_for_newton_is_told() -> None:
    outcome, _ = _step(VanDerPol(1000.0), 0.0, np.array([1.001, -2.0]), 1.0, 7)
    assert outcome == DIVERGED
    outcome, _ = _step(Cliff(0.5), 0.0, np.array([1.0]), 1.0, 5)
    assert outcome == NOT_FINITE
