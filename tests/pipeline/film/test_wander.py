"""Paper that wanders: told by the slow part of a difference's trace, and by nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.film.wander import slow_part, wander

TIME, PERIOD = np.arange(0.0, 300.0, 0.04), 1.00966
SUMS = np.array([1.0, 0.0])


def traces(paper: np.ndarray, sway: np.ndarray) -> np.ndarray:
    """Columns of one pendulum and a difference; a ship sways the first alone."""
    one = 118.0 * np.cos(2.0 * np.pi / PERIOD * TIME) * np.exp(-1e-4 * TIME)
    beat = 95.0 * np.cos(2.0 * np.pi / 1.009760966 * TIME + 0.5 * np.sin(0.002 * TIME))
    noise = np.random.default_rng(1).normal(0.0, 0.03, (2, TIME.size))
    return np.stack([300.0 + one + sway, 900.0 + beat]) + paper + noise


@pytest.mark.parametrize("period", [8.0, 20.0, 90.0])
def test_what_the_paper_does_is_taken_off(period):
    paper, sway = 12.0 * np.sin(2.0 * np.pi / period * TIME), 20.0 * np.cos(0.3 * TIME)
    found = wander(TIME, traces(paper, sway), SUMS, PERIOD)
    inside = slice(100, -100)
    left = found - (paper - paper.mean())
    assert np.std(left[inside]) < (0.25 if period == 8.0 else 0.1)


def test_a_ship_alone_is_no_wander():
    assert wander(TIME, traces(np.zeros(TIME.size), 30.0 * np.cos(0.3 * TIME)), SUMS, PERIOD) is None


def test_without_a_difference_nothing_tells():
    paper = 12.0 * np.sin(0.3 * TIME)
    assert wander(TIME, traces(paper, paper), np.array([1.0, 1.0]), PERIOD) is None


def test_gaps_and_short_records():
    column = traces(12.0 * np.sin(0.1 * TIME), np.zeros(TIME.size))[1]
    column[1000:1400] = np.nan
    assert np.isfinite(slow_part(TIME, column, PERIOD)).all()
    assert slow_part(TIME[:60], column[:60], PERIOD) is None
