"""The explicit integrator: references, laws, honest estimates, refusals."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from energies import energy
from pantaleone_board import pantaleone

from data_schemas.errors import RefusedError, UsageError
from synth.integrators.explicit import LOOSEST, integrate
from synth.integrators.explicit_march import Run
from synth.systems.driven_pendulums import DrivenPendulums, Linear
from synth.systems.reduced_beam import ReducedBeam
from synth.systems.resistance import KnifeEdge, Quadratic, VanDerPol, VanDerPolDrive, Viscous
from synth.systems.terms import harmonics, together
from synth.systems.yielding import ElasticBeam, FlexibleFrame, stiffness_of_ratio
from tests.synth.systems.system_examples import plain

LENGTHS = np.array([0.249, 0.2484])
BEAM_A = ReducedBeam(0.02, 0.02, 7.142857142857e-6, np.array([-0.01139, -0.01141]))
START_A = [0, 0, 2, 0, 1, -1.5]
BEAM_B = ElasticBeam(
    50.0, np.full(2, 0.25), LENGTHS, 8000.0, 0.25, 9.81, VanDerPolDrive(np.full(2, 0.06), 0.0138 / LENGTHS)
)
START_B = [0.001, 0, 0.1, 0, -0.07, 0.3]
BEAM_C = ElasticBeam(2.0, np.ones(2), np.array([1.0, 0.9]), 150.0, 0.0, 9.81)
START_C = [0.05, 0, 1, 0, -0.5, 0]

# formula sheet, section 3.2: two independent integrators; printed digits end near 5e-13
REFERENCES: dict[str, tuple[Any, list[float], float, list[float]]] = {
    "A": (
        BEAM_A,
        START_A,
        1000.0,
        [9.5683187619e-5, 5.2287080973e-5, 0.693916614425, -1.857702623946, -1.820363617138, -0.814847412871],
    ),
    "B": (
        BEAM_B,
        START_B,
        10.0,
        [1.6354202583e-4, -0.0024138027753, 0.102128042586, -0.016925278855, -0.081577222789, 0.388456838204],
    ),
    "C1": (
        BEAM_C,
        START_C,
        10.0,
        [-0.145528869838, -0.257144470808, -3.05900133082e-4, -0.831781109645, -0.459215748325, -2.504196294477],
    ),
}


@pytest.mark.parametrize("name", [pytest.param("A", marks=pytest.mark.compiled), "B", "C1"])
def test_reference_trajectories(name: str) -> None:
    system, start, end, expected = REFERENCES[name]
    found = integrate(system, start, [0.0, end], tolerance=1e-9 if name != "A" else 1e-13)
    assert np.max(np.abs(found.states[1] - expected)) < 1e-9
    if name == "A":
        assert np.max(np.abs(found.states[1] - expected)) < 1e-12  # the printed digits


@pytest.mark.compiled
@pytest.mark.parametrize("name", ["B", "C1"])
def test_references_to_the_last_printed_digit(name: str) -> None:
    system, start, end, expected = REFERENCES[name]
    found = integrate(system, start, [0.0, end], tolerance=1e-14)
    assert np.max(np.abs(found.states[1] - expected)) < 1e-12
    assert found.estimated_error < 1e-13


def test_energy_of_reference_c1() -> None:
    assert energy(np.array(START_C, dtype=float), BEAM_C) == pytest.approx(-12.8610420594966, rel=1e-14)


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("system", "start", "end"),
    [
        (plain(2 * math.pi), [2.5, 0.0], 2.2e4),  # at 2.5 rad a swing takes 2.2 s
        (BEAM_C, START_C, 2.0e4),
        pytest.param(
            FlexibleFrame(2.0, np.array([0.5, 0.4]), np.array([1.0, 0.9]), 150.0, 0.0, 9.81),
            [0.01, 0, 1, 0, -0.5, 0],
            2e4,
            marks=pytest.mark.campaign,
        ),
        pytest.param(
            pantaleone(np.array([0.01, -0.01]), 0.0, 0.4, 0.05),
            [0.6, 0.0, -0.3, 0.1],
            6.3e4,
            marks=pytest.mark.campaign,
        ),
    ],
    ids=["pendulum", "beam", "frame", "metronomes"],
)
def test_energy_is_kept_over_ten_thousand_swings(system: Any, start: list[float], end: float) -> None:
    """Truncation is made negligible; what is left is the random walk of rounding, sqrt(steps) x 1e-16."""
    times = np.linspace(0.0, end, 51)
    states = Run(system, None, np.array(start, dtype=float), times, 1e-16).states
    levels = np.array([energy(state, system) for state in states])
    swing = abs(levels[0] - energy(np.zeros(len(start)), system))  # above rest
    assert np.max(np.abs(levels - levels[0])) < 1e-12 * swing


def test_time_reversal_returns_to_the_start() -> None:
    there = integrate(BEAM_C, START_C, [0.0, 2.0], tolerance=1e-11)
    turned = there.states[1] * np.array([1, -1, 1, -1, 1, -1])
    back = integrate(BEAM_C, turned, [0.0, 2.0], tolerance=1e-11)
    expected = np.array(START_C) * np.array([1, -1, 1, -1, 1, -1])
    assert np.max(np.abs(back.states[1] - expected)) < 100 * (
        there.estimated_error + back.estimated_error
    )  # rates of 5


@pytest.mark.parametrize(
    ("system", "start", "image", "sign"),
    [
        (BEAM_B, START_B, BEAM_B, [1, 1, -1, -1, 1, 1]),
        (BEAM_A, START_A, BEAM_A, [1, 1, -1, -1, 1, 1]),
        pytest.param(
            pantaleone(np.array([0.01, -0.01]), 0.01, 0.4, 0.05),
            [0.6, 0, -0.3, 0.1],
            None,
            [-1, -1, -1, -1],
            marks=pytest.mark.campaign,
        ),
        (
            DrivenPendulums(np.array([6.2]), 9.81, horizontal=harmonics([2.0], [1.0], [0.3])),
            [0.6, 0.2],
            DrivenPendulums(np.array([6.2]), 9.81, horizontal=harmonics([-2.0], [1.0], [0.3])),
            [-1, -1],
        ),
    ],
    ids=["beam", "reduced", "metronomes", "pendulum"],
)
def test_mirror_image_bitwise(system: Any, start: list[float], image: Any, sign: list[float]) -> None:
    times = [0.0, 0.37, 1.0]
    one = integrate(system, start, times, tolerance=1e-8).states
    other = integrate(image or system, np.array(start) * sign, times, tolerance=1e-8).states
    np.testing.assert_array_equal(other, one * np.array(sign))


def test_outputs_do_not_change_the_motion() -> None:
    few = integrate(plain(6.0), [1.0, 0.0], np.arange(65) / 32, tolerance=1e-9)
    many = integrate(plain(6.0), [1.0, 0.0], np.arange(129) / 64, tolerance=1e-9)
    np.testing.assert_array_equal(few.states, many.states[::2])


def test_dense_output_is_as_good_as_the_ends() -> None:
    """A linear pendulum has a solution in closed form; 200 outputs fall anywhere in the steps."""
    times = np.linspace(0.0, 4.0, 200)
    found = integrate(DrivenPendulums(np.array([6.0]), restoring=Linear()), [0.1, 0.0], times, tolerance=1e-9)
    error = np.max(np.abs(found.states[:, 0] - 0.1 * np.cos(6.0 * times))) / 0.1
    assert error < 1e-9
    assert found.estimated_error / 1000 < error < 10 * found.estimated_error


def test_order_of_convergence_is_eight() -> None:
    """With the local error proportional to h^8, the error at the end is proportional to the tolerance."""
    system = DrivenPendulums(np.array([6.0]), restoring=Linear())
    start, times = np.array([0.1, 0.0]), np.linspace(0.0, 6.0, 50)
    errors, steps = [], []
    for tolerance in (1e-7, 1e-10):
        made = Run(system, None, start, times, tolerance)
        errors.append(np.max(np.abs(made.states[:, 0] - 0.1 * np.cos(6.0 * times))))
        steps.append(int(made.counts[0]))
    order = math.log(errors[0] / errors[1]) / math.log(steps[1] / steps[0])
    assert 7.0 < order < 9.5


@pytest.mark.compiled
def test_stiff_beam_tends_to_the_fixed_support_as_the_square() -> None:
    """Section 3.2: phi(10) = -.46325276873179 on a fixed support, deviation falling as R^-2."""
    deviation = []
    for ratio in (25.0, 50.0, 100.0):
        beam = ElasticBeam(2.0, np.ones(1), np.ones(1), 1.0, 0.0, 9.81)
        beam = beam._replace(stiffness=stiffness_of_ratio(ratio, beam))
        pull = 9.81 * math.sin(1.0) ** 2
        start = [-pull / beam.stiffness, 0.0, 1.0, 0.0]  # at the sag of the start, so that the beam does not ring
        found = integrate(beam, start, [0.0, 10.0], tolerance=1e-10)
        deviation.append(found.states[1, 2] + 0.46325276873179)
    assert abs(deviation[2]) < 1e-3
    assert deviation[0] / deviation[1] == pytest.approx(4.0, rel=0.1)
    assert deviation[1] / deviation[2] == pytest.approx(4.0, rel=0.05)
    fixed = integrate(plain(math.sqrt(9.81)), [1.0, 0.0], [0.0, 10.0], tolerance=1e-13)
    assert fixed.states[1, 0] == pytest.approx(-0.46325276873179, abs=1e-13)


@pytest.mark.campaign
def test_stiff_frame_tends_to_the_fixed_support_as_the_square() -> None:
    fixed = integrate(plain(math.sqrt(9.81)), [1.0, 0.0], [0.0, 10.0], tolerance=1e-12).states[1, 0]
    deviation = []
    for ratio in (25.0, 50.0, 100.0):
        stiffness = 3.0 * 9.81 * ratio**2
        frame = FlexibleFrame(2.0, np.ones(1), np.ones(1), stiffness, 0.0, 9.81)
        start = [9.81 * math.sin(1.0) * math.cos(1.0) / stiffness, 0.0, 1.0, 0.0]
        deviation.append(integrate(frame, start, [0.0, 10.0], tolerance=1e-10).states[1, 2] - fixed)
    assert deviation[0] / deviation[1] == pytest.approx(4.0, rel=0.1)
    assert deviation[1] / deviation[2] == pytest.approx(4.0, rel=0.05)


def test_refusals_name_their_reason() -> None:
    singular = ReducedBeam(0.0, 0.0, 0.125, np.zeros(1))
    with pytest.raises(RefusedError, match=r"singular.*full system"):
        integrate(singular, [0, 0, 2.0, 0.1], [0.0, 1.0])
    with pytest.raises(RefusedError, match="singular"):
        integrate(singular, [0, 0, 1.5, 3.0], [0.0, 5.0])
    with pytest.raises(RefusedError, match="not finite"):
        integrate(plain(math.nan), [0.1, 0.0], [0.0, 1.0])
    with pytest.raises(RefusedError, match=r"rounding of time|not finite"):
        integrate(VanDerPol(-1.0), [3.0, 3.0], [0.0, 2.0])  # infinite within a second


@pytest.mark.compiled
def test_stiff_motion_is_refused_by_name() -> None:
    with pytest.raises(RefusedError, match=r"stiff.*radau"):
        integrate(VanDerPol(1000.0), [2.0, 0.0], [0.0, 2000.0], tolerance=1e-6)


@pytest.mark.campaign
@pytest.mark.parametrize("tolerance", [1e-9, 1e-13, 1e-15])
def test_kinks_in_the_forces_do_not_stop_the_march(tolerance: float) -> None:
    """Air and a knife edge: a kink in the acceleration at every turn; 600 s end all the same."""
    rates, phases = np.linspace(0.4, 1.6, 16), np.arange(16.0) ** 2
    system = DrivenPendulums(
        np.array([6.22, 6.21]),
        9.81,
        horizontal=harmonics(np.full(16, 0.05), rates, phases),
        terms=together(Quadratic(np.array([0.5, 5e-4])), KnifeEdge(np.array([2e-6, 1e-2]), np.array([2e-3, 1e-5]))),
    )
    found = integrate(system, [0.015, 0.0, 0.0, 0.1], np.arange(12_000) / 20.0, tolerance=tolerance)
    assert found.estimated_error <= max(tolerance, 1e-11)
    assert found.steps < 2_000_000


@pytest.mark.parametrize(
    ("start", "times", "tolerance"),
    [
        ([math.nan, 0.0], [0.0, 1.0], 1e-9),
        ([[0.1, 0.0]], [0.0, 1.0], 1e-9),
        ([0.1, 0.0], [0.0, 0.0], 1e-9),
        ([0.1, 0.0], [], 1e-9),
        ([0.1, 0.0], [0.0, math.inf], 1e-9),
        ([0.1, 0.0], [0.0, 1.0], 0.0),
    ],
)
def test_impossible_arguments(start: Any, times: list[float], tolerance: float) -> None:
    with pytest.raises(UsageError):
        integrate(plain(1.0), start, times, tolerance=tolerance)


def test_rest_stays_at_rest_and_one_instant_is_the_start() -> None:
    still = integrate(
        DrivenPendulums(np.array([6.0, 6.1]), terms=Viscous(np.array([0.1, 0.0]))), np.zeros(4), [0.0, 9.0]
    )
    assert np.all(still.states == 0.0)
    assert still.estimated_error < 1e-14
    at_once = integrate(plain(1.0), [0.3, 0.1], [5.0])
    np.testing.assert_array_equal(at_once.states, [[0.3, 0.1]])


def test_free_fall_and_beyond() -> None:
    """z'' = -g: no force at all, uniform turning; z'' = -2g: the pendulum stands upside down."""
    falling = DrivenPendulums(np.array([6.0]), 10.0, vertical=harmonics([-10.0], [0.0], [0.0]))
    assert integrate(falling, [0.3, 1.5], [0.0, 2.0]).states[1] == pytest.approx([3.3, 1.5], rel=1e-13)
    upside = falling._replace(vertical=harmonics([-20.0], [0.0], [0.0]))
    start = [math.pi - 0.1, 0.0]
    found = integrate(upside, start, [0.0, 1.0], tolerance=min(1e-9, LOOSEST)).states[1, 0]
    assert found == pytest.approx(math.pi - integrate(plain(6.0), [0.1, 0.0], [0.0, 1.0]).states[1, 0], abs=1e-8)
