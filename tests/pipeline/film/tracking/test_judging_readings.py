"""Which readings are accepted: each fault takes its row, raises its own flag and leaves the others alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from data_schemas.variables import ELONGATION_FLAGS
from pipeline.film.emulsion import Optics, ToneCurve
from pipeline.film.tracking.outcome import flag_lost, judge, openness
from pipeline.film.tracking.pieces import BOTH, FORWARD

ROWS, AT = 40, 20
OPTICS = Optics(1.2, 0.0, ToneCurve(0.6, 0.2, 1.5), np.array([5e-5, 1e-3]))
SHIFT, VARIANCE, LIGHT, LIGHT_VARIANCE, MISFIT, ALONE, SLOPE = range(7)


def judged(reading: dict[int, Any], **other: Any) -> Any:
    """Position, sigma and flags of rows that are whole but for what is said of row `AT` (or of all, by an array)."""
    table = np.tile([0.0, 0.01, 1.0, 4e-4, 1.0, 0.01, 3.0], (ROWS, 1))
    for column, value in reading.items():
        table[AT if np.isscalar(value) else slice(None), column] = value
    rows: dict[str, Any] = {
        "disagreement": np.zeros(ROWS),
        "known": np.full(ROWS, BOTH, np.uint8),
        "open": np.ones(ROWS),
        "black": np.zeros(ROWS, dtype=bool),
        "across": None,
    }
    for name, value in other.items():
        if isinstance(rows[name], np.ndarray):
            rows[name][AT] = value
        else:
            rows[name] = value
    return judge(
        table, np.full(ROWS, 120.0), np.full(ROWS, 1e-3), rows["disagreement"], rows["known"], rows["open"],
        np.ones(ROWS), rows["black"], OPTICS, rows["across"],
    )  # fmt: skip


def test_whole_rows_are_accepted_without_a_flag() -> None:
    position, sigma, qc = judged({})
    assert np.all(position == 120.0)
    assert np.all((sigma > 0.1) & (sigma < 0.12))
    assert not qc.any()


@pytest.mark.parametrize(
    ("reading", "other", "flag"),
    [
        ({SHIFT: 3.0}, {}, "outlier"),
        ({MISFIT: 10.0}, {}, "outlier"),
        ({LIGHT: 2.5}, {}, "outlier"),
        ({LIGHT: 0.3}, {}, "outlier"),
        ({VARIANCE: 9.0, ALONE: 9.0}, {}, "outlier"),
        ({VARIANCE: 9.0}, {}, "overlap"),
        ({}, {"disagreement": 9.0}, "ambiguous"),
        ({}, {"open": 0.2}, "gap"),
        ({}, {"black": True}, "saturated"),
    ],
)
def test_a_fault_takes_its_row_and_no_other(reading: dict[int, Any], other: dict[str, Any], flag: str) -> None:
    position, _, qc = judged(reading, **other)
    assert np.flatnonzero(np.isnan(position)).tolist() == [AT]
    assert qc[AT] & ELONGATION_FLAGS[flag]
    assert np.flatnonzero(qc).tolist() == [AT]


def test_rows_beside_bright_marks_across_are_left_out() -> None:
    """What shades rows of a scan leaves a trace's middle where it is; what shades time moves that of steep strokes."""
    assert np.isfinite(judged({}, open=0.9)[0]).all()
    assert np.flatnonzero(np.isnan(judged({}, open=0.9, across="bright-lines")[0])).tolist() == [AT]


def test_rows_are_strange_among_their_like() -> None:
    """Where a line turns its model may leave more than grain finer than it: no outlier where all rows do."""
    slope, misfit = np.full(ROWS, 5.0), np.ones(ROWS)
    slope[::4], misfit[::4] = 0.5, 15.0
    misfit[AT + 1] = 15.0
    position = judged({SLOPE: slope, MISFIT: misfit})[0]
    assert np.isnan(position).sum() == 1
    assert np.isfinite(position[::4]).all()


def test_what_one_direction_knows_is_read_and_flagged() -> None:
    position, _, qc = judged({}, known=FORWARD)
    assert np.isfinite(position).all()
    assert qc[AT] == ELONGATION_FLAGS["single_direction"]
    position, _, qc = judged({}, known=0)
    assert np.flatnonzero(np.isnan(position)).tolist() == [AT]
    assert not qc.any()


def test_rows_beside_a_gap_too_faint_to_be_found_are_left_out() -> None:
    """A dim row among whole ones is the grain's doing; beside another dim row the shutter may have cut it."""
    noisy = np.full(ROWS, 0.1**2)
    light = np.ones(ROWS)
    light[AT] = 0.6
    assert np.isfinite(judged({LIGHT: light, LIGHT_VARIANCE: noisy})[0]).all()
    light[AT + 1], light[AT + 2] = 0.1, 0.6
    position, _, qc = judged({LIGHT: light, LIGHT_VARIANCE: noisy})
    assert np.flatnonzero(np.isnan(position)).tolist() == [AT, AT + 1, AT + 2]
    assert np.all(qc[AT : AT + 3] == ELONGATION_FLAGS["outlier"])


def test_a_cut_row_that_calls_itself_unsure_is_not_believed() -> None:
    """Its sigma is that of a dim line; a whole one would not lie so far off."""
    dim = {VARIANCE: 1.2, ALONE: 1.2, LIGHT: 0.7, LIGHT_VARIANCE: 0.02}
    assert np.isfinite(judged({**dim, SHIFT: 0.9})[0]).all()
    assert np.isnan(judged({**dim, SHIFT: 1.5})[0][AT])


def test_a_faint_line_is_not_read_far_off_its_course() -> None:
    faint = {VARIANCE: np.full(ROWS, 1.6), ALONE: np.full(ROWS, 1.6)}
    shift = np.zeros(ROWS)
    shift[[10, 30]] = 2.7, 3.0  # 0.86 and 0.95 px across the line: both within 2.5 sigma
    assert np.flatnonzero(np.isnan(judged({**faint, SHIFT: shift})[0])).tolist() == [30]


def test_two_rows_beside_each_other_that_lie_off_are_both_left_out() -> None:
    shift = np.zeros(ROWS)
    shift[AT] = 0.8
    assert np.isfinite(judged({SHIFT: shift})[0]).all()
    shift[AT + 1] = -0.8  # drawn apart by what the shutter took from between them
    assert np.flatnonzero(np.isnan(judged({SHIFT: shift})[0])).tolist() == [AT, AT + 1]


def test_a_gap_lets_no_light_through_and_takes_its_length_in_all() -> None:
    share = openness(np.array([[19.6, 21.4]]), 0, ROWS, 1.2)
    assert np.sum(1.0 - share) == pytest.approx(1.8, abs=0.01)
    assert np.argmin(share) == AT
    wide = openness(np.array([[14.5, 26.5], [397.5, 402.5]]), 0, ROWS, 1.2)
    assert wide[AT] == pytest.approx(0.0, abs=1e-4)
    assert wide[[2, 38]] == pytest.approx(1.0, abs=1e-4)


def test_a_trace_that_is_followed_but_not_read_is_lost() -> None:
    position, course, qc = np.full(ROWS, 5.0), np.full(ROWS, 5.0), np.zeros(ROWS, np.uint16)
    position[10:30] = np.nan
    flag_lost(position, course, qc, period=20.0, some=slice(0, ROWS))
    lost = qc == ELONGATION_FLAGS["lost"]
    assert np.array_equal(lost, np.isnan(course))
    assert np.flatnonzero(lost).tolist() == list(range(16, 24))  # half a dozen rows from the nearest reading
