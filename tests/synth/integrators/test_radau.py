"""Radau IIA as a whole: published values, honest errors, refusals."""

from __future__ import annotations

import os
from typing import Any

import mpmath
import numpy as np
import pytest

from data_schemas.errors import RefusedError, UsageError
from synth.integrators import radau, radau_step
from synth.integrators.radau import Problem, Run, integrate, swing_of_bobs
from synth.integrators.radau_step import addresses, differences, part_step, space
from synth.phase import Floats
from synth.systems.reduced_beam import ReducedBeam
from synth.systems.resistance import VanDerPol
from synth.systems.yielding import ElasticBeam, Metronomes
from tests.synth.integrators.conftest import Cliff, Linear
from tests.synth.systems.system_examples import plain

INTERPRETED = pytest.mark.skipif(
    os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0"),
    reason="a kernel is replaced, or a system would be compiled for this test alone",
)

# van der Pol, mu = 1000, y = (2, 0), t = 2000: Taylor integration with 80 bits at 1e-19; agrees with the Test Set for
# Initial Value Problem Solvers (Mazzia and Magherini, 2008)
REFERENCE = np.array([1.70616773217046501, -8.92809701024817e-4])


@pytest.mark.parametrize(("tolerance", "bound"), [(1e-6, 1e-6), (1e-9, 1e-9), (1e-12, 1e-12), (1e-14, 1e-12)])
def test_van_der_pol_reference(tolerance: float, bound: float) -> None:
    """Relative to each component itself: 1e-12 is 5000 roundings, room for some at each of 300 steps. Wanted: 1e-11."""
    made = integrate(VanDerPol(1000.0), [2.0, 0.0], [0.0, 2000.0], tolerance=tolerance)
    assert np.max(np.abs(made.states[-1] / REFERENCE - 1.0)) < bound
    assert made.estimated_error < tolerance * 100.0  # the companion's tolerance is ten times looser


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("stiffness", "period"),
    [(1.0, 6.6632868593), (10.0, 19.07836956694), (100.0, 162.83707109237), (1000.0, 1614.40112580833)],
)
def test_van_der_pol_periods(stiffness: float, period: float) -> None:
    """Between falls through zero, on the cycle; the periods are given to 1e-11 relative at worst."""
    system = VanDerPol(stiffness)
    state = integrate(system, [2.0, 0.0], [0.0, 6.0 * period], tolerance=1e-13).states[-1]
    first = _fall(system, state, 0.0, period)
    state = integrate(system, state, [0.0, first], tolerance=1e-13).states[-1]
    assert _fall(system, state, 0.6 * period, 1.4 * period) == pytest.approx(period, rel=2e-11)


def _fall(system: VanDerPol, state: Floats, low: float, high: float) -> float:
    """Time of the only fall of y through zero between `low` and `high`."""
    grid = np.linspace(low, high, 200)
    grid = grid if low == 0.0 else np.concatenate([[0.0], grid])
    y = integrate(system, state, grid, tolerance=1e-9).states[:, 0]
    at = [k for k in range(1, grid.size - 1) if y[k] > 0.0 >= y[k + 1]]
    low, high = grid[at[-1]], grid[at[-1] + 1]
    while high - low > 1e-14 * high:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        above = integrate(system, state, [0.0, middle], tolerance=1e-13).states[-1, 0] > 0.0
        low, high = (middle, high) if above else (low, middle)
    return 0.5 * (low + high)


SWEEP = {
    "relaxation": (VanDerPol(100.0), [2.0, 0.0], np.linspace(0.0, 190.0, 51)),
    "stiffer": (VanDerPol(1000.0), [2.0, 0.0], np.linspace(0.0, 1900.0, 51)),
    "gentle": (VanDerPol(1.0), [2.0, 0.0], np.linspace(0.0, 20.0, 51)),
    "swing": (plain(6.2), [1.0, 0.0], np.linspace(0.0, 20.0, 401)),
    "decay": (
        Linear(np.array([[-1.0, 0.3, 0.0], [0.0, -1e5, 0.0], [0.0, 0.0, -3.0]])),
        [1.0, 1.0, 1.0],
        np.linspace(0.0, 3.0, 31),
    ),
}


@pytest.mark.compiled
@pytest.mark.parametrize("case", SWEEP)
def test_estimates_are_honest(case: str) -> None:
    """True error within ten times the estimate, and not below a thousandth of it, but for rounding."""
    system, start, times = SWEEP[case]
    exact = integrate(system, start, times, tolerance=1e-14, stages=5)
    size = _sizes(system, start, times)
    for tolerance in (1e-4, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11):
        made = integrate(system, start, times, tolerance=tolerance)
        true = float(np.max(np.abs(made.states - exact.states) / size))
        assert true <= 10.0 * made.estimated_error, tolerance
        assert true >= 1e-3 * made.estimated_error or made.estimated_error < 1e-11, tolerance


