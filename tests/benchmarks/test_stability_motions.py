"""Extreme motions: their truth, what is declared beforehand, how a cell is judged, and the cells that cost little."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from data_schemas.errors import RefusedError
from data_schemas.scene import Scene
from pipeline.benchmarks import references, stability
from pipeline.benchmarks.problems import GRAVITY, Swell
from pipeline.benchmarks.stability import PROPAGATORS, Found, N, attempt, judge, motions

pytest.importorskip("mpmath")
MOTIONS = {motion.name: motion for motion in motions()}


def test_motions_are_scenes_with_names_of_their_own() -> None:
    assert len(MOTIONS) == len(motions())
    for motion in motions():
        scene = Scene.model_validate(motion.scene)
        assert scene.recording.step == motion.step
        assert set(motion.solvers) | set(motion.not_asked) | set(motion.bounds) <= set(PROPAGATORS)
        assert not set(motion.solvers) & set(motion.not_asked)


@pytest.mark.parametrize("motion", MOTIONS)
def test_every_motion_must_be_solved_by_somebody(motion: str) -> None:
    """But for one: rounding decides."""
    assert bool(MOTIONS[motion].solvers) == (motion != "on the separatrix, 20 s")


MOTION = replace(MOTIONS["1 rad"], count=2, true=lambda instants: np.array([[1.0], [0.5]]), bounds={})


def found(error: float, estimate: float) -> dict[str, Found]:
    return {"radau": Found(np.array([[1.0], [0.5 + error]]), estimate)}


def test_a_cell_within_its_bound_and_ten_estimates_is_right() -> None:
    assert judge(MOTION, found(9e-9, 1e-9))["pass"]


def test_a_cell_beyond_ten_estimates_is_silently_wrong_however_small() -> None:
    assert judge(MOTION, found(1e-9, 9e-11))["silently_wrong"] == "radau"
    assert judge(MOTION, found(np.nan, 1.0))["silently_wrong"] == "radau"
    assert judge(MOTION, found(9e-14, 0.0))["pass"]  # rounding


def test_an_honest_cell_beyond_its_bound_misses_it() -> None:
    row = judge(MOTION, found(1e-3, 1e-2))
    assert (row["bound_missed"], row["silently_wrong"], row["pass"]) == ("radau", "", False)


def test_where_the_truth_is_a_limit_its_distance_is_granted() -> None:
    assert judge(replace(MOTION, apart=1e-3), found(1e-3, 0.0))["pass"]


def test_only_listed_cells_may_decline_and_none_may_crash() -> None:
    refused = Found(why="refused: why")
    assert judge(MOTIONS["1 rad"], {"radau": refused})["refused_unlisted"] == "radau"
    assert judge(MOTIONS["1 rad"], {"closed-form": refused})["pass"]  # not made for the sine
    assert judge(MOTIONS["3.1 rad"], {"picard": refused})["pass"]
    row = judge(MOTIONS["1 rad"], {"closed-form": Found(why="crashed: TypeError: x")})
    assert row["refused_unlisted"] == "closed-form"
    assert row["closed-form"].startswith("crashed")


def test_faults_and_refusals_of_a_propagator_are_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    def answer(scene: Scene) -> None:
        raise RefusedError("too stiff") if scene.simulation.propagator == "radau" else ZeroDivisionError("x")

    monkeypatch.setattr(stability, "simulate", answer)
    assert attempt(MOTION, "radau").why == "refused: too stiff"
    assert attempt(MOTION, "explicit").why == "crashed: ZeroDivisionError: x"
    assert attempt(MOTIONS["1e7 s long, every 10 s"], "radau").why.startswith("refused: not asked")


@pytest.mark.parametrize(
    "motion", [name for name in MOTIONS if "closed-form" in MOTIONS[name].solvers and "1e7" not in name]
)
def test_the_closed_form_meets_every_linear_motion(motion: str) -> None:
    row = judge(MOTIONS[motion], {"closed-form": attempt(MOTIONS[motion], "closed-form")})
    assert row["pass"], row


@pytest.mark.parametrize("motion", ["1 rad", "beam 1e2 times stiffer", "overdamped, 10 /s"])
def test_the_closed_form_declines_what_it_is_not_made_for(motion: str) -> None:
    assert "closed-form" in attempt(MOTIONS[motion], "closed-form").why


def test_truth_of_the_linear_pendulum_obeys_its_equation() -> None:
    swell = Swell(np.array([0.5]), np.array([0.9]), np.array([0.3]))
    for damping in (0.0, 0.3, N, 10.0):
        instants = [Fraction(k, 1000) for k in range(41)]
        theta = references.linear((N,), (damping,), (0.1, 0.2), swell, instants)[:, 0]
        rate, bend = np.gradient(theta, 1e-3)[1:-1], (theta[2:] - 2.0 * theta[1:-1] + theta[:-2]) / 1e-6
        level = 0.5 * np.cos(0.9 * np.arange(1, 40) / 1000.0 + 0.3)
        left = bend + 2.0 * damping * rate + N**2 * theta[1:-1] + N**2 * level / GRAVITY
        # central differences of step 1 ms: (n h)^2/12 of n^2 theta, and gamma^4 where it is fast
        assert np.abs(left).max() < 2e-3
        assert theta[0] == pytest.approx(0.1, abs=1e-15)


def test_truth_of_the_pendulum_keeps_its_energy() -> None:
    instants = [Fraction(k, 1000) for k in range(400)]
    for theta, energy in (
        (references.swing(N, 3.1, instants)[:, 0], -np.cos(3.1)),
        (references.separatrix(N, instants)[:, 0], 1.0),
    ):
        rate = np.gradient(theta, 1e-3)[1:-1] / N
        # central differences: (n h)^2/6 of the rate
        assert 0.5 * rate**2 - np.cos(theta[1:-1]) == pytest.approx(np.full(398, energy), abs=1e-3)


def test_elliptic_pendulum_has_the_period_of_the_sheet() -> None:
    period = 3.34849644557 * 2.0 * np.pi / N  # T/T0 at 3.1 rad (physics sheet, 3.2), 12 digits
    assert references.swing(N, 3.1, [Fraction(0.5 * period)])[0, 0] == pytest.approx(-3.1, abs=1e-10)


@pytest.mark.campaign  # minutes, most of them compiling
@pytest.mark.compiled
def test_the_table_is_as_declared() -> None:
    rows = [judge(motion, {name: attempt(motion, name) for name in PROPAGATORS}) for motion in motions()]
    assert [row for row in rows if not row["pass"]] == []
