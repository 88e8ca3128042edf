"""Work-precision: problems are the same for everybody, points are read rightly, the suite yields its tables."""

from __future__ import annotations

import importlib.util
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipeline.benchmarks import integrators
from pipeline.benchmarks.integrators import PEERS, contenders, fastest, set_up, tolerances
from pipeline.benchmarks.problems import OWN, Problem, beam, hour, raced, stiff_beam, van_der_pol
from pipeline.benchmarks.references import reference
from pipeline.benchmarks.tables import RATIO
from synth.systems.dispatch import derivative

SHORT = {"linear": hour(2), "nonlinear": hour(2, linear=False), "beam": beam(2)}
EVERY = {**SHORT, "van der Pol": van_der_pol(), "stiff beam": stiff_beam()}
LIBRARIES = {"CVODE": "sksundae"}
INSTALLED = [name for name in PEERS if importlib.util.find_spec(LIBRARIES.get(each := name.split()[0], each))]


def point(method: str, error: float, ms: float, *, tolerance: float = 1e-9) -> dict[str, Any]:
    row = {"problem": "p", "method": method, "tolerance": tolerance, "error": error, "estimate": error}
    return row | dict.fromkeys(("ms", "ms_least", "ms_most"), ms) | {"note": ""}


@pytest.mark.skipif(importlib.util.find_spec("heyoka") is None, reason="heyoka is in the extra 'peers'")
@pytest.mark.parametrize("name", EVERY)
def test_formulas_are_the_same_equations(name: str) -> None:
    import heyoka as hy

    from pipeline.benchmarks.references import equations

    problem = EVERY[name]
    pairs = equations(problem)
    compiled = hy.cfunc([slope for _, slope in pairs], vars=[variable for variable, _ in pairs])
    state = problem.start + 0.01
    found = compiled(state, time=1.7)
    plain = np.empty(state.size)
    derivative(1.7, state, problem.system, plain)
    assert found == pytest.approx(plain, rel=1e-12, abs=1e-13)  # sums in another order


def test_quick_problems_are_shorter() -> None:
    full, quick = raced(quick=False), raced(quick=True)
    assert set(full) == set(quick) == {"linear", "nonlinear", "short beam", "beam", "van der Pol", "stiff beam"}
    assert full["linear"].times.size == 10 * quick["linear"].times.size
    assert full["van der Pol"].times.tolist() == quick["van der Pol"].times.tolist()


def test_closed_form_is_exact_by_the_reference() -> None:
    pytest.importorskip("heyoka")
    truth = reference(SHORT["linear"])
    angles, _ = set_up(SHORT["linear"], "closed form", math.nan)()
    assert truth.error(angles) <= 1e-15
    assert truth.error(angles + 1e-9) > 1e-8


def test_a_problem_without_closed_form_has_none() -> None:
    (row,) = integrators.sweep(SHORT["beam"], truth_of(SHORT["beam"]), quick=True, names=["closed form"])
    assert row["note"].startswith("refused: closed form")
    assert math.isnan(row["error"])


def truth_of(problem: Problem) -> Any:
    """A truth that every method meets."""
    return SimpleNamespace(error=lambda angles: 0.0, source="nothing")


