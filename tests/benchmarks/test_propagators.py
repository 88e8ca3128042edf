"""The closed form and its reference agree on a few seconds."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.benchmarks.linear_hour import closed_form, reference, task

pytest.importorskip("mpmath")
SHORT = task(3)
ROWS = np.arange(0, 60, 7)


def test_closed_form_is_exact() -> None:
    true = reference(SHORT, ROWS)
    assert np.abs(closed_form(SHORT)[:, ROWS] - true).max() < 1e-14 * np.abs(true).max()


def test_reference_starts_where_the_task_says() -> None:
    assert reference(SHORT, np.array([0]))[:, 0] == pytest.approx(SHORT.angle, rel=1e-14)
