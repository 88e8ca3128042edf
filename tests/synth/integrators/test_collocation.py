"""Exponential collocation of clocks on yielding supports: references, laws, honest estimates, refusals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from collocation_cases import CASES, LENGTHS, REFERENCES, THREE
from energies import energy

from data_schemas.errors import RefusedError
from synth.integrators import explicit
from synth.integrators.collocation import FINEST, Problem, integrate, run
from synth.integrators.collocation_remainders import linear_part
from synth.systems.reduced_beam import ReducedBeam
from synth.systems.resistance import KnifeEdge, Quadratic, VanDerPolDrive
from synth.systems.terms import together
from synth.systems.yielding import ElasticBeam, FlexibleFrame, Metronomes, stiffness_of_ratio
from tests.synth.systems.system_examples import plain

EVERY = pytest.mark.parametrize("name", ["beam", "reduced", "frame", "metronomes"])


@pytest.mark.parametrize("name", [pytest.param("A", marks=pytest.mark.compiled), "B", "C1"])
def test_reference_trajectories(name: str) -> None:
    system, start, end, expected = REFERENCES[name]
    found = integrate(system, start, [0.0, end], tolerance=1e-9)
    assert np.max(np.abs(found.states[1] - expected)) < 1e-9


@pytest.mark.compiled
@pytest.mark.parametrize("name", list(REFERENCES))
def test_references_to_the_last_printed_digit(name: str) -> None:
    system, start, end, expected = REFERENCES[name]
    found = integrate(system, start, [0.0, end], tolerance=1e-14)
    assert np.max(np.abs(found.states[1] - expected)) < 1e-12
    assert found.estimated_error < 1e-12


@EVERY
def test_agrees_with_the_explicit_integrator(name: str) -> None:
    """Which calls the system's derivative: another form of the equations, and another method."""
    system, start = CASES[name]
    times = np.array([0.0, 0.3, 1.0, 1.7])
    found = integrate(system, start, times, tolerance=1e-12)
    other = explicit.integrate(system, start, times, tolerance=1e-12)
    scale = np.abs(other.states).max(axis=0)
    # ten times what both say of themselves, relative to what they saw on the way
    assert np.max(np.abs(found.states - other.states) / scale) < 10 * (found.estimated_error + other.estimated_error)
    assert found.estimated_error < 1e-11


@pytest.mark.compiled
@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-11, 1e-13])
@pytest.mark.parametrize("name", ["beam", "reduced", "frame", "metronomes, ashore"])
def test_estimate_is_honest(name: str, tolerance: float) -> None:
    system, start = CASES[name]
    times = np.linspace(0.0, 60.0, 241)
    found = integrate(system, start, times, tolerance=tolerance)
    exact = explicit.integrate(system, start, times, tolerance=1e-14)
    error = np.max(np.abs(found.states - exact.states) / np.abs(exact.states).max(axis=0))
    assert error <= 10 * (found.estimated_error + exact.estimated_error)
    assert error >= found.estimated_error / 1000 - exact.estimated_error
    assert found.estimated_error <= max(tolerance, 1e-12)


@pytest.mark.compiled
@pytest.mark.parametrize("name", ["C1", "frame, ashore", "metronomes, ashore"])
def test_energy_is_kept_over_ten_thousand_swings(name: str) -> None:
    """Chaotic or not: rounding makes a random walk of it, sqrt(intervals) x 1e-16."""
    system, start = REFERENCES[name][:2] if name in REFERENCES else CASES[name]
    times = np.linspace(0.0, 2e4 if name == "C1" else 1e4, 51)
    states = run(Problem(system), np.array(start, dtype=float), times, FINEST)[0]
    levels = np.array([energy(state, system) for state in states])
    swing = abs(levels[0] - energy(np.zeros(len(start)), system))  # above rest
    assert np.max(np.abs(levels - levels[0])) < 1e-12 * swing


@pytest.mark.parametrize("name", ["beam, ashore", "reduced"])
def test_mirror_of_one_clock_alone_bitwise(name: str) -> None:
    system, start = CASES[name]
    sign = np.array([1, 1, -1, -1, 1, 1, 1, 1.0])
    one = integrate(system, start, [0.0, 0.4, 1.1], tolerance=1e-9).states
    other = integrate(system, sign * start, [0.0, 0.4, 1.1], tolerance=1e-9).states
    np.testing.assert_array_equal(other, sign * one)


@pytest.mark.parametrize("name", ["frame, ashore", "metronomes, ashore"])
def test_mirror_of_all_bitwise(name: str) -> None:
    system, start = CASES[name]
    one = integrate(system, start, [0.0, 0.4, 1.1], tolerance=1e-9).states
    np.testing.assert_array_equal(integrate(system, -np.array(start), [0.0, 0.4, 1.1], tolerance=1e-9).states, -one)


