"""What is exposed: records with gaps, records too coarse, scenes without their recording's defects."""

from __future__ import annotations

import numpy as np
import pytest
from made_films import record_from, record_of, swing

import data_schemas
from data_schemas.errors import RecordError
from synth import scene_path, simulate
from synth.film.layout import dark_stretches
from synth.film.source import Curves, source_of


def test_the_curve_between_samples():
    """Degree 5 at 25 samples a period: 2 (1/25)^6 = 8e-9 of the swing away from the ends."""
    course = Curves(source_of(record_of(swing(0.01), seconds=400.0, rate=25.0)), 1 / 128)
    for first in (5.0, 150.0, 350.0):
        time = np.linspace(first, first + 30, 1000)
        value, rate = course.at(time)
        np.testing.assert_allclose(value[0], swing(0.01)(time), atol=2e-10)
        np.testing.assert_allclose(rate[0], -0.02 * np.pi * np.sin(2 * np.pi * time + 0.3), atol=2e-8)


def test_uneven_samples():
    chance = np.random.default_rng(2)
    time = np.sort(np.unique(np.cumsum(chance.uniform(0.01, 0.05, 2000))))
    record = record_from(time, swing(0.01)(time)[None])
    inside = np.linspace(time[50], time[-50], 3000)
    value, _ = Curves(source_of(record), 1 / 128).at(inside)
    np.testing.assert_allclose(value[0], swing(0.01)(inside), atol=1e-8)


def test_stretches_without_samples_are_dark_in_their_trace_alone():
    record = record_of(swing(), swing(), seconds=8.0)
    elongation = record["record/elongation"].values
    elongation[0, 100:160] = np.nan
    elongation[1, :10] = np.nan
    elongation[1, -1] = np.nan
    elongation[1, 300] = np.nan
    dark = dark_stretches(source_of(record))
    assert [tuple(np.round(pair, 9)) for pair in dark[0]] == [(1.98, 3.2)]
    assert [tuple(np.round(pair, 9)) for pair in dark[1]] == [(0.0, 0.2), (5.98, 6.02), (7.98, 8.0)]


def test_a_long_pause_between_samples_is_dark():
    time = np.concatenate([np.arange(0, 3, 0.02), np.arange(4, 8, 0.02)])
    dark = dark_stretches(source_of(record_from(time, swing()(time)[None])))
    assert [tuple(np.round(pair, 9)) for pair in dark[0]] == [(2.98, 4.0)]


def test_marks_alone_cannot_be_drawn():
    record = record_of(swing(), seconds=60.0, rate=2.0)
    with pytest.raises(
        RecordError, match=r"samples 0.5 s apart are too few to draw a swing of 1.01 s .*sampling_rate = 8"
    ):
        source_of(record)


def test_a_record_without_periods_is_judged_by_its_swing():
    record = record_of(swing(period=0.7), seconds=60.0, rate=10.0)
    del record["instrument"]
    with pytest.raises(RecordError, match="a swing of 0"):
        source_of(record)
    fine = record_of(swing(period=0.7), seconds=60.0, rate=20.0)
    del fine["instrument"]
    assert source_of(fine).instrument == {}


def test_a_bad_record_is_refused():
    record = record_of(swing())
    record["record/combination"][:] = 0.0
    with pytest.raises(RecordError, match="row of trace '1' is all zero"):
        source_of(record)


def test_a_scene_is_exposed_without_the_defects_of_its_recording():
    scene = data_schemas.load_scene(scene_path("ship")).model_copy(update={"duration": 30.0})
    source = source_of(scene)
    clean = scene.recording.model_copy(update={"noise": 0.0, "mark_gap": 0.0, "outliers": 0, "outlier_amplitude": 0.0})
    record, _ = simulate(scene.model_copy(update={"recording": clean}))
    value, _ = Curves(source, 1 / 128).at(record["time"].values)
    np.testing.assert_allclose(value, record["record/elongation"].values, atol=1e-12)
    assert not any(each.size for each in dark_stretches(source))
    assert source.traces == ("1", "1-2", "2-3")


def test_the_traces_are_those_the_scene_names(make_scene):
    named = make_scene(recording={"traces": [{"name": "sum", "combination": {"1": 1.0, "2": 1.0}}]})
    source = source_of(named)
    assert source.traces == ("sum",)
    assert source.combination.tolist() == [[1.0, 1.0]]
