"""Tables of the suite huygens: work against error, members beside libraries, pendulums on a yielding support."""

from __future__ import annotations

import importlib.util
import math

import pytest

from pipeline.benchmarks import huygens_claims, huygens_flexure, huygens_work


@pytest.mark.compiled
def test_errors_fall_with_work() -> None:
    rows = list(huygens_work.rows(quick=True))
    by_way = {way: [row["beta_error"] for row in rows if row["work"] == way] for way in ("orbit", "motion", "balance")}
    steps = by_way["orbit"]
    assert steps[0] < 1e-8
    assert steps[0] / steps[2] > 2.0**7  # eighth order, from 8 to 16 steps, less a little
    assert steps[-1] < 1e-14
    assert by_way["motion"][-1] <= by_way["motion"][0]
    assert by_way["balance"][0] < 2e-4
    slopes = {row["work"]: row["k_error"] for row in rows}
    assert slopes["paper"] > 0.05  # it lacks 1/(2 delta)
    assert slopes["corrected chain"] < 1e-3
    assert all(row["ms"] > 0.0 for row in rows)


@pytest.mark.compiled
def test_members_are_solved_by_all() -> None:
    rows = list(huygens_work.member_rows(quick=True))
    names = {"own ensemble", "scipy DOP853"} | ({"heyoka, batch"} if importlib.util.find_spec("heyoka") else set())
    assert {row["member"] for row in rows} == names
    errors = {row["member"]: row["error"] for row in rows}
    assert errors["own ensemble"] < 1e-6
    assert max(errors.values()) < 0.1  # the same motion; scipy at 1e-7 has drifted by a hundredth in 2,000 swings


@pytest.mark.parametrize(("phase", "share"), [(0.0, 1.0), (0.5 * math.pi, 0.5), (math.pi, 0.0)])
def test_formulas_of_a_yielding_support(phase: float, share: float) -> None:
    alone = huygens_flexure.MASS * 9.81 / (huygens_flexure.STIFFNESS * huygens_flexure.LENGTH)
    assert huygens_flexure.expected("sideways", phase) == pytest.approx(alone * share, rel=0.005, abs=1e-12)
    twice = alone * huygens_flexure.VERTICAL_ARC**2 * 2.0 * (share != 0.5)
    assert huygens_flexure.expected("up and down", phase) == pytest.approx(twice, rel=0.02, abs=1e-12)


@pytest.mark.compiled
def test_pendulums_on_a_yielding_support_are_slower_by_the_formula() -> None:
    rows = list(huygens_flexure.rows())
    assert len(rows) == 6
    told = huygens_claims.flexure_claims(rows)
    assert [row["pass"] for row in told] == [True, True]
    wrong = [row | {"e_by_formula": 2.0 * row["e_by_formula"]} for row in rows]
    assert [row["pass"] for row in huygens_claims.flexure_claims(wrong)] == [False, False]
    assert rows[0]["gravity_mgal"] == pytest.approx(381.0, rel=0.01)  # 2 e g