def _sizes(system: Any, start: list[float], times: Floats) -> Floats:
    """Largest size of each component on the way, steps included: in the fall of a relaxation it is in no reading."""
    first = np.array(start)
    return Problem(system, first, times, swing_of_bobs(system, first), None).pair(1e-8, 1e-8).fine.largest


def test_a_jump_is_crossed_and_read() -> None:
    """Steps are rejected and part steps are solved on the way through the fall of a relaxation."""
    times = np.concatenate([np.linspace(0.0, 18.0, 7), [18.2]])
    made = integrate(VanDerPol(20.0), [2.0, 0.0], times, tolerance=1e-6)
    tight = integrate(VanDerPol(20.0), [2.0, 0.0], times, tolerance=1e-10)
    assert made.rejected > 0
    assert made.states[-1, 0] < -1.5 < 1.0 < made.states[1, 0]
    assert np.max(np.abs(made.states - tight.states)) < 1e-3  # instants in the fall: times are good to 1e-6, speed 27


def test_growth_is_followed() -> None:
    """y' = J y, J > 0, over 20 times of growth: the matrix gamma/h - J is singular at one length of step."""
    made = integrate(Linear(np.diag([1e3, 0.0, 0.0])), [1e-6, 0.0, 0.0], [0.0, 0.02], tolerance=1e-8, stages=5)
    assert made.states[-1, 0] == pytest.approx(1e-6 * np.exp(20.0), rel=1e-6)


def test_readings_change_nothing_but_the_readings() -> None:
    """Few instants leave the steps as they are; the states there are those of an end there, to the tolerance."""
    system, start = VanDerPol(5.0), [2.0, 0.0]
    plain_run = integrate(system, start, [0.0, 0.6], tolerance=1e-9)
    read = integrate(system, start, [0.0, 0.17, 0.6], tolerance=1e-9)
    alone = integrate(system, start, [0.0, 0.17], tolerance=1e-9)
    assert read.steps == plain_run.steps
    assert np.array_equal(read.states[-1], plain_run.states[-1])
    np.testing.assert_allclose(read.states[1], alone.states[-1], rtol=0.0, atol=1e-8)  # ten tolerances of either


@INTERPRETED
def test_a_part_step_that_cannot_be_solved_says_so() -> None:
    """Its working space held the state: once it was taken for the reading, which came out doubled."""
    work = space(np.ones(1))
    work.z[:5], work.scale[:] = 0.1, 1.0
    views = addresses(work)
    differences((0,) * 5, (0,), views)
    for slopes, time in ((np.nan, 0.0), (0.0, 1.0)):
        work.slopes[:] = slopes
        turns = part_step(time, 0.5, 0.5, 1e-9, (0,) * 5, (0,), views, Cliff(0.5))
        assert turns == 0


@pytest.mark.compiled
def test_many_readings_meet_the_tolerance() -> None:
    """So many that part steps would cost more than short steps: the polynomial is read."""
    times = np.linspace(0.0, 5.0, 5001)
    made = integrate(plain(6.2), [1.0, 0.0], times, tolerance=1e-10)
    exact = integrate(plain(6.2), [1.0, 0.0], times, tolerance=1e-14)
    assert made.evaluations < 20_000  # part steps would take 2 x 5000 x 14 and more
    assert np.max(np.abs(made.states - exact.states)) < 1e-8


def _released(frequency: float, amplitude: float, time: float) -> float:
    """Angle of a plain pendulum released at rest: sin(theta/2) = k cd(n t, k), in 40 digits."""
    with mpmath.workdps(40):
        modulus = mpmath.sin(mpmath.mpf(amplitude) / 2)
        swing = mpmath.ellipfun("cd", mpmath.mpf(frequency) * mpmath.mpf(time), m=modulus**2)
        return float(2 * mpmath.asin(modulus * swing))


@pytest.mark.compiled
@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-11])
def test_the_tolerance_is_met_at_the_end_of_a_long_swing(tolerance: float) -> None:
    """720 swings: steps that each err by the tolerance made ten thousand times of it."""
    times = np.array([0.0, 100.0, 300.0, 730.0])
    made = integrate(plain(6.25), [1.0, 0.0], times, tolerance=tolerance)
    true = max(abs(made.states[k, 0] - _released(6.25, 1.0, times[k])) for k in range(times.size))
    assert made.estimated_error <= tolerance
    assert true <= 10.0 * made.estimated_error