def test_time_reversal_returns_to_the_start() -> None:
    system, start = REFERENCES["C1"][:2]
    turn = np.array([1, -1, 1, -1, 1, -1.0])
    there = integrate(system, start, [0.0, 2.0], tolerance=1e-11)
    back = integrate(system, turn * there.states[1], [0.0, 2.0], tolerance=1e-11)
    error = there.estimated_error + back.estimated_error
    assert np.max(np.abs(turn * back.states[1] - start)) < 100 * error  # rates of 5


def test_readings_do_not_change_the_motion() -> None:
    system, start = CASES["beam, ashore"]
    few = integrate(system, start, np.arange(65) / 32, tolerance=1e-12).states
    many = integrate(system, start, np.arange(129) / 64, tolerance=1e-12).states
    np.testing.assert_allclose(many[::2], few, atol=1e-13)  # a turn more or less at the edge of the limit


@pytest.mark.compiled
def test_measured_order_of_convergence() -> None:
    """Intervals of 1.5, 0.75 and 0.5 s, their nodes unchecked: order 21 measured between the first two, where 32 is
    the order of 16 Gauss nodes once they resolve the motion; then rounding alone is left."""
    system, start, _, _ = REFERENCES["B"]
    times, first = np.array([0.0, 12.0]), np.array(start, dtype=float)  # whole numbers of all these intervals
    exact = run(Problem(system), first, times, FINEST)[0][1]
    errors = []
    for interval in (1.5, 0.75, 0.5):
        problem = Problem(system)
        problem.longest = interval
        states = run(problem, first, times, (1e-15, 1e3), depth=0)[0]
        errors.append(np.max(np.abs(states[1] - exact)))
    assert np.log2(errors[0] / errors[1]) > 20.0
    assert errors[2] < 1e-14


def test_angles_over_the_top() -> None:
    system = Metronomes(np.array([6.0]), 0.01)
    found = integrate(system, [3.0, 8.0], [0.0, 1.5], tolerance=1e-12)
    other = explicit.integrate(system, [3.0, 8.0], [0.0, 1.5], tolerance=1e-12)
    assert other.states[1, 0] > 9.0
    np.testing.assert_allclose(found.states, other.states, rtol=1e-11)


def test_a_support_without_spring_is_carried_exactly() -> None:
    system = FlexibleFrame(2.0, np.array([1e-9]), np.array([0.25]), 0.0, 0.0, 9.81)
    found = integrate(system, [0.1, 0.7, 1e-9, 0.0], [0.0, 3.0], tolerance=1e-12)
    assert found.states[1, 0] == pytest.approx(0.1 + 0.7 * 3.0, rel=1e-14)


STIFF = ElasticBeam(50.0, np.full(2, 0.25), LENGTHS, 1.0, 0.0, 9.81)
KNIFE = KnifeEdge(np.full(2, 0.02), np.full(2, 0.01))
SLOW = VanDerPolDrive(np.full(2, 0.06), np.full(2, 0.05))
REFUSED: dict[str, tuple[Any, list[float], str]] = {
    "dry friction": (STIFF._replace(terms=KNIFE), [0.0] * 6, "KnifeEdge"),
    "turbulent air": (STIFF._replace(terms=together(SLOW, Quadratic(np.full(2, 0.1)))), [0.0] * 6, "Quadratic"),
    "another system": (plain(6.0), [0.1, 0.0], "DrivenPendulums"),
    "singular mass": (ReducedBeam(0.0, 0.0, 0.125, np.zeros(1)), [0, 0, 2.0, 0.1], "singular"),
    "weightless board": (Metronomes(np.full(2, 6.0), 0.6), [0.1, 0, 0.1, 0], "weigh nothing"),
}


@pytest.mark.parametrize("name", list(REFUSED))
def test_what_cannot_be_collocated_is_refused(name: str) -> None:
    system, start, word = REFUSED[name]
    with pytest.raises(RefusedError, match=word) as caught:
        integrate(system, start, [0.0, 1.0])
    assert "\n" not in str(caught.value)


@pytest.mark.compiled
def test_stiff_beam_is_refused() -> None:
    stiff = STIFF._replace(stiffness=stiffness_of_ratio(1e4, STIFF), terms=SLOW)
    with pytest.raises(RefusedError, match="radau"):
        integrate(stiff, [1e-3, 0.0, 0.1, 0.0, 0.1, 0.0], [0.0, 1.0])


def test_three_lengths_are_three_swings() -> None:
    parts = linear_part(CASES["beam"][0])
    assert [float(square) for square, _ in parts[1:]] == pytest.approx((9.81 / THREE).tolist(), rel=1e-15)
