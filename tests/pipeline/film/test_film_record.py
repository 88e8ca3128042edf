"""From a reading to a record of the contract: angles, names, flags, what was assumed; two readings that disagree."""

from __future__ import annotations

import hashlib
from dataclasses import replace

import numpy as np
import pytest
from film_stand_ins import LEVER, PERIODS, SCALE, angles, reading

import data_schemas
from data_schemas.errors import RecordError, UsageError
from data_schemas.film_description import DescribedTrace, FilmDescription
from pipeline.film.digitise import make_record, summary
from pipeline.film.knowledge import ASSUMED_LEVER, FilmOptions, Known, film_scale, match
from pipeline.film.normal_points import PhaseDifference, clock_uncertainty
from pipeline.film.reading import clear_of_marks, close

TWO = FilmOptions(traces=("1", "1-2"), periods=PERIODS, gravity=9.81)


def described(**changes) -> FilmDescription:
    content = {
        "record_id": "night",
        "speed": 5.0,
        "mark_interval": 0.5,
        "start_time": "1959-07-01T12:00:00Z",
        "traces": [
            {"name": "1", "combination": {"1": 1.0}, "lever": 1500.0, "position": 31.0},
            {"name": "1-2", "combination": {"1": 1.0, "2": -1.0}, "lever": 2500.0, "position": 95.0},
        ],
        "pendulums": [
            {"label": "1", "period": 1.00966, "damping_rate": 1e-4},
            {"label": "2", "period": 1.009760966, "damping_rate": 2e-4},
        ],
        "instrument": {"reference_gravity": 9.81, "temperature": 290.0},
        "restoring": "linear",
    }
    return FilmDescription.model_validate({**content, **changes})


@pytest.mark.parametrize("kind", ["continuous", "strobe"])
def test_record_is_valid_and_holds_the_angles(tmp_path, kind):
    record = make_record(reading(tmp_path, kind=kind), Known(None, TWO), "night")
    assert data_schemas.check(record, "record") == []
    path = tmp_path / "night.record.nc"
    data_schemas.write(record, path)
    assert data_schemas.validate(path) == []
    time = record.dataset["time"].values
    traces = record["record"].dataset
    for k, name in enumerate(("1", "1-2")):
        true = angles(time)[name]
        wrong = traces["elongation"].values[k] - (true - true.mean())
        assert np.nanmax(np.abs(wrong - np.nanmean(wrong))) < 1e-7  # rad: a hundredth of a pixel is 4e-7
        assert abs(np.nanmean(wrong)) < 1e-5
    np.testing.assert_array_equal(traces["combination"].values, [[1, 0], [1, -1]])
    np.testing.assert_allclose(traces["elongation_uncertainty"].values[:, 10], 0.1 * SCALE / LEVER, rtol=0.6)
    assert record["film"].attrs["reading"] == kind


@pytest.mark.parametrize("kind", ["continuous", "strobe"])
def test_paper_that_wanders_by_a_pixel_leaves_no_trace(tmp_path, kind):
    """Two samples a swing do not tell a wander; the rows between them do."""
    found = reading(tmp_path, kind=kind, seconds=120.0, wander=1.0)
    record = make_record(found, Known(None, TWO), "night")
    assert "paper-wandered" in record["film"].attrs["flags"]
    time, angle = record.dataset["time"].values, record["record"]["elongation"].values
    inside = (time > 3.0) & (time < 117.0)
    for k, name in enumerate(("1", "1-2")):
        wrong = (angle[k] - angles(time)[name])[inside]
        assert np.nanstd(wrong) < 0.03 * SCALE / LEVER  # rad: of a pixel


