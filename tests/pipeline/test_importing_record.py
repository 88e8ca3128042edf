"""Tables become records: units, labels, combinations, times, and refusals with their remedy."""

from __future__ import annotations

import numpy as np
import pytest

from data_schemas import check
from data_schemas.errors import RecordError, UsageError
from pipeline.importing.record import ImportOptions, import_csv

PERIODS = {"1": 1.0099, "2": 1.01}


@pytest.fixture
def write(tmp_path):
    def write(text, name="swing.csv"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_with_no_options_the_first_column_is_time_and_the_other_an_angle_in_rad(write):
    record = import_csv(write("time, angle\n33.692, 0.5\n33.702, \n33.713, 0.25\n"))
    assert check(record, "record") == []
    assert "instrument" not in record.children
    assert record["record"]["trace"].values.tolist() == ["1"]
    assert record["record"]["combination"].values.tolist() == [[1.0]]
    # 33.692 s has an ulp of 7e-15: the difference of two such times is exact to that
    np.testing.assert_allclose(record["time"].values, [0.0, 0.010, 0.021], atol=1.5e-14)
    np.testing.assert_array_equal(record["record"]["elongation"].values, [[0.5, np.nan, 0.25]])
    assert record.attrs["record_id"] == "swing"
    assert "33.692 s" in record.attrs["source"]
    assert record["record"]["elongation"].attrs["units"] == "rad"


@pytest.mark.parametrize(
    ("unit", "lever", "factor"),
    [("rad", None, 1.0), ("deg", None, np.pi / 180.0), ("mm", 2000.0, 1.0 / 2000.0)],
)
def test_units_become_radians(write, unit, lever, factor):
    record = import_csv(write("0,3\n1,-4\n"), ImportOptions(unit=unit, lever=lever))
    np.testing.assert_allclose(record["record"]["elongation"].values[0], [3 * factor, -4 * factor], rtol=1e-15)
    assert check(record, "record") == []
    assert ("film" in record.children) == (lever is not None)
    if lever is not None:
        assert record["film"]["optical_lever"].values.tolist() == [lever]


def test_headers_that_read_like_traces_say_their_combination(write):
    options = ImportOptions(periods=PERIODS, gravity=9.81)
    record = import_csv(write("t,1,1-2\n0,1,2\n1,3,4\n"), options)
    assert check(record, "record") == []
    assert record["record"]["trace"].values.tolist() == ["1", "1-2"]
    assert record["record"]["pendulum"].values.tolist() == ["1", "2"]
    assert record["record"]["combination"].values.tolist() == [[1.0, 0.0], [1.0, -1.0]]
    assert record["instrument"]["period"].values.tolist() == [1.0099, 1.01]
    assert float(record["instrument"]["reference_gravity"]) == 9.81


def test_columns_can_be_chosen_named_and_combined(write):
    text = "lower;clock;upper\n5;0,0;7\n6;0,5;8\n"
    options = ImportOptions(
        time="clock",
        columns=("3:film", "lower:1"),
        combinations={"film": "1-2"},
        periods=PERIODS,
        gravity=9.81,
    )
    record = import_csv(write(text), options)
    assert record["time"].values.tolist() == [0.0, 0.5]
    assert record["record"]["trace"].values.tolist() == ["film", "1"]
    assert record["record"]["elongation"].values.tolist() == [[7.0, 8.0], [5.0, 6.0]]
    assert record["record"]["combination"].values.tolist() == [[1.0, -1.0], [1.0, 0.0]]


def test_three_pendulums_are_ordered_as_numbers(write):
    options = ImportOptions(columns=("2:10", "3:2-10", "4:1-2"), periods={"1": 1.0, "2": 1.1, "10": 1.2}, gravity=9.81)
    record = import_csv(write("0,1,2,3\n1,4,5,6\n"), options)
    assert record["record"]["pendulum"].values.tolist() == ["1", "2", "10"]
    assert record["record"]["combination"].values.tolist() == [[0, 0, 1], [0, 1, -1], [1, -1, 0]]


def test_a_column_whose_name_holds_a_colon_is_found(write):
    record = import_csv(write("t,a:b\n0,1\n1,2\n"), ImportOptions(columns=("a:b",)))
    assert record["record"]["trace"].values.tolist() == ["1"]


def test_dates_become_seconds_and_keep_their_start(write):
    text = "2024-05-01T12:00:00.25+02:00,1\n2024-05-01T10:00:00.75Z,2\n2024-05-02T10:00:00.25Z,3\n"
    record = import_csv(write(text))
    assert record["time"].values.tolist() == [0.0, 0.5, 86400.0]
    assert record["time"].attrs["units"] == "seconds since 2024-05-01T10:00:00.250000Z"
    assert check(record, "record") == []


def test_large_clock_times_lose_no_digits(write):
    # as float64 the times near 1.7e9 s are 2.4e-7 s coarse; the record must keep the 0.1 us that were written
    record = import_csv(write("1714557600.0000001,1\n1714557600.0400003,2\n1714557600.0800007,3\n"))
    np.testing.assert_allclose(record["time"].values, [0.0, 0.0400002, 0.0800006], rtol=1e-15, atol=1e-18)


def test_times_need_not_be_uniform(write):
    record = import_csv(write("0,1\n0.04,2\n0.13,3\n"))
    assert record["time"].values.tolist() == [0.0, 0.04, 0.13]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("0,1\n1,2\n1,3\n", ["swing.csv", "line 3", "repeats", "line 2", "sort the rows"]),
        ("t,a\n0,1\n2,2\n1,3\n", ["line 4", "goes back", "line 3"]),
        ("0,1\n,2\n", ["line 2", "time is missing", "remove the row"]),
        ("0,1\n", ["1 sample", "at least two"]),
        ("t,a\n", ["0 sample"]),
        ("0\n1\n", ["single column"]),
        ("t,a\n0,\n1,nan\n", ["column 'a'", "holds no value", "--column"]),
        ("0,inf\n1,2\n", ["line 1", "finite"]),
        ("2024-05-01T00:00:00,1\nnoon,2\n", ["line 2", "no ISO date"]),
    ],
    ids=[
        "repeated",
        "decreasing",
        "no time",
        "one sample",
        "no sample",
        "one column",
        "all missing",
        "infinite",
        "date",
    ],
)
def test_tables_that_cannot_be_a_record_are_refused(write, text, words):
    with pytest.raises(RecordError) as caught:
        import_csv(write(text))
    assert all(word in str(caught.value) for word in words), str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"unit": "mm"}, ["--lever"]),
        ({"lever": 2000.0}, ["--unit mm"]),
        ({"time": "clock"}, ["'clock'", "t, 1, 1-2"]),
        ({"time": "9"}, ["'9'", "1 to 3"]),
        ({"columns": ("t:1",)}, ["is the time"]),
        ({"columns": ("1:",)}, ["label must follow"]),
        ({"columns": ("2:a", "3:a")}, ["two columns become trace 'a'"]),
        ({"columns": ("2:1-1",)}, ["trace '1-1'", "no combination"]),
        ({"columns": ("2:1", "3:x"), "combinations": {"x": "1"}}, ["repeat each other"]),
        ({"combinations": {"film": "1-2"}}, ["no trace 'film'"]),
        ({}, ["pendulum 1 has no period", "--period 1=SECONDS"]),
        ({"periods": {"1": 1.0}}, ["pendulum 2", "--period 2="]),
        ({"periods": {"": 1.0}}, ["LABEL=SECONDS"]),
        ({"periods": {"3": 1.0}}, ["no pendulum '3'"]),
        ({"periods": PERIODS}, ["--gravity"]),
    ],
)
def test_options_that_do_not_fit_are_refused_with_their_remedy(write, options, words):
    with pytest.raises(UsageError) as caught:
        import_csv(write("t,1,1-2\n0,1,2\n1,3,4\n"), ImportOptions(**options))
    assert all(word in str(caught.value) for word in words), str(caught.value)


