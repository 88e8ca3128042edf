"""The closed form and the truth in many digits agree on a few seconds."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from pipeline.benchmarks.problems import CLOSED, OWN, RATE, Problem, hour
from pipeline.benchmarks.references import linear

pytest.importorskip("mpmath")
SHORT = hour(3)
ROWS = np.arange(0, 60, 7)


def true(problem: Problem, instants: list[Fraction]) -> np.ndarray:
    system = problem.system
    return linear(
        system.natural_frequency, system.terms.damping_rate, problem.start.tolist(), problem.horizontal, instants
    )


def test_closed_form_is_exact() -> None:
    exact = true(SHORT, [Fraction(int(row), RATE) for row in ROWS])
    found, _ = OWN[CLOSED](SHORT, np.nan)()
    assert np.abs(found[ROWS] - exact).max() < 1e-14 * np.abs(exact).max()


def test_truth_starts_where_the_problem_does() -> None:
    assert true(SHORT, [Fraction(0)])[0] == pytest.approx(SHORT.start[::2], rel=1e-14)
