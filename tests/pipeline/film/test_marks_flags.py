"""Marks that the search missed count where a trace was read at them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from film_stand_ins import reading

from pipeline.film.digitise import findings
from pipeline.flag_words import OF_FILM


def test_marks_are_missing_where_no_trace_shows_them(tmp_path):
    whole = reading(tmp_path, kind="strobe")
    axis, strobe = whole.axis, whole.strobe
    few = np.flatnonzero((axis.index % 4 == 0) & ((axis.index < 40) | (axis.index > 60)))
    searched = replace(whole, axis=replace(axis, index=axis.index[few], row=axis.row[few]))
    assert searched.flags == ["marks-false"]
    assert findings(searched)["marks_found"] == strobe.index.size
    blind = strobe.position.copy()
    blind[:, ~np.isin(strobe.index, searched.axis.index)] = np.nan
    unread = replace(searched, strobe=replace(strobe, position=blind))
    assert unread.flags == ["marks-false", "marks-many-missing", "marks-long-gap"]
    assert set(unread.flags) <= set(OF_FILM)
    np.testing.assert_array_equal(unread.marks, searched.axis.index)
    blind[0] = strobe.position[0]  # one trace is enough
    assert replace(searched, strobe=replace(strobe, position=blind)).flags == ["marks-false"]