def test_film_group_says_where_it_comes_from_and_what_was_believed(tmp_path):
    found = reading(tmp_path)
    record = make_record(found, Known(None, TWO), "night")
    film = record["film"].dataset
    assert str(film["source_file"].values) == "night.film.tif"
    assert str(film["source_sha256"].values) == hashlib.sha256(b"the image").hexdigest()
    assert float(film["speed"]) == pytest.approx(60.0 * SCALE)
    assert float(film["scale"]) == SCALE
    np.testing.assert_array_equal(film["optical_lever"].values, ASSUMED_LEVER)
    assert "lever of 2000 mm/rad is assumed" in film.attrs["assumed"]
    assert "marks every 0.5 s are assumed" in film.attrs["assumed"]
    assert film.attrs["flags"] == "marks-false"
    assert film.attrs["notes"] == "lines are light on dark film"
    row = summary(record, found)
    assert row["accepted_fraction"] == 1.0
    assert row["missing_fraction"] == {"1": 0.0, "1-2": 0.0}
    assert len(row["assumed"]) == 2


def test_description_names_levers_instrument_and_start(tmp_path):
    record = make_record(reading(tmp_path), Known(described()), "film")
    assert data_schemas.check(record, "record") == []
    assert record.attrs["record_id"] == "night"
    assert record.dataset["time"].attrs["units"] == "seconds since 1959-07-01T12:00:00Z"
    np.testing.assert_array_equal(record["film"].dataset["optical_lever"].values, [1500.0, 2500.0])
    instrument = record["instrument"]
    np.testing.assert_array_equal(instrument.dataset["damping_rate"].values, [1e-4, 2e-4])
    assert float(instrument.dataset["temperature"]) == 290.0
    assert instrument.attrs["restoring"] == "linear"
    assert record["film"].attrs["assumed"] == ""
    swing = record["record"].dataset["elongation"].values[0].std()
    assert swing == pytest.approx(angles(record.dataset["time"].values)["1"].std() * LEVER / 1500.0, rel=1e-6)


def test_bases_and_readings_travel_into_the_record(tmp_path):
    bases = [
        {"label": "before", "time": -3600.0, "gravity": 9.81, "period": {"1": 1.00966, "2": 1.00976}},
        {"label": "after", "time": 9000.0, "gravity": 9.82, "period": {"2": 1.00926, "1": 1.00916}},
    ]
    readings = [{"time": 10.0, "temperature": 290.0}, {"time": 40.0, "temperature": 293.0}]
    known = described(instrument={"reference_gravity": 9.81}, bases=bases, readings=readings)
    record = make_record(reading(tmp_path), Known(known, FilmOptions()), "x")
    assert data_schemas.check(record, "record") == []
    stored, time = record["instrument"].dataset, record.dataset["time"].values
    assert stored["base"].values.tolist() == ["before", "after"]
    assert stored["base_gravity"].values.tolist() == [9.81, 9.82]
    assert stored["base_period"].values.tolist() == [[1.00966, 1.00976], [1.00916, 1.00926]]
    np.testing.assert_allclose(stored["temperature"].values, np.clip(290.0 + 0.1 * (time - 10.0), 290.0, 293.0))


def test_options_stand_before_the_description(tmp_path):
    options = FilmOptions(lever=1800.0, periods={"2": 1.02}, gravity=9.80, mark_interval=0.5)
    record = make_record(reading(tmp_path), Known(described(), options), "film")
    np.testing.assert_array_equal(record["film"].dataset["optical_lever"].values, 1800.0)
    np.testing.assert_array_equal(record["instrument"].dataset["period"].values, [1.00966, 1.02])
    assert float(record["instrument"].dataset["reference_gravity"]) == 9.80


