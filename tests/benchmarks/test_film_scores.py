"""The judge of film readings: perfect readings score perfectly, each fault shows in its own score."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.benchmarks.film_scores import Truth, crossings, marks, order, places, timing

ROWS = np.arange(6000) + 0.5
PERIOD = 1.0
TIME = (ROWS - 50.0) / 59.0


def truth(apart: float = 300.0) -> Truth:
    def line(middle: float, start: float) -> np.ndarray:
        return middle + 118.0 * np.cos(2 * np.pi * TIME / PERIOD + start)

    column = np.array([line(400.0, 0.3), line(400.0 + apart, 1.4)])
    slope = np.gradient(column, axis=1)
    time = np.array([TIME, TIME])
    column[:, :50] = slope[:, :50] = time[:, :50] = np.nan
    mark = np.arange(0.0, TIME[-1] - 1.0, 0.5)
    return Truth(column, slope, time, TIME, mark)


def test_a_perfect_reading() -> None:
    true = truth()
    found = places(true.column.copy(), None, true)
    assert found["normal_px"] == 0.0
    assert found["accepted"] == 1.0
    assert found["wrong_unflagged"] == 0.0
    assert abs(found["amplitude_bias"]) < 1e-12
    assert (found["crossings"], found["swaps"]) == (0, 0)


def test_errors_are_normal_to_the_line() -> None:
    true = truth()
    shifted = true.column + 0.3 * np.hypot(1.0, true.slope)
    assert places(shifted, None, true)["normal_px"] == pytest.approx(0.3)


def test_amplitude_bias_rows_read_and_silent_errors() -> None:
    true = truth()
    wide = 400.0 + 1.002 * (true.column - 400.0)
    assert places(wide, None, true)["amplitude_bias"] == pytest.approx(0.002)
    wild = true.column.copy()
    wild[0, 1000:1100] += 1000.0
    wild[1, 2000:3000] = np.nan
    flagged = np.zeros(wild.shape, bool)
    lit = 2 * 5950
    assert places(wild, flagged, true)["wrong_unflagged"] == pytest.approx(100 / lit)
    flagged[0, 1000:1100] = True
    assert places(wild, flagged, true)["wrong_unflagged"] == 0.0
    assert places(wild, flagged, true)["accepted"] == pytest.approx(1 - 1000 / lit)


def test_swaps_are_counted_where_they_stay() -> None:
    true = truth(apart=0.0)
    crossed, swapped = crossings(true.column, true.column)
    assert crossed == pytest.approx(2 * (TIME[-1] - 0.0) / PERIOD, abs=1)
    assert swapped == 0
    turns = np.flatnonzero(np.diff(np.signbit(true.column[0] - true.column[1]))) + 1
    once = true.column.copy()
    once[:, turns[7] : turns[9]] = once[::-1, turns[7] : turns[9]]
    assert crossings(once, true.column) == (crossed, 2)
    assert places(once, None, true)["swaps"] == 2


def test_names_follow_what_is_read() -> None:
    true = truth(apart=0.0)
    assert order(true.column, true) == [0, 1]
    assert order(true.column[::-1], true) == [1, 0]


def test_time_that_shifts_and_time_that_slips() -> None:
    true = truth()
    assert timing(TIME + 1.0 + 1e-4, true, 0.5) == pytest.approx((1.0, 1e-4, 1e-4))
    slipped = TIME + np.where(TIME > 60.0, 0.5, 0.0)
    shift, _, worst = timing(slipped, true, 0.5)
    assert shift == 0.0
    assert worst == pytest.approx(0.5)
    assert np.isnan(timing(np.full(TIME.size, np.nan), true, 0.5)[0])


def test_marks_are_compared_on_their_traces() -> None:
    true = truth()
    index = np.arange(4, 20)
    rows = np.array([50.0 + 59.0 * 0.5 * index] * 2)
    rows[0, 3] = np.nan
    assert marks(index, rows, 0.0, 0.5, true) == pytest.approx(0.0, abs=1e-9)
    assert marks(index + 2, rows + 0.2, 1.0, 0.5, true) == pytest.approx(0.2)
