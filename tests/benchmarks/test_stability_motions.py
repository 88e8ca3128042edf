"""Extreme motions: their truth, what is declared beforehand, how a cell is judged, and the cells that cost little."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from data_schemas.errors import RefusedError
from pipeline.benchmarks import stability, truth
from pipeline.benchmarks.own import CLOSED, EXPLICIT, PICARD, RADAU, Answer
from pipeline.benchmarks.problems import GRAVITY, Swell, pendulums
from pipeline.benchmarks.stability import Found, attempt, judge
from pipeline.benchmarks.stability_motions import PROPAGATORS, SUITED, Case, N, cases

pytest.importorskip("mpmath")
CASES = {case.name: case for case in cases()}


def test_cases_have_names_of_their_own_and_kinds_with_propagators() -> None:
    assert len(CASES) == len(cases())
    assert {case.problem.kind for case in cases()} == set(SUITED)
    assert {name for names in SUITED.values() for name in names} == set(PROPAGATORS)


def test_what_is_declared_is_about_propagators_and_gives_reasons() -> None:
    for case in cases():
        assert set(case.may_refuse) | set(case.bounds) <= set(SUITED[case.problem.kind])
        assert set(case.not_asked) <= set(case.may_refuse)
        assert all(len(reason) > 4 for reason in case.may_refuse.values())


@pytest.mark.parametrize("case", CASES)
def test_every_motion_must_be_solved_by_somebody(case: str) -> None:
    """But for two kinds: rounding decides, or there is no acceleration."""
    solvers = [name for name in PROPAGATORS if not CASES[case].may_decline(name)]
    assert bool(solvers) == (not CASES[case].must_refuse and case != "on the separatrix, 20 s")


CASE = replace(
    CASES["1 rad"],
    problem=replace(CASES["1 rad"].problem, count=2),
    true=lambda instants: np.array([[1.0], [0.5]]),
    bounds={},
)


def found(error: float, estimate: float) -> dict[str, Found]:
    return {RADAU: Found(Answer(np.array([[1.0, 0.0], [0.5 + error, 0.0]]), estimate))}


def test_a_cell_within_its_bound_and_ten_estimates_is_right() -> None:
    assert judge(CASE, found(9e-9, 1e-9))["pass"]


def test_a_cell_beyond_ten_estimates_is_silently_wrong_however_small() -> None:
    assert judge(CASE, found(1e-9, 9e-11))["silently_wrong"] == RADAU
    assert judge(CASE, found(np.nan, 1.0))["silently_wrong"] == RADAU
    assert judge(CASE, found(9e-14, 0.0))["pass"]  # rounding


def test_an_honest_cell_beyond_its_bound_misses_it() -> None:
    row = judge(CASE, found(1e-3, 1e-2))
    assert (row["bound_missed"], row["silently_wrong"], row["pass"]) == (RADAU, "", False)


def test_where_the_truth_is_a_limit_its_distance_is_granted() -> None:
    assert judge(replace(CASE, apart=1e-3), found(1e-3, 0.0))["pass"]


def test_only_listed_cells_may_decline_and_none_may_crash() -> None:
    refused = Found(refusal="why")
    assert judge(CASES["1 rad"], {RADAU: refused})["refused_unlisted"] == RADAU
    assert judge(CASES["1 rad"], {CLOSED: refused})["pass"]  # not made for the sine
    assert judge(CASES["3.1 rad"], {PICARD: refused})["pass"]
    row = judge(CASES["1 rad"], {CLOSED: Found(crash="TypeError: x")})
    assert row["refused_unlisted"] == CLOSED
    assert row[CLOSED].startswith("crashed")


def test_a_value_where_there_is_none_is_silently_wrong() -> None:
    case = CASES["singular mass matrix of (2)"]
    case = replace(case, problem=replace(case.problem, count=2), true=lambda instants: np.zeros((2, 1)))
    assert judge(case, {RADAU: Found(Answer(np.zeros((2, 4)), 1.0))})["silently_wrong"] == RADAU
    assert judge(case, {RADAU: Found(refusal="singular")})["pass"]


def test_faults_and_refusals_of_a_propagator_are_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(case: Case, tolerance: float) -> None:
        raise RefusedError("too stiff")

    def crash(case: Case, tolerance: float) -> None:
        raise ZeroDivisionError("x")

    monkeypatch.setattr(stability, "CALLS", {RADAU: refuse, EXPLICIT: crash})
    assert attempt(CASE, RADAU).refusal == "too stiff"
    assert attempt(CASE, EXPLICIT).crash == "ZeroDivisionError: x"
    assert attempt(CASES["1e7 s long, every 10 s"], RADAU).refusal.startswith("not asked")


@pytest.mark.parametrize("case", [case for case in CASES if CASES[case].problem.kind == "linear" and "1e7" not in case])
def test_the_closed_form_meets_every_linear_case(case: str) -> None:
    row = judge(CASES[case], {CLOSED: attempt(CASES[case], CLOSED)})
    assert row["pass"], row


@pytest.mark.parametrize("case", ["1 rad", "escapement, delta = 1", "beam 1e2 times stiffer", "overdamped, 10 /s"])
def test_the_closed_form_declines_what_it_is_not_made_for(case: str) -> None:
    assert attempt(CASES[case], CLOSED).refusal.startswith("closed form:")


def test_truth_of_the_linear_pendulum_obeys_its_equation() -> None:
    swell, step = Swell(np.array([0.5]), np.array([0.9]), np.array([0.3])), Fraction(1, 1000)
    for damping in (0.0, 0.3, N, 10.0):
        problem = pendulums("-", (0.1, 0.2), step, 41, linear=True, frequency=(N,), damping=damping, horizontal=swell)
        theta = truth.linear(problem, [step * k for k in range(41)])[:, 0]
        rate, bend = np.gradient(theta, 1e-3)[1:-1], (theta[2:] - 2.0 * theta[1:-1] + theta[:-2]) / 1e-6
        level = 0.5 * np.cos(0.9 * np.arange(1, 40) / 1000.0 + 0.3)
        left = bend + 2.0 * damping * rate + N**2 * theta[1:-1] + N**2 * level / GRAVITY
        # central differences of step 1 ms: (n h)^2/12 of n^2 theta, and gamma^4 where it is fast
        assert np.abs(left).max() < 2e-3
        assert theta[0] == pytest.approx(0.1, abs=1e-15)


def test_truth_of_the_pendulum_keeps_its_energy() -> None:
    instants = [Fraction(k, 1000) for k in range(400)]
    for theta, energy in (
        (truth.swing(N, 3.1, instants)[:, 0], -np.cos(3.1)),
        (truth.separatrix(N, instants)[:, 0], 1.0),
    ):
        rate = np.gradient(theta, 1e-3)[1:-1] / N
        # central differences: (n h)^2/6 of the rate
        assert 0.5 * rate**2 - np.cos(theta[1:-1]) == pytest.approx(np.full(398, energy), abs=1e-3)


def test_elliptic_pendulum_has_the_period_of_the_sheet() -> None:
    period = 3.34849644557 * 2.0 * np.pi / N  # T/T0 at 3.1 rad (physics sheet, 3.2), 12 digits
    assert truth.swing(N, 3.1, [Fraction(0.5 * period)])[0, 0] == pytest.approx(-3.1, abs=1e-10)


@pytest.mark.campaign  # as below
@pytest.mark.compiled
def test_the_singular_mass_matrix_is_refused_by_all() -> None:
    case = CASES["singular mass matrix of (2)"]
    row = judge(case, {name: attempt(case, name) for name in PROPAGATORS})
    assert row["pass"], row


@pytest.mark.campaign  # compiling both integrators takes 20 s
@pytest.mark.compiled
@pytest.mark.parametrize("case", [case for case in CASES if CASES[case].problem.kind == "oscillator"])
def test_escapements_soft_and_hard(case: str) -> None:
    row = judge(CASES[case], {name: attempt(CASES[case], name) for name in PROPAGATORS})
    assert row["pass"], row


@pytest.mark.campaign
@pytest.mark.compiled
def test_the_matrix_is_as_declared() -> None:
    every = cases()
    rows = [judge(case, {name: attempt(case, name) for name in PROPAGATORS}) for case in every]
    assert [row for row in rows if not row["pass"]] == []