def test_traces_are_told_by_their_places_and_else_stand_from_the_left(tmp_path):
    swapped = described(
        traces=[
            {"name": "1", "combination": {"1": 1.0}, "lever": 2000.0, "position": 95.0},
            {"name": "1-2", "combination": {"1": 1.0, "2": -1.0}, "lever": 2000.0, "position": 31.0},
        ]
    )
    record = make_record(reading(tmp_path, swapped=True), Known(swapped), "film")
    time = record.dataset["time"].values
    for k, name in enumerate(("1", "1-2")):
        true = angles(time)[name]
        values = record["record"].dataset["elongation"].values[k]
        assert abs(np.nanmean(values)) < 1e-6
        assert np.corrcoef(values[np.isfinite(values)], true[np.isfinite(values)])[0, 1] > 0.999
    options = FilmOptions(traces=("1-2", "1"), periods=PERIODS, gravity=9.8)
    record = make_record(reading(tmp_path, swapped=True), Known(None, options), "a")
    assert [str(label) for label in record["record"].dataset["trace"].values] == ["1-2", "1"]


def trace(name: str, position: float | None = None, amplitude: float | None = None) -> DescribedTrace:
    return DescribedTrace(name=name, combination={name: 1.0}, position=position, amplitude=amplitude)


def test_matching_forgives_a_common_shift_and_uses_the_swing():
    rest, swing = np.array([52.0, 91.0, 20.0]), np.array([10.0, 8.0, 5.0])
    assert match([trace("a", 10.0), trace("b", 42.0), trace("c", 81.0)], rest, swing) == [2, 0, 1]
    assert match([trace("a"), trace("b"), trace("c")], rest, swing) == [2, 0, 1]
    close, sizes = np.array([50.0, 51.0]), np.array([3.0, 12.0])
    assert match([trace("a", 50.0, 12.0), trace("b", 51.0, 3.0)], close, sizes) == [1, 0]
    with pytest.raises(RecordError, match="2 traces were found on the film, but 1 described"):
        match([trace("a")], close, sizes)
    with pytest.raises(RecordError, match="no trace was found"):
        match([trace("a")], np.empty(0), np.empty(0))


def test_several_traces_need_periods_and_their_gravity(tmp_path):
    with pytest.raises(UsageError, match=r"pendulum 1 has no period.*--period 1=SECONDS"):
        make_record(reading(tmp_path), Known(), "night")
    with pytest.raises(UsageError, match="--gravity"):
        make_record(reading(tmp_path), Known(None, FilmOptions(traces=("1", "1-2"), periods=PERIODS)), "night")
    with pytest.raises(UsageError, match="there is no pendulum '3'"):
        make_record(reading(tmp_path), Known(None, FilmOptions(periods={"3": 1.0})), "night")
    with pytest.raises(UsageError, match="LABEL=SECONDS"):
        make_record(reading(tmp_path), Known(None, FilmOptions(periods={"": 1.0})), "night")


@pytest.mark.parametrize("text", [":1", "1:"])
def test_trace_options_are_checked(text):
    with pytest.raises(UsageError, match="NAME or NAME:COMBINATION"):
        _ = Known(None, FilmOptions(traces=(text,))).traces
    with pytest.raises(UsageError, match="twice"):
        _ = Known(None, FilmOptions(traces=("1", "1"))).traces


def test_stages_are_told_what_is_known():
    known = Known(described())
    assert known.count == 2
    assert known.marking(SCALE).speed == pytest.approx(5.0 / SCALE)
    assert Known().count is None
    assert Known().marking(None).interval == 0.5


