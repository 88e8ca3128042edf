"""Marks that the search missed count where a trace was read at them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from film_stand_ins import reading

from pipeline.film.marks.checks import marks_flags, marks_seen
from pipeline.film.record import findings
from pipeline.flag_words import OF_FILM


def test_marks_are_missing_where_no_trace_shows_them(tmp_path):
    found = reading(tmp_path, kind="strobe")
    axis, strobe = found.axis, found.strobe
    few = np.flatnonzero((axis.index % 4 == 0) & ((axis.index < 40) | (axis.index > 60)))
    axis = replace(axis, index=axis.index[few], row=axis.row[few])
    assert marks_flags(axis, strobe) == ("marks-false",)
    assert findings(replace(found, axis=axis))["marks_found"] == strobe.index.size
    blind = strobe.position.copy()
    blind[:, ~np.isin(strobe.index, axis.index)] = np.nan
    unread = replace(strobe, position=blind)
    assert marks_flags(axis, unread) == ("marks-false", "marks-many-missing", "marks-long-gap")
    assert set(marks_flags(axis, unread)) <= set(OF_FILM)
    np.testing.assert_array_equal(marks_seen(axis, unread), axis.index)
    blind[0] = found.strobe.position[0]  # one trace is enough
    assert marks_flags(axis, replace(strobe, position=blind)) == ("marks-false",)
