"""The minute on films that show one full minute or two: told by a single code where nothing speaks against it."""

from __future__ import annotations

import numpy as np
from mark_lists import Case, made

from pipeline.film.marks.axis import axis_of
from pipeline.film.parts import Marking, TimeAxis

UNTOLD = "marks-without-minute-code"


def axis(case: Case, code: float | None) -> tuple[TimeAxis, float]:
    """The time axis, and by how much it differs from the truth's, s, whole minutes apart."""
    truth = made(case)
    found = axis_of(truth.search(), truth.tracks, Marking(minute_code=code))
    away = float(np.nanmedian(found.seconds - truth.seconds))
    return found, away - 60.0 * round(away / 60.0)


def test_a_single_code_tells_the_minute_where_it_is_known() -> None:
    found, away = axis(Case(minutes=1.2, start=30.0), 0.125)
    assert UNTOLD not in found.flags
    assert abs(away) < 0.01


def test_a_single_code_that_is_not_known_may_be_a_false_gap() -> None:
    assert UNTOLD in axis(Case(minutes=1.2, start=30.0), None)[0].flags


def test_a_false_gap_beside_it_makes_a_single_code_doubtful() -> None:
    assert UNTOLD in axis(Case(minutes=1.2, start=30.0, spurious=1), 0.125)[0].flags


def test_a_code_behind_the_last_mark_counts() -> None:
    found, away = axis(Case(minutes=90.3 / 60.0, start=30.0), None)  # to 120.3 s: the second minute's code comes last
    assert UNTOLD not in found.flags
    assert abs(away) < 0.01
