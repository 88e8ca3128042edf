"""Paper that moves: told by what is common to all traces and cannot be the ship's."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.film.wander import events, exchanged, paper_motion, slow_part

TIME, PERIOD = np.arange(0.0, 300.0, 0.08), 1.00966
SUMS = np.array([1.0, 0.0])
STILL = np.zeros(TIME.size)


def traces(paper: np.ndarray, sway: np.ndarray = STILL) -> np.ndarray:
    """Columns of one pendulum and a difference; a ship sways the first alone."""
    one = 118.0 * np.cos(2.0 * np.pi / PERIOD * TIME) * np.exp(-1e-4 * TIME)
    beat = 95.0 * np.cos(2.0 * np.pi / 1.009760966 * TIME + 0.5 * np.sin(0.002 * TIME))
    noise = np.random.default_rng(1).normal(0.0, 0.03, (2, TIME.size))
    return np.stack([300.0 + one + sway, 900.0 + beat]) + paper + noise


@pytest.mark.parametrize("period", [8.0, 20.0, 90.0])
def test_slow_wander_is_taken_off(period: float) -> None:
    paper, sway = 12.0 * np.sin(2.0 * np.pi / period * TIME), 20.0 * np.cos(0.3 * TIME)
    found = paper_motion(TIME, TIME, traces(paper, sway), SUMS, PERIOD)
    assert found is not None
    inside = slice(50, -50)
    left = found.shift - (paper - paper.mean())
    assert np.std(left[inside]) < (0.25 if period == 8.0 else 0.1)
    assert not found.creased.any()


def test_a_film_that_lies_askew_is_straight_to_its_ends() -> None:
    paper = 1.5 * TIME
    found = paper_motion(TIME, TIME, traces(paper), SUMS, PERIOD)
    assert found is not None
    np.testing.assert_allclose(found.shift, paper - paper.mean(), atol=0.1)


@pytest.mark.parametrize("every", [1, 6])
def test_an_inexact_period_leaves_an_even_drift_even(every: int) -> None:
    """Six: samples at the marks alone."""
    paper = 0.3 * TIME
    found = paper_motion(TIME[::every], TIME[::every], traces(paper)[:, ::every], SUMS, 1.03 * PERIOD)
    assert found is not None
    np.testing.assert_allclose(found.shift, (paper - paper[::every].mean())[::every], atol=0.4)


def test_a_swing_that_is_read_once_is_no_drift() -> None:
    """By marks a second apart it seems to swing in 104 s."""
    time = np.arange(0.0, 150.0)
    beat = 95.0 * np.cos(2.0 * np.pi / 1.009760966 * time + 0.3)
    assert paper_motion(time, time, np.stack([300.0 + beat, 900.0 + beat]), SUMS, 1.01 * PERIOD) is None


def test_a_turned_film_runs_aside_by_rows() -> None:
    row = 47.0 * TIME * (1.0 + 1e-4 * TIME)  # the paper speeds up
    paper = 0.01 * row
    found = paper_motion(TIME, row, traces(paper), SUMS, PERIOD)
    assert found is not None
    np.testing.assert_allclose(found.shift, paper - paper.mean(), atol=0.02)


def test_steps_are_taken_off() -> None:
    """Also two within two swings, and beside a swell."""
    at, sizes = np.array([60.3, 152.0, 153.7, 240.51]), np.array([3.0, -1.2, 2.0, -4.0])
    paper = (sizes[:, None] * (at[:, None] <= TIME)).sum(axis=0)
    found = paper_motion(TIME, TIME, traces(paper, 8.0 * np.cos(0.6 * TIME)), SUMS, PERIOD)
    assert found is not None
    assert (len(found.steps), found.creases) == (4, 0)
    left = (found.shift - paper)[~found.creased]
    assert np.std(left) < 0.1
    assert found.creased.sum() < 20


@pytest.mark.parametrize("length", [0.25, 0.5, 0.8])
def test_creases_are_left_out(length: float) -> None:
    paper = 4.0 * np.exp(-np.abs(TIME - 80.03) / length) - 3.0 * np.exp(-np.abs(TIME - 200.7) / length)
    found = paper_motion(TIME, TIME, traces(paper, 5.0 * np.cos(0.6 * TIME)), SUMS, PERIOD)
    assert found is not None
    assert found.creases >= 2
    assert np.abs(paper[~found.creased]).max() < 0.6
    assert found.creased.sum() < 150


def test_what_one_trace_does_alone_is_not_the_paper() -> None:
    column = traces(STILL)
    column[1, TIME > 150.0] += 3.0
    column[0, np.abs(TIME - 60.0) < 0.3] -= 4.0
    assert paper_motion(TIME, TIME, column, SUMS, PERIOD) is None


def test_a_ship_alone_is_no_wander() -> None:
    assert paper_motion(TIME, TIME, traces(STILL, 30.0 * np.cos(0.3 * TIME)), SUMS, PERIOD) is None


def test_white_noise_has_no_events() -> None:
    assert events(TIME, traces(STILL), 1, PERIOD) == []


def test_without_a_difference_nothing_tells() -> None:
    paper = 12.0 * np.sin(0.3 * TIME)
    assert paper_motion(TIME, TIME, traces(paper, paper), np.array([1.0, 1.0]), PERIOD) is None


def test_gaps_and_short_records() -> None:
    column = traces(12.0 * np.sin(0.1 * TIME))[1]
    column[500:700] = np.nan
    part = slow_part(TIME, column, PERIOD)
    assert part is not None
    assert np.isfinite(part).all()
    assert slow_part(TIME[:30], column[:30], PERIOD) is None


def test_a_difference_that_sways_alone_is_exchanged() -> None:
    """As on a film that lies upside down; paper moves all traces, a ship the pendulums."""
    sway, paper = 20.0 * np.cos(0.3 * TIME), 12.0 * np.sin(0.7 * TIME)
    swayed = traces(STILL, sway)
    assert exchanged(TIME, swayed[::-1], SUMS, PERIOD)
    assert exchanged(TIME, swayed[::-1] + 0.5 * TIME, SUMS, PERIOD)  # on a film that lies askew
    assert paper_motion(TIME, TIME, swayed[::-1], SUMS, PERIOD) is None
    assert not exchanged(TIME, swayed, SUMS, PERIOD)
    assert not exchanged(TIME, traces(paper, sway), SUMS, PERIOD)
