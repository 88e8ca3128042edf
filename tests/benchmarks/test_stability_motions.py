"""Extreme motions: their truth, what is declared beforehand, how a cell is judged, and the cells that cost little."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from data_schemas.errors import RefusedError
from pipeline.benchmarks import stability_expected as expected
from pipeline.benchmarks import stability_matrix, stability_truth
from pipeline.benchmarks.plain_pendulums import Swell
from pipeline.benchmarks.stability_cases import GRAVITY, Case, N, cases
from pipeline.benchmarks.stability_matrix import Found, attempt, judge

pytest.importorskip("mpmath")
CASES = {case.name: case for case in cases()}
CLOSED, EXPLICIT, RADAU = expected.CLOSED, expected.EXPLICIT, expected.RADAU


def test_cases_have_names_of_their_own_and_kinds_with_propagators() -> None:
    assert len(CASES) == len(cases())
    assert {case.kind for case in cases()} == set(expected.SUITED)
    assert {name for names in expected.SUITED.values() for name in names} == set(expected.PROPAGATORS)


def test_what_is_declared_is_about_cells_that_are_there_and_gives_reasons() -> None:
    cells = {(case, name) for case in CASES for name in expected.PROPAGATORS}
    assert set(expected.MAY_REFUSE) <= cells
    assert set(expected.NOT_ASKED) <= set(expected.MAY_REFUSE)
    assert set(expected.BOUNDS) <= cells
    assert set(expected.MUST_REFUSE) <= set(CASES)
    reasons = [
        *expected.MAY_REFUSE.values(),
        *expected.MUST_REFUSE.values(),
    ]
    assert all(len(reason) > 4 for reason in reasons)


@pytest.mark.parametrize("case", CASES)
def test_every_motion_must_be_solved_by_somebody(case: str) -> None:
    """But for two kinds: rounding decides, or there is no acceleration."""
    solvers = [name for name in expected.PROPAGATORS if not stability_matrix.may_refuse(CASES[case], name)]
    assert bool(solvers) == (case not in (*expected.MUST_REFUSE, "on the separatrix, 20 s"))


CASE = replace(CASES["1 rad"], name="1 rad, read every 7.3 s", true=lambda: np.array([[1.0], [0.5]]), count=2)


def found(error: float, estimate: float) -> dict[str, Found]:
    return {RADAU: Found(np.array([[1.0, 0.0], [0.5 + error, 0.0]]), estimate)}


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
    assert judge(CASES["3.1 rad"], {expected.PICARD: refused})["pass"]
    row = judge(CASES["1 rad"], {CLOSED: Found(crash="TypeError: x")})
    assert row["refused_unlisted"] == CLOSED
    assert row[CLOSED].startswith("crashed")


def test_a_value_where_there_is_none_is_silently_wrong() -> None:
    case = replace(CASES["singular mass matrix of (2)"], source="-", true=lambda: np.zeros((2, 1)), count=2)
    assert judge(case, {RADAU: Found(np.zeros((2, 4)), 1.0)})["silently_wrong"] == RADAU
    assert judge(case, {RADAU: Found(refusal="singular")})["pass"]


def test_faults_and_refusals_of_a_propagator_are_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(case: Case, tolerance: float) -> None:
        raise RefusedError("too stiff")

    def crash(case: Case, tolerance: float) -> None:
        raise ZeroDivisionError("x")

    monkeypatch.setattr(stability_matrix, "CALLS", {RADAU: refuse, EXPLICIT: crash})
    assert attempt(CASE, RADAU).refusal == "too stiff"
    assert attempt(CASE, EXPLICIT).crash == "ZeroDivisionError: x"
    assert attempt(CASES["1e7 s long, every 10 s"], RADAU).refusal.startswith("not asked")


@pytest.mark.parametrize("case", [case for case in CASES if CASES[case].kind == "linear" and "1e7" not in case])
def test_the_closed_form_meets_every_linear_case(case: str) -> None:
    row = judge(CASES[case], {CLOSED: attempt(CASES[case], CLOSED)})
    assert row["pass"], row


@pytest.mark.parametrize("case", ["1 rad", "escapement, delta = 1", "beam 1e2 times stiffer", "overdamped, 10 /s"])
def test_the_closed_form_declines_what_it_is_not_made_for(case: str) -> None:
    assert attempt(CASES[case], CLOSED).refusal.startswith("closed form:")


def test_truth_of_the_linear_pendulum_obeys_its_equation() -> None:
    swell, step = Swell(np.array([0.5]), np.array([0.9]), np.array([0.3])), Fraction(1, 1000)
    for damping in (0.0, 0.3, N, 10.0):
        theta = stability_truth.linear((N,), damping, (0.1, 0.2), swell, GRAVITY, step, 41)[:, 0]
        rate, bend = np.gradient(theta, 1e-3)[1:-1], (theta[2:] - 2.0 * theta[1:-1] + theta[:-2]) / 1e-6
        level = 0.5 * np.cos(0.9 * np.arange(1, 40) / 1000.0 + 0.3)
        left = bend + 2.0 * damping * rate + N**2 * theta[1:-1] + N**2 * level / GRAVITY
        # central differences of step 1 ms: (n h)^2/12 of n^2 theta, and gamma^4 where it is fast
        assert np.abs(left).max() < 2e-3
        assert theta[0] == pytest.approx(0.1, abs=1e-15)


def test_truth_of_the_pendulum_keeps_its_energy() -> None:
    step = Fraction(1, 1000)
    for theta, energy in (
        (stability_truth.swing(N, 3.1, step, 400)[:, 0], -np.cos(3.1)),
        (stability_truth.rotation(N, 2.5 * N, step, 400)[:, 0], 0.5 * 2.5**2 - 1.0),
        (stability_truth.separatrix(N, step, 400)[:, 0], 1.0),
    ):
        rate = np.gradient(theta, 1e-3)[1:-1] / N
        # central differences: (n h)^2/6 of the rate
        assert 0.5 * rate**2 - np.cos(theta[1:-1]) == pytest.approx(np.full(398, energy), abs=1e-3)


@pytest.mark.campaign  # as below
@pytest.mark.compiled
def test_the_singular_mass_matrix_is_refused_by_all() -> None:
    case = CASES["singular mass matrix of (2)"]
    row = judge(case, {name: attempt(case, name) for name in expected.PROPAGATORS})
    assert row["pass"], row


@pytest.mark.campaign  # compiling both integrators takes 20 s
@pytest.mark.compiled
@pytest.mark.parametrize("case", [case for case in CASES if CASES[case].kind == "oscillator"])
def test_escapements_soft_and_hard(case: str) -> None:
    row = judge(CASES[case], {name: attempt(CASES[case], name) for name in expected.PROPAGATORS})
    assert row["pass"], row


@pytest.mark.campaign
@pytest.mark.compiled
def test_the_matrix_is_as_declared() -> None:
    rows = list(stability_matrix.rows())
    assert [row for row in rows if not row["pass"]] == []