def test_peers_that_are_absent_are_said_to_be(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(problem: Problem, tolerance: float) -> Any:
        raise ImportError

    monkeypatch.setattr(integrators, "set_up", lambda *given: absent(*given[:2]))
    found = integrators.sweep(SHORT["beam"], truth_of(SHORT["beam"]), quick=True, names=["heyoka"])
    assert [each["note"] for each in found] == ["not installed: extra 'peers'"]


@pytest.mark.compiled
@pytest.mark.parametrize("method", [name for name in INSTALLED if not PEERS[name][1]])
def test_peers_solve_the_beam(method: str) -> None:
    problem = SHORT["beam"]
    angles, _ = set_up(problem, method, 1e-9)()
    exact, _ = set_up(problem, "explicit", 1e-12)()
    assert angles.shape == (problem.times.size, 2)
    assert np.abs(angles - exact).max() < 1e-6  # two swings at 1e-9


@pytest.mark.compiled
@pytest.mark.parametrize("method", [name for name in INSTALLED if PEERS[name][1]])
def test_stiff_peers_reach_the_published_value(method: str) -> None:
    angles, _ = set_up(EVERY["van der Pol"], method, 1e-9)()
    assert angles.shape == (2, 1)
    assert angles[-1, 0] == pytest.approx(1.70616773217, abs=1e-6)


@pytest.mark.compiled
def test_the_suite_yields_its_tables(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mpmath")
    pytest.importorskip("matplotlib")
    chosen = {"nonlinear": SHORT["nonlinear"], "beam": SHORT["beam"]}
    monkeypatch.setattr(integrators, "raced", lambda *, quick: chosen)
    monkeypatch.setattr(integrators, "contenders", lambda problem: ("closed form", "Picard collocation", "explicit"))
    bars = [{"bar": "b", "value": 1.0, "limit": ">= 5", "pass": False}]
    monkeypatch.setattr(integrators, "judged", lambda found: iter(bars))
    rows = list(integrators.run(quick=True, folder=tmp_path))
    # three tolerances of the explicit one, a row for each of the others, twice
    assert [next(iter(row)) for row in rows].count("problem") == 10
    measured = [row for row in rows if row.get("method") == "explicit"]
    assert all(0.0 < row["error"] <= 10.0 * row["estimate"] for row in measured), measured
    assert rows[-1] == bars[0] | {"limit": "of the full run: >= 5", "pass": None}
    assert [path.name for path in tmp_path.iterdir()] == ["integrators.png"]
    assert rows[-1]["pass"] is None  # short problems are reported, not judged
    assert list(integrators.run(quick=False, folder=None))[-1]["pass"] is False


@pytest.mark.parametrize(("length", "calls"), [(0.1, 2), (25.0, 1)])
def test_whoever_takes_long_is_not_called_again(length: float, calls: int, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[int] = []
    monkeypatch.setattr(integrators, "timed", lambda call: (call(), length))
    monkeypatch.setattr(integrators, "set_up", lambda *given: lambda: made.append(1) or (np.zeros((41, 2)), 0.0))
    monkeypatch.setattr(integrators, "rounds", lambda calls, repeats: {name: [length] for name in calls})
    (found, *_) = integrators.sweep(SHORT["beam"], truth_of(SHORT["beam"]), quick=True, names=["heyoka"])
    assert found["ms"] == 1e3 * length
    assert len(made) == calls * len(integrators.QUICK_TOLERANCES)


def test_the_fastest_point_at_an_error() -> None:
    points = [point("m", 1e-6, 1.0), point("m", 1e-8, 100.0), point("m", 1e-7, 1000.0)]
    assert [None if (found := fastest(points, error)) is None else found["ms"] for error in (1e-7, 1e-3, 1e-9)] == [
        100.0,
        1.0,
        None,
    ]


def test_bars_compare_at_equal_or_smaller_error() -> None:
    own = [point("explicit", 1e-8, 1.0), point("explicit", 1e-12, 4.0)]
    stiff = [
        *own,
        point("CyRK RADAU", 1e-10, 20.0, tolerance=1e-6),
        point("CyRK RADAU", 1e-14, 200.0, tolerance=1e-12),
    ]
    found = dict.fromkeys(("linear", "nonlinear", "short beam", "stiff beam"), own)
    found |= {"beam": [*own, point("heyoka", 1e-10, 2.0)], "van der Pol": stiff}
    rows = list(integrators.judged(found))
    assert len({row["bar"] for row in rows}) == len(rows) == len(integrators.BARS)
    named = {row["bar"]: row for row in rows}
    assert named["van der Pol: times faster than CyRK RADAU at 1e-06"]["value"] == pytest.approx(20.0 / 4.0)
    assert named["van der Pol: times faster than CyRK RADAU at 1e-12"]["pass"] is False  # never reached
    assert named["van der Pol: times faster than CyRK RADAU at 1e-09"]["pass"] is None  # not measured
    assert named["linear at <= 1e-14: times faster than heyoka at 1e-06 of error"]["pass"] is None
    assert named["beam: times faster than heyoka at 1e-09"]["value"] == pytest.approx(2.0 / 4.0)
    assert named["beam: times faster than heyoka at 1e-09"]["unit"].startswith(RATIO)


def test_tolerances_fit_methods_and_problems() -> None:
    assert np.isnan(tolerances(SHORT["beam"], "closed form", quick=False)).all()
    assert len(tolerances(SHORT["beam"], "heyoka", quick=True)) < len(tolerances(SHORT["beam"], "heyoka", quick=False))
    assert len(tolerances(EVERY["van der Pol"], "Radau", quick=True)) > 5
    assert set(OWN) < set(contenders(SHORT["beam"]))
    assert "CyRK RADAU" not in contenders(SHORT["beam"])
    assert "CyRK RADAU" in contenders(EVERY["stiff beam"])
