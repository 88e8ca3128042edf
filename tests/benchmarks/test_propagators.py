"""The closed form and the truth in many digits agree on a few seconds."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from pipeline.benchmarks.own import CLOSED, OWN
from pipeline.benchmarks.problems import RATE, hour
from pipeline.benchmarks.truth import linear

pytest.importorskip("mpmath")
SHORT = hour(3)
ROWS = np.arange(0, 60, 7)


def test_closed_form_is_exact() -> None:
    true = linear(SHORT, [Fraction(int(row), RATE) for row in ROWS])
    found = OWN[CLOSED].make(SHORT, np.nan)().states
    assert np.abs(found[ROWS] - true).max() < 1e-14 * np.abs(true).max()


def test_truth_starts_where_the_problem_does() -> None:
    assert linear(SHORT, [Fraction(0)])[0] == pytest.approx(SHORT.start[::2], rel=1e-14)