@pytest.mark.compiled
def test_rounding_has_no_bias() -> None:
    """200 swings in about 4000 steps of 7 stages. Sums taken in eigenvectors gave weights off by 2e-15: 1250 rad of
    phase erred by 2.6e-12, and every march alike, so that no estimate could tell."""
    made = integrate(plain(6.25), [1.0, 0.0], [0.0, 200.0], tolerance=1e-14, stages=7)
    assert abs(made.states[-1, 0] - _released(6.25, 1.0, 200.0)) < 2e-13  # 1e-16 a step, in sqrt(4000), speed 6, twice


def test_a_tighter_march_that_fails_leaves_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """What there is holds, with the error that is estimated for it."""
    times, march = np.linspace(0.0, 10.0, 3), Problem.run

    def run(problem: Problem, tolerance: float, *rest: Any) -> Run:
        if tolerance < 9e-9:
            raise RefusedError("too short")
        return march(problem, tolerance, *rest)

    better = integrate(plain(6.2), [1.0, 0.0], times, tolerance=1e-9)
    monkeypatch.setattr(Problem, "run", run)
    monkeypatch.setattr(radau, "_USUAL", 0.1)  # the first two march at 1e-8 and 1e-7
    made = integrate(plain(6.2), [1.0, 0.0], times, tolerance=1e-9)
    assert better.estimated_error < 1e-9 < made.estimated_error
    assert np.max(np.abs(made.states - better.states)) < 60.0 * made.estimated_error  # ten times the size of the speed


def test_what_rounding_forbids_is_not_promised() -> None:
    """A tolerance that no double can meet is not refused: the estimate says what was reached."""
    made = integrate(VanDerPol(5.0), [2.0, 0.0], [0.0, 8.0], tolerance=1e-15)
    again = integrate(VanDerPol(5.0), [2.0, 0.0], [0.0, 8.0], tolerance=1e-14, stages=5)
    assert 2e-16 <= made.estimated_error < 1e-13
    apart = np.abs(made.states[-1] - again.states[-1])
    assert np.max(apart) < 20.0 * (made.estimated_error + again.estimated_error) + 1e-14  # sizes 2 and 7


@pytest.mark.parametrize(
    ("system", "start", "times"),
    [
        (plain(2.0), [0.5, 0.0], [0.0, 0.5]),
        (VanDerPol(300.0), [2.0, 50.0], [0.0, 0.01, 0.5]),  # from a start that a fast motion leaves at once
    ],
)
def test_both_orders_come_to_the_same_end(system: Any, start: list[float], times: list[float]) -> None:
    """The higher one in fewer steps; at loose tolerances the lower is taken, at tight ones the higher."""
    low, high = (integrate(system, start, times, tolerance=1e-9, stages=stages) for stages in (5, 7))
    assert low.steps > high.steps
    np.testing.assert_allclose(low.states[1:], high.states[1:], rtol=1e-7, atol=1e-8)
    for tolerance, stages in ((1e-4, 5), (1e-9, 7)):
        chosen, told = (integrate(system, start, times, tolerance=tolerance, stages=each) for each in (None, stages))
        np.testing.assert_array_equal(chosen.states, told.states)


def test_components_that_start_at_zero() -> None:
    """x' = v, v' = -u, u' = 0 from rest: x = -t^2/2, with x and v zero at first."""
    system = Linear(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [0.0, 0.0, 0.0]]))
    made = integrate(system, [0.0, 0.0, 1.0], [0.0, 2.0], tolerance=1e-10)
    np.testing.assert_allclose(made.states[-1], [-2.0, -2.0, 1.0], rtol=1e-10)


def test_a_late_clock_costs_nothing() -> None:
    """At t = 1e8 the time is rounded to 1.5e-8 in every step; what is lost is carried along."""
    turning = Linear(np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]))
    late = integrate(turning, [1.0, 0.0, 1.0], [1e8, 1e8 + 3.0], tolerance=1e-12).states[-1]
    np.testing.assert_allclose(late, [np.cos(3.0), -np.sin(3.0), 1.0], rtol=0.0, atol=1e-11)  # ten tolerances


def test_many_small_increments_add_up_exactly() -> None:
    """A drift from 1 to 1 + 1/3 beside an oscillation that enforces 200 steps: each would lose half a rounding."""
    matrix = np.zeros((3, 3))
    matrix[1, 2], matrix[2, 1] = 300.0, -300.0
    system = Linear(matrix + np.diag([np.log(4.0 / 3.0), 0.0, 0.0]))
    made = integrate(system, [1.0, 1.0, 0.0], [0.0, 1.0], tolerance=1e-13, stages=5)
    assert made.steps > 200
    assert abs(made.states[-1, 0] - 4.0 / 3.0) < 4.5e-16  # two units in the last place