def test_a_name_that_stands_twice_is_refused(write):
    with pytest.raises(UsageError, match="two columns are named 'a'"):
        import_csv(write("t,a,a\n0,1,2\n1,3,4\n"), ImportOptions(columns=("a",)))


def test_a_single_pendulum_takes_its_period_without_a_label(write):
    record = import_csv(write("0,1\n1,2\n"), ImportOptions(periods={"": 1.029}))
    assert record["instrument"]["period"].values.tolist() == [1.029]
    assert "reference_gravity" not in record["instrument"]


def test_a_single_trace_of_a_difference_does_without_periods(write):
    record = import_csv(write("0,1\n1,2\n"), ImportOptions(columns=("2:1-2",)))
    assert check(record, "record") == []
    assert "instrument" not in record.children


def test_headers_say_the_units_and_contradictions_are_refused(write):
    path = write("t (ms),1 [deg],1-2 [mrad],az\n0,1,2,0.1\n40,3,4,0.2\n")
    more = {"accelerations": {"vertical_acceleration": "az"}, "noise": 0.01}
    record = import_csv(path, ImportOptions(periods=PERIODS, gravity=9.81, **more))
    assert check(record, "record") == []
    np.testing.assert_allclose(record["time"].values, [0.0, 0.04], rtol=1e-15)
    degree = np.pi / 180.0
    np.testing.assert_allclose(record["record"]["elongation"].values, [[degree, 3 * degree], [2e-3, 4e-3]], rtol=1e-15)
    np.testing.assert_allclose(record["record"]["elongation_uncertainty"].values, [0.01 * degree, 1e-5], rtol=1e-15)
    assert record["record"]["vertical_acceleration"].values.tolist() == [0.1, 0.2]
    with pytest.raises(UsageError, match="the header says deg"):
        import_csv(path, ImportOptions(unit="rad", periods=PERIODS, gravity=9.81, **more))


