"""The ledger adds up, names its sources, and lists what it could not apply."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import xarray as xr
from ledger_records import ENTRIES, EVERYTHING, entry, row, scene, with_stated

import data_schemas
import synth
from data_schemas.errors import RecordError
from pipeline import METHODS, process
from pipeline.ledger.book import GIVEN, corrections

PLAIN = [name for name in METHODS if name not in ("auto", "joint")]
UNCERTAIN = {
    "chronometer_rate_uncertainty": 0.1,
    "temperature_uncertainty": 0.05,
    "temperature_coefficient_uncertainty": np.array([1e-8, 1e-8]),
    "air_density_uncertainty": 0.01,
    "density_coefficient_uncertainty": np.array([2e-7, 2e-7]),
    "tilt_mean_square_uncertainty": 2e-6,
    "yaw_rate_uncertainty": 1e-3,
    "transverse_acceleration_mean_square_uncertainty": 2e-4,
    "rocking_rate_mean_square_uncertainty": 1e-6,
    "plane_angle_uncertainty": np.array([1e-4, 1e-4]),
    "speed_uncertainty": 0.1,
    "course_uncertainty": 2.0,
    "latitude_uncertainty": 0.1,
    "base_period_uncertainty": np.full((2, 2), 1e-8),
    "base_gravity_uncertainty": np.array([3e-7, 3e-7]),
}


@pytest.fixture(scope="module")
def plain() -> xr.DataTree:
    return synth.simulate(scene())[0]


@pytest.fixture(scope="module")
def result(plain: xr.DataTree) -> xr.DataTree:
    return process(with_stated(plain, EVERYTHING), method=PLAIN)


def test_values_add_up_to_gravity_less_the_uncorrected_one(result: xr.DataTree) -> None:
    table = result["gravity"].dataset
    total = table["value"].values.sum(axis=1)
    # rounding of gravity is 1e-9 mGal, a score of times
    np.testing.assert_allclose(total, (table["gravity"].values - table["uncorrected"].values) * 1e5, atol=3e-8)
    plain = 9.81 * (table["difference_frequency"].values / (2 * np.pi / EVERYTHING["base_period"][0, 1])) ** 2
    np.testing.assert_allclose(table["uncorrected"].values, plain, rtol=1e-14)


def test_every_entry_has_its_formula_its_source_and_a_reason(result: xr.DataTree) -> None:
    table = result["gravity"].dataset
    assert list(table["entry"].values) == [module.NAME for module in corrections()]
    for name in ("formula", "formula_source", "reason"):
        assert all(len(str(text)) > 5 for text in table[name].values.ravel()), name
    applied = table["applied"].values.astype(bool)
    assert (table["value"].values[~applied] == 0.0).all()
    given = [module.NAME for module in GIVEN]
    assert applied[:, [list(table["entry"].values).index(name) for name in given]].all()


def test_gravity_is_the_square_of_the_reduced_frequency(result: xr.DataTree) -> None:
    """The identity of the contract holds after all corrections."""
    table = result["gravity"].dataset
    n2 = table["frequency"].values[:, 1] * EVERYTHING["base_period"][0, 1] / (2 * np.pi)
    np.testing.assert_allclose(table["gravity"].values, 9.81 * n2**2, rtol=1e-14)


def test_the_period_of_a_correction_is_what_changes_gravity_so(result: xr.DataTree) -> None:
    """dT = -T dg/2g in 1e-7 s of the full period: 1e-7 s of half-period are 0.388 mGal."""
    table = result["gravity"].dataset
    period = 2 * np.pi / table["frequency"].values[:, 1]
    expected = -table["value"].values * period[:, None] / (2e5 * table["gravity"].values[:, None]) * 1e7
    np.testing.assert_allclose(table["value_period"].values, expected, rtol=1e-9, atol=1e-12)
    used = table["value"].values[0] != 0.0
    at = table["value"].values[0, used] / table["value_period"].values[0, used]
    np.testing.assert_allclose(at, -0.388 / 2.0, rtol=2e-3)


def test_the_result_conforms(result: xr.DataTree, plain: xr.DataTree) -> None:
    assert data_schemas.check(result, "result") == []
    assert data_schemas.check(with_stated(plain, EVERYTHING | UNCERTAIN), "record") == []


def test_what_has_no_input_is_listed_as_not_applied(plain: xr.DataTree) -> None:
    found = row(plain)
    for name, needs in ENTRIES.items():
        listed = entry(found, name)
        assert not listed["applied"], name
        assert listed["value_mgal"] == 0.0
        assert listed["input"] == []
        for variable in needs:
            assert variable == "base" or variable in listed["reason"]
    assert found["gravity_sigma_mgal"] == found["noise_sigma_mgal"]


@pytest.mark.parametrize("name", ENTRIES)
def test_inputs_switch_their_own_entry_on_and_no_other(plain: xr.DataTree, name: str) -> None:
    stated = {variable: EVERYTHING[variable] for variable in ENTRIES[name]}
    found = row(with_stated(plain, stated))
    assert {each for each in ENTRIES if entry(found, each)["applied"]} == {name}
    assert {f"instrument/{each}" for each in stated} - set(entry(found, name)["input"]) <= {"instrument/base"}
    if len(stated) > 1 and name != "base_tie":
        lacking = dict(list(stated.items())[1:])
        assert not entry(row(with_stated(plain, lacking)), name)["applied"]


def test_uncertainties_add_in_squares(plain: xr.DataTree) -> None:
    stated = EVERYTHING | UNCERTAIN
    found = row(with_stated(plain, stated), gain_uncertainty=1e-3)
    sigmas = {each["entry"]: each["sigma_mgal"] for each in found["ledger"]}
    assert found["gravity_sigma_mgal"] == pytest.approx(
        np.hypot(found["noise_sigma_mgal"], np.linalg.norm(list(sigmas.values()))), rel=1e-12
    )
    # flexure is shed; the method has neither arc nor acceleration; all others are uncertain here
    of_the_fit = {"zero", "scale", "clock_steps", "case_tilt"}
    silent = of_the_fit | {"finite_arc", "horizontal_acceleration", "vertical_acceleration", "flexure"}
    assert {name for name, sigma in sigmas.items() if sigma == 0.0} == silent


def test_an_uncertainty_that_nobody_states_is_not_taken_for_nought(plain: xr.DataTree) -> None:
    found = row(with_stated(plain, EVERYTHING))
    yaw, tilt = entry(found, "yaw"), entry(found, "tilt")
    for each in (yaw, tilt):
        assert each["sigma_mgal"] == pytest.approx(0.01 * abs(each["value_mgal"]))
        assert "no uncertainty stated, 1 % assumed" in each["reason"]
    assert found["gravity_sigma_mgal"] > np.hypot(yaw["sigma_mgal"], tilt["sigma_mgal"])
    assert "correction-without-uncertainty" in found["flags"]
    assert "correction-without-uncertainty" not in row(with_stated(plain, EVERYTHING | UNCERTAIN))["flags"]
    assert "correction-without-uncertainty" not in row(plain)["flags"]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"temperature": 900.0, "temperature_coefficient": [1e-4, 1e-4]}, "temperature_coefficient"),
        ({"base_period": np.full((2, 2), 0.5)}, "base_period"),
        ({"yaw_rate": 1.0}, "instrument/yaw_rate: 1 rad s-1 is no ship's"),
        ({"tilt_mean_square": 3.0}, "instrument/tilt_mean_square: 3 rad2"),
    ],
)
def test_impossible_conditions_are_refused(plain: xr.DataTree, wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(RecordError, match=said):
        process(with_stated(plain, EVERYTHING | wrong))


SCALARS = [name.removesuffix("_uncertainty") for name, value in UNCERTAIN.items() if np.ndim(value) == 0]


@pytest.mark.parametrize("name", SCALARS)
def test_an_uncertainty_is_what_a_change_of_the_input_does(plain: xr.DataTree, name: str) -> None:
    """Finite differences through the whole of process, n1/n2 included."""
    sigma = UNCERTAIN[f"{name}_uncertainty"]
    value = EVERYTHING[name]
    above, below = (row(with_stated(plain, EVERYTHING | {name: value + s * sigma})) for s in (0.5, -0.5))
    found = row(with_stated(plain, EVERYTHING | {f"{name}_uncertainty": sigma}))
    (owner,) = [each for each, needs in ENTRIES.items() if name in needs and each != "tide"]
    change = abs(above["gravity_m_s2"] - below["gravity_m_s2"]) * 1e5
    # the budget takes its sensitivity to n1/n2 from 4 s blocks
    assert entry(found, owner)["sigma_mgal"] == pytest.approx(change, rel=0.01)