def test_scale_comes_from_the_marks_where_the_file_is_silent(tmp_path):
    axis = reading(tmp_path).axis
    assert axis.rows_per_second == pytest.approx(60.0)
    behind = axis.row + 100.0 * (axis.index > axis.index[axis.index.size // 2])
    assert replace(axis, row=behind).rows_per_second == pytest.approx(60.0)  # the speed is not that of a jerk or stand
    assert film_scale(0.1, 5.0, axis) == (0.1, None)
    scale, note = film_scale(None, 5.08, axis)
    assert scale == pytest.approx(25.4 / 300)
    assert "300 dpi" in note
    with pytest.raises(RecordError, match="--dpi"):
        film_scale(None, None, axis)


def test_readings_that_agree_are_not_flagged_and_a_late_one_is(tmp_path):
    agree = reading(tmp_path, noise=0.2, seconds=300.0).difference
    ratio = (agree.phase / agree.sigma)[np.isfinite(agree.phase)]
    assert ratio.size == 20
    assert np.sqrt(np.mean(ratio**2)) < 1.5
    assert np.sum(np.abs(ratio) > 3.0) <= 1
    assert not agree.contradicts
    late = reading(tmp_path, noise=0.2, seconds=300.0, strobe_late=1e-3).difference
    # 1 ms of delay is 6.2 mrad of a swing of a second
    np.testing.assert_allclose(np.nanmean(late.phase), -2 * np.pi / 1.01 * 1e-3, rtol=0.1)
    assert np.mean(np.abs(late.phase) > 3.0 * late.sigma) > 0.8
    assert late.contradicts


def test_one_half_minute_of_a_hundred_beyond_three_sigma_is_chance_and_not_a_contradiction():
    honest = np.random.default_rng(3).standard_t(11, size=(2, 60))
    start, sigma = 30.0 * np.arange(60), np.full((2, 60), 2e-4)

    def contradicts(change) -> bool:
        away = honest.copy()
        change(away)
        return PhaseDifference(start, away * sigma, sigma).contradicts

    assert not contradicts(lambda away: away.__setitem__((0, 7), 3.4))
    assert contradicts(lambda away: away.__setitem__((0, 7), 12.0))  # one half minute that is wrong
    assert contradicts(lambda away: away.__setitem__((0, slice(0, 60, 8)), 3.4))  # many that are doubtful
    assert contradicts(lambda away: away.__iadd__([[0.0], [2.0]]))  # a trace that lags
    assert not PhaseDifference(start, np.full((2, 60), np.nan), sigma).contradicts


def test_honest_films_are_rarely_flagged():
    rng = np.random.default_rng(5)
    start, sigma = 30.0 * np.arange(60), np.full((2, 60), 2e-4)
    films = [PhaseDifference(start, sigma * rng.standard_t(11, size=(2, 60)), sigma) for _ in range(300)]
    assert sum(film.contradicts for film in films) <= 6


def test_a_time_axis_that_drifts_is_an_uncertainty_of_the_chronometer(tmp_path):
    found = reading(tmp_path, noise=0.2, seconds=600.0)
    steady = clock_uncertainty(found.difference, 1.01)
    assert 0.0 < steady < 2e-6
    drifting = found.difference.phase + 2 * np.pi / 1.01 * 1e-5 * found.difference.start
    drift = clock_uncertainty(found.difference._replace(phase=drifting), 1.01)
    assert drift == pytest.approx(1e-5, rel=0.2)
    record = make_record(found, Known(described(instrument={"reference_gravity": 9.81, "chronometer_rate": 2.0})), "a")
    instrument = record["instrument"].dataset
    assert float(instrument["chronometer_rate"]) == 2.0
    assert float(instrument["chronometer_rate_uncertainty"]) == pytest.approx(86400.0 * steady, rel=0.02)
    assert data_schemas.check(record, "record") == []
    at_marks = make_record(reading(tmp_path, seconds=600.0, kind="strobe"), Known(described()), "a")
    assert "chronometer_rate" not in at_marks["instrument"].dataset
    assert clock_uncertainty(reading(tmp_path, seconds=60.0).difference, 1.01) is None


def test_close_strokes_are_read_clear_of_their_gaps(tmp_path):
    made = reading(tmp_path)
    assert not close(made.tracks)
    tracks = replace(made.tracks, spot=2.0)
    assert close(tracks)
    clear = clear_of_marks(tracks, made.axis)
    row = np.arange(clear.position.shape[1]) + 0.5
    near = np.abs(row[:, None] - made.axis.row).min(axis=1) < 3.5 * 2.0
    np.testing.assert_array_equal(np.isnan(clear.position[0]), near)
    assert clear_of_marks(tracks, replace(made.axis, kind="edge")) is tracks