def test_dates_keep_their_nanoseconds(write):
    record = import_csv(write("t,a\n2024-05-01T12:00:00.000000001Z,1\n2024-05-01T12:00:00.040000007Z,2\n"))
    np.testing.assert_allclose(record["time"].values, [0.0, 0.040000006], atol=1e-16)


def test_angles_of_degrees_are_asked_about(write):
    with pytest.raises(RecordError, match="angles up to 20 are hardly radians; say --unit deg"):
        import_csv(write("0,20\n1,-19\n"))


def test_positions_become_the_angle_about_the_centre_of_their_circle(write):
    angle = 0.4 * np.cos(np.linspace(0.0, 12.0, 60)) + 0.02
    rows = [f"{0.04 * k},{1.5 + 0.8 * np.sin(a)},{2.0 - 0.8 * np.cos(a)}" for k, a in enumerate(angle)]
    record = import_csv(write("mass_A,,\nt,x,y\n" + "\n".join(rows) + "\n"), ImportOptions(position="x,y"))
    made = record["record"]["elongation"].values[0]
    mean = np.angle(np.mean(np.exp(1j * angle)))
    np.testing.assert_allclose(made, angle - mean, atol=1e-9)
    with pytest.raises(RecordError, match="straight line"):
        import_csv(write("t,x,y\n" + "\n".join(f"{k},{k},{2 * k}" for k in range(20))), ImportOptions(position="x,y"))


@pytest.mark.parametrize("name", ["x (m)", "Gyroscope x (rad/s)", "left [V]"])
def test_what_is_no_angle_is_refused_by_its_unit(write, name):
    table = write(f"Time (s),{name}\n" + "\n".join(f"{k},{0.01 * k}" for k in range(9)))
    with pytest.raises(RecordError, match="is no angle; choose others with --column, or say --xy"):
        import_csv(table, ImportOptions())


def test_constants_of_the_instrument_are_kept_and_unknown_ones_named(write):
    table = write("t,1,1-2\n0,1,2\n1,3,4\n")
    given = {"damping_rate": {"1": 1e-4, "2": 2e-4}, "latitude": 54.0, "period_uncertainty": 1e-7, "restoring": "sine"}
    record = import_csv(table, ImportOptions(periods=PERIODS, gravity=9.81, instrument=given))
    assert check(record, "record") == []
    known = record["instrument"]
    assert known["damping_rate"].values.tolist() == [1e-4, 2e-4]
    assert known["period_uncertainty"].values.tolist() == [1e-7, 1e-7]
    assert known.attrs["restoring"] == "sine"
    for wrong, told in (
        ({"latitud": 1.0}, "did you mean 'latitude'"),
        ({"damping_rate": {"1": 1.0}}, "lacks pendulum 2"),
    ):
        with pytest.raises(UsageError, match=told):
            import_csv(table, ImportOptions(periods=PERIODS, gravity=9.81, instrument=wrong))


def test_an_ordinary_netcdf_file_is_read_by_its_variables_over_time(tmp_path):
    import xarray as xr

    time = np.arange(8) * 0.04
    angles = {"left": ("time", 0.01 * np.cos(6.2 * time), {"units": "rad"}), "az": ("time", 0.1 * time), "note": 3.0}
    path = tmp_path / "logger.nc"
    xr.Dataset(angles, coords={"time": time}).to_netcdf(path)
    options = ImportOptions(columns=("left:1",), accelerations={"vertical_acceleration": "az"})
    record = import_csv(path, options)
    assert check(record, "record") == []
    np.testing.assert_array_equal(record["record"]["elongation"].values[0], angles["left"][1])
    np.testing.assert_array_equal(record["record"]["vertical_acceleration"].values, angles["az"][1])
