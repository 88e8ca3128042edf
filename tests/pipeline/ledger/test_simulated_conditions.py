"""Conditions that a scene makes and a record states: the ledger gives the true gravity back."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import xarray as xr
from ledger_records import entry, error, row, scene, with_stated

import data_schemas
import synth
from data_schemas.variables import attributes

DIFFERENT = {
    "first": {"temperature_coefficient": 94e-7, "density_coefficient": 773e-7},
    "second": {"temperature_coefficient": 93e-7, "density_coefficient": 770e-7},
}
CONDITIONS: dict[str, dict[str, Any]] = {
    "temperature": {"temperature": 298.15},
    "air_density": {"air_density": 1.25},
    "tilt": {"tilt": 0.005},
    "yaw": {"yaw_rate": 0.03},
    "eotvos": {"latitude": -35.0, "speed": 8.0, "course": 250.0},
}
ALL = {name: value for each in CONDITIONS.values() for name, value in each.items()}


@pytest.mark.parametrize("name", CONDITIONS)
def test_each_is_undone_alone(name: str) -> None:
    """Linear pendulums of different metal, to the 1e-4 mGal that short records at 10 Hz allow."""
    made = scene(CONDITIONS[name], **DIFFERENT)
    record, _ = synth.simulate(made)
    found = row(record)
    assert (found["gravity_m_s2"] - made.gravity) * 1e5 == pytest.approx(0.0, abs=1e-3)
    assert {each["entry"] for each in found["ledger"] if each["applied"]} == {"non_isochronism", name}
    assert abs(entry(found, name)["value_mgal"]) > 5.0


def test_all_are_undone_together() -> None:
    made = scene(ALL, **DIFFERENT, recording={"sampling_rate": 10, "chronometer_rate": 4.0})
    assert error(made) == pytest.approx(0.0, abs=1e-3)


def test_an_input_that_is_left_out_is_missed_by_its_size() -> None:
    """The test that the tests above can fail: the record without its temperature errs by the entry and the ratio."""
    made = scene(CONDITIONS["temperature"], **DIFFERENT)
    record, _ = synth.simulate(made)
    data = record["instrument"].to_dataset(inherit=False)
    record["instrument"] = type(record)(data.drop_vars("temperature"))
    assert abs(row(record)["gravity_m_s2"] - made.gravity) * 1e5 > 150.0


def test_what_changes_on_the_way_may_stand_beside_the_readings() -> None:
    """`temperature(time)` in /record counts as in /instrument."""
    changing = {"temperature_amplitude": 2.0, "temperature_period": 700.0}
    brass = {"temperature_coefficient": 94e-7}
    made = scene(CONDITIONS["temperature"] | changing, first=brass, second=brass, restoring="sine")
    record, _ = synth.simulate(made)
    before = row(record)["gravity_m_s2"]
    constants, read = (record[name].to_dataset(inherit=False) for name in ("instrument", "record"))
    course = constants["temperature"]
    assert course.dims == ("time",)
    record["instrument"] = type(record)(constants.drop_vars("temperature"))
    record["record"] = type(record)(read.assign(temperature=course))
    after = row(record)
    assert after["gravity_m_s2"] == before
    assert abs(entry(after, "temperature")["value_mgal"]) > 150.0


def test_a_tilt_that_wobbles_counts_by_its_mean_square() -> None:
    """cos b over b = +-8 mrad: b^4/24 is 2e-10 mGal of g."""
    made = scene({"tilt": 0.008})
    record, _ = synth.simulate(made)
    assert entry(row(record), "tilt")["value_mgal"] == pytest.approx(made.gravity * 0.008**2 / 2 * 1e5, rel=1e-4)


def test_stated_values_are_off_by_their_uncertainty_and_say_so() -> None:
    """One scene, many seeds: the draws have the stated deviation."""
    given = {"temperature": 290.0, "temperature_uncertainty": 0.3, "tilt": 0.01, "tilt_uncertainty": 1e-3}
    read = []
    for seed in range(60):
        record, _ = synth.simulate(scene(given, seed=seed, duration=2.0, motion=[]))
        instrument = record["instrument"].dataset
        assert float(instrument["temperature_uncertainty"]) == 0.3
        tilt = float(np.sqrt(instrument["tilt_mean_square"]))
        assert float(instrument["tilt_mean_square_uncertainty"]) == pytest.approx(2 * tilt * 1e-3, rel=0.02)
        read.append(((float(instrument["temperature"]) - 290.0) / 0.3, (tilt - 0.01) / 1e-3))
    # 60 draws know a deviation to 9 %
    np.testing.assert_allclose(np.std(read, axis=0), 1.0, atol=0.3)
    np.testing.assert_allclose(np.mean(read, axis=0), 0.0, atol=0.45)


def test_a_course_of_temperature_is_read_from_the_record() -> None:
    """A course that stands still is its number; one that rises acts as about its middle."""
    record, _ = synth.simulate(scene(duration=120.0))
    stated = {
        "temperature_reference": 288.15,
        "temperature_coefficient": [93e-7, 93e-7],
        "temperature_uncertainty": 0.1,
    }
    plain = row(with_stated(record, stated | {"temperature": 290.0}))
    part = np.linspace(-0.5, 0.5, record["time"].size)
    still, rising = (row(with_course(with_stated(record, stated), 290.0 + rise * part)) for rise in (0.0, 1.0))
    assert still["gravity_m_s2"] == pytest.approx(plain["gravity_m_s2"], rel=1e-13)
    assert entry(still, "temperature")["sigma_mgal"] == pytest.approx(1.8, rel=0.05)
    assert entry(rising, "temperature")["value_mgal"] == pytest.approx(
        entry(plain, "temperature")["value_mgal"], abs=3.0
    )
    assert "289.50 to 290.50 K, acting as " in entry(rising, "temperature")["reason"]


def with_course(record: xr.DataTree, course: np.ndarray) -> xr.DataTree:
    data = record["instrument"].to_dataset(inherit=False)
    data["temperature"] = ("time", course, attributes("instrument/temperature"))
    record["instrument"] = xr.DataTree(data)
    assert data_schemas.check(record, "record") == []
    return record


@pytest.mark.compiled
def test_a_temperature_that_changes_within_the_record() -> None:
    """1.3 K in half an hour are 23 mGal; what is left of them comes from amplitudes that beat meanwhile."""
    given = {"temperature": 298.15, "temperature_amplitude": 2.5, "temperature_period": 21600.0}
    coefficients = {"first": {"temperature_coefficient": 93e-7 / 1.0001}, "second": {"temperature_coefficient": 93e-7}}
    recording = {"sampling_rate": 25, "vertical_acceleration": True}
    made = scene(given, restoring="sine", duration=1800.0, recording=recording, **coefficients)
    record, _ = synth.simulate(made)
    assert data_schemas.check(record, "record") == []
    course = record["instrument"]["temperature"].values
    assert course.shape == record["time"].shape
    assert np.ptp(course) == pytest.approx(1.25, abs=0.01)
    found = row(record, "shooting")
    assert (found["gravity_m_s2"] - made.gravity) * 1e5 == pytest.approx(0.0, abs=0.02)
    # the plain mean does worse: the swing is not as large at both ends
    mean = row(with_stated(record, {"temperature": float(course.mean())}), "shooting")
    assert abs(mean["gravity_m_s2"] - found["gravity_m_s2"]) * 1e5 > 0.05


@pytest.mark.compiled
def test_heave_compares_with_the_gravity_that_is_felt() -> None:
    """40 K of brass are 720 mGal: heave of 0.6 m/s2 against gravity that much off would be wrong by 0.6 mGal."""
    heave = {"kind": "harmonics", "amplitude": [0.6], "period": [9.0], "axis": "vertical"}
    coefficients = {"first": {"temperature_coefficient": 93e-7}, "second": {"temperature_coefficient": 93e-7}}
    recording = {"sampling_rate": 25, "vertical_acceleration": True}
    made = scene({"temperature": 328.15}, motion=[heave], restoring="sine", recording=recording, **coefficients)
    assert error(made, "shooting") == pytest.approx(0.0, abs=0.02)


@pytest.mark.compiled
def test_a_cruise_adds_up_to_the_truth_within_its_uncertainty(
    capsys: pytest.CaptureFixture[str], tmp_path: Any
) -> None:
    """Heavy swell, heave, warming, clock, tilt, turn, way, bases: 40 ships, each reading its instruments wrongly."""
    cruise = data_schemas.load_scene(synth.scene_path("cruise"))
    scores = []
    for seed in range(40):
        record, _ = synth.simulate(cruise.model_copy(update={"seed": seed}))
        found = row(record, "shooting")
        scores.append((found["gravity_m_s2"] - cruise.gravity) * 1e5 / found["gravity_sigma_mgal"])
        sizes = {each["entry"]: abs(each["value_mgal"]) for each in found["ledger"] if each["applied"]}
        assert sizes["horizontal_acceleration"] > 500.0
        assert sizes["temperature"] > 100.0
    # 40 draws know a deviation to 11 %, a mean to 16 %
    assert np.std(scores) == pytest.approx(1.0, abs=0.35)
    assert abs(np.mean(scores)) < 0.5
    record, _ = synth.simulate(cruise)
    path = tmp_path / "cruise.record.nc"
    data_schemas.write(record, path)
    from pipeline.cli.main import main

    assert main(["process", str(path), "--method", "shooting"]) == 0
    shown = capsys.readouterr().out
    assert "ledger of shooting" in shown
    assert "flexure: no instrument/support_stiffness" in shown
    assert data_schemas.validate(tmp_path / "cruise.result.nc") == []