def test_as_an_explicit_method_has_it() -> None:
    """Another method knows nothing of our faults. A component that starts at zero once ended Newton's iteration too
    early in the first step, at every tolerance: 1e-10 here."""
    from scipy.integrate import solve_ivp

    times = np.linspace(0.0, 20.0, 21)

    def slope(time: float, y: Floats) -> list[float]:
        return [y[1], (1.0 - y[0] * y[0]) * y[1] - y[0]]

    other = solve_ivp(slope, (0.0, 20.0), [2.0, 0.0], method="DOP853", rtol=1e-13, atol=1e-15, t_eval=times).y.T
    made = integrate(VanDerPol(1.0), [2.0, 0.0], times, tolerance=1e-13)
    assert np.max(np.abs(made.states - other)) < 1e-11  # the other's error at 1e-13 over 20 s: about 1e-12


@INTERPRETED
def test_a_reading_that_cannot_be_solved_for_ends_a_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """Once the polynomial was read instead, whose error was ten thousand tolerances on a stiff beam."""
    times = np.linspace(0.0, 2.0, 5)
    asked = integrate(VanDerPol(5.0), [2.0, 0.0], times, tolerance=1e-10)
    monkeypatch.setattr(radau_step, "part_step", lambda *_: 0)
    made = integrate(VanDerPol(5.0), [2.0, 0.0], times, tolerance=1e-10)
    assert made.rejected > asked.rejected
    np.testing.assert_allclose(made.states, asked.states, rtol=0.0, atol=1e-8)


def test_a_support_is_measured_by_the_bobs() -> None:
    """l theta and l theta' of the wider of two pendulums, the second by its speed; angles count by themselves."""
    beam = ElasticBeam(2.0, np.array([1.0, 1.0]), np.array([0.5, 2.0]), 1e8, gravity=8.0)
    least = swing_of_bobs(beam, np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.6]))
    np.testing.assert_allclose(least, [0.6, 1.2, 0.0, 0.0, 0.0, 0.0], rtol=1e-15)
    assert not swing_of_bobs(VanDerPol(1.0), np.array([2.0, 0.0])).any()
    assert not swing_of_bobs(Metronomes(np.array([6.0]), 0.1), np.array([2.0, 0.0])).any()


def test_start_alone() -> None:
    made = integrate(plain(2.0), [0.5, 0.1], [3.0], tolerance=1e-6)
    assert np.array_equal(made.states, [[0.5, 0.1]])
    assert made.steps == 0


def test_a_solution_that_explodes_is_refused() -> None:
    """Inside out, the oscillator leaves its cycle for infinity in finite time."""
    with pytest.raises(RefusedError, match=r"stopped at t = 1\.23\d* s .* below 1e-14 of the span"):
        integrate(VanDerPol(-1.0), [3.0, 0.0], [0.0, 2.0], tolerance=1e-6, stages=5)


def test_parameters_that_are_no_numbers_are_refused() -> None:
    with pytest.raises(RefusedError, match=r"stopped at t = 0 s .* not finite"):
        integrate(VanDerPol(np.nan), [2.0, 0.0], [0.0, 1.0], tolerance=1e-6)


@INTERPRETED
def test_a_system_says_itself_what_is_wrong() -> None:
    """A mass matrix of the reduced beam that is singular: no step is possible."""
    beam = ReducedBeam(0.02, 0.02, 0.2, np.array([0.0, 0.0]))
    with pytest.raises(RefusedError, match=r"stopped at t = 0 s .* the mass matrix of the reduced beam is singular"):
        integrate(beam, [0.0, 0.0, 2.0, 0.0, 1.0, 0.0], [0.0, 1.0], tolerance=1e-6)


@INTERPRETED
def test_a_derivative_that_ends_is_refused() -> None:
    with pytest.raises(RefusedError, match=r"stopped at t = 0\.5 s .* not finite"):
        integrate(Cliff(0.5), [1.0], [0.0, 1.0], tolerance=1e-6, stages=5)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"start": [np.nan, 0.0]}, "start"),
        ({"start": []}, "start"),
        ({"start": [[1.0, 0.0]]}, "start"),
        ({"times": []}, "times"),
        ({"times": [0.0, np.inf]}, "times"),
        ({"times": [0.0, 2.0, 1.0]}, "times"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"tolerance": 1.0}, "tolerance"),
        ({"tolerance": np.nan}, "tolerance"),
    ],
)
def test_arguments_that_cannot_be_meant(change: dict[str, Any], named: str) -> None:
    arguments: dict[str, Any] = {"start": [1.0, 0.0], "times": [0.0, 1.0], "tolerance": 1e-6} | change
    with pytest.raises(UsageError, match=named):
        integrate(plain(2.0), arguments["start"], arguments["times"], tolerance=arguments["tolerance"])
