"""What a reading cannot confirm is doubtful in the record: in its times, its samples' flags, its scale."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from film_stand_ins import PERIODS, reading

from data_schemas import check
from pipeline.film.digitise import AMBIGUOUS, make_record, scale_error
from pipeline.film.knowledge import FilmOptions, Known
from pipeline.film.marks.alignment import Events
from pipeline.film.marks.counting import Count
from pipeline.film.marks.numbering import doubts, find_minutes
from pipeline.film.parts import Marking

KNOWN = Known(None, FilmOptions(traces=("1", "1-2"), periods=PERIODS, gravity=9.81))
MARKS = 601  # of half a second; a row each, a code a quarter after the mark of each full minute


def doubtful(codes: list[float], *advance: float, shown: bool = False) -> list[tuple[float, float, float]]:
    rows = np.sort(np.concatenate([np.arange(MARKS), np.array(codes) + 0.25]))
    event = np.flatnonzero(rows == np.round(rows))
    ones = np.ones(rows.size)
    events = Events(rows, 0.01 * ones, ones, ones, np.arange(rows.size)[None, :])
    count = Count(event, np.arange(MARKS), np.full(MARKS - 1, np.inf))
    return doubts(find_minutes(events, count, Marking(minute_code=0.125)), count, 0.5, np.array(advance), shown=shown)


@pytest.mark.parametrize(
    ("codes", "expected"),
    [
        ([0, 120, 240, 360], []),
        ([0, 120, 240, 301, 360, 480], []),  # a false gap between two codes that agree
        ([120, 240, 360, 483], [(360, 600, 1.5)]),  # three marks lost behind the last that agrees
        ([-2 + 0, 120, 240, 360], []),  # before the first mark
        ([5, 240, 360], [(0, 240, 2.5)]),
        ([7, 120, 240, 477], [(0, 120, 3.5), (240, 600, 1.5)]),
        ([0, 120, 240, 400], []),  # 20 s out of step: no stand is overlooked for so long
    ],
)
def test_codes_out_of_step_beyond_those_that_agree(codes: list[float], expected: list[tuple[float, float, float]]):
    assert doubtful(codes) == expected


@pytest.mark.parametrize(("late", "expected"), [(3, [(360, 600, 1.5)]), (7, [])])
def test_a_stand_of_some_swings_leaves_a_bar_where_a_trace_can_show_one(late: int, expected: list[tuple]) -> None:
    assert doubtful([120, 240, 360, 480 + late], shown=True) == expected


@pytest.mark.parametrize(("late", "expected"), [(1, []), (2, [(360, 600, 1.0)]), (3, []), (6, [(360, 600, 3.0)])])
def test_pendulums_would_show_part_of_a_swing(late: int, expected: list[tuple]) -> None:
    assert doubtful([120, 240, 360, 480 + late], 0.97 * np.pi, np.nan, 0.971 * np.pi) == expected


def test_doubtful_times_are_in_the_record(tmp_path):
    found = reading(tmp_path)
    middle = float(np.median(found.samples.time))
    known = make_record(found, KNOWN, "a")
    record = make_record(replace(found, axis=replace(found.axis, doubts=((middle, 1e9, 1.5),))), KNOWN, "a")
    assert check(record, "record") == []
    later = record.dataset["time"].values >= middle
    stated = record["record"]["time_uncertainty"].values
    np.testing.assert_allclose(stated[later], np.hypot(1.5, 1e-4))
    np.testing.assert_allclose(stated[~later], 1e-4)
    flags = record["record"]["elongation_qc"].values
    assert (flags[:, later] & AMBIGUOUS).all()
    np.testing.assert_array_equal(flags[:, ~later], known["record"]["elongation_qc"].values[:, ~later])


def test_a_doubtful_scale_is_an_uncertainty_of_all_elongations(tmp_path):
    found = reading(tmp_path)
    off = replace(found, axis=replace(found.axis, flags=("dpi-disagrees",)))
    speed = 1.05 * float(make_record(found, KNOWN, "a")["film"]["speed"])
    known = Known(None, replace(KNOWN.options, speed=speed))
    assert "scale_uncertainty" not in make_record(found, known, "a")["instrument"]
    stated = float(make_record(off, known, "a")["instrument"]["scale_uncertainty"])
    assert stated == pytest.approx(1.0 - 1.0 / 1.05, rel=1e-3)


def test_paper_that_stood_is_not_another_speed(tmp_path):
    found = reading(tmp_path)
    rows, index = found.axis.row, found.axis.index.copy()
    index[index.size // 2 :] += index.size // 10  # a tenth of the time
    stood = replace(found, axis=replace(found.axis, index=index, flags=("dpi-disagrees",)))
    speed = float(np.median(np.diff(rows))) / found.axis.interval * found.scale
    assert scale_error(stood, speed) == pytest.approx(0.0, abs=1e-9)
    assert scale_error(stood, 1.05 * speed) == pytest.approx(1.0 - 1.0 / 1.05)
