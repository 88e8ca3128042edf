"""Each entry on its own, on a stand-in for the record: sizes to the last bit, and sigma by finite differences."""

from __future__ import annotations

import itertools
import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipeline.conditions import MGAL, Tie
from pipeline.ledger import earth, own
from pipeline.ledger.book import OWN, own_entries
from pipeline.ledger.entry import Case, Correction, Shares
from pipeline.ledger.instrument import (
    air_density,
    base_tie,
    chronometer,
    planes,
    rocking,
    temperature,
    tilt,
    transverse_acceleration,
    yaw,
)
from pipeline.prepared import Estimate

G, PERIOD = 9.81, 1.01
STATED: dict[Correction, dict[str, Any]] = {
    air_density: {"air_density": 1.3, "air_density_reference": 1.2, "density_coefficient": np.array([8e-5, 7.7e-5])},
    temperature: {
        "temperature": 298.0,
        "temperature_reference": 288.0,
        "temperature_coefficient": np.array([94e-7, 93e-7]),
    },
    tilt: {"tilt_mean_square": 1e-4},
    rocking: {"rocking_rate_mean_square": 2e-4},
    transverse_acceleration: {"transverse_acceleration_mean_square": 0.02},
    yaw: {"yaw_rate": -0.01},
    chronometer: {"chronometer_rate": 3.0},
    earth.way: {"latitude": 40.0, "speed": 5.0, "course": 70.0},
}
TRUE: dict[Correction, Any] = {
    # what gravity was, from what was measured of it, by the physics of the disturbance
    air_density: lambda g: g * ((PERIOD + 7.7e-5 * 1.3 / 1.2) / PERIOD) ** 2,
    temperature: lambda g: g * ((PERIOD + 93e-6) / PERIOD) ** 2,
    tilt: lambda g: g / np.mean(np.cos(np.sqrt(2e-4) * np.sin(np.arange(360) * np.pi / 180.0))),
    rocking: lambda g: g * (1.0 - 2e-4 / (2.0 * np.pi / PERIOD) ** 2),  # m l b'^2 beside m g, l = g/n^2
    transverse_acceleration: lambda g: g - (np.hypot(g, np.sqrt(0.02)) - g),
    yaw: lambda g: g * ((2.0 * np.pi / PERIOD) ** 2 + 1e-4) / (2.0 * np.pi / PERIOD) ** 2,  # n^2 - W^2 was measured
    chronometer: lambda g: g / (1.0 + 3.0 / 86400.0) ** 2,
}


def case(constants: dict[str, Any], *, by_ratio: float = 0.0, shares: Shares | None = None, **more: Any) -> Case:
    """A record that states `constants`, of pendulums whose frequency is the nominal one but for `frequency`."""
    nominal = 2.0 * np.pi / PERIOD
    seen = SimpleNamespace(
        constants={"period": np.full(2, PERIOD)} | constants,
        reference_gravity=G,
        chronometer_rate=float(constants.get("chronometer_rate", 0.0)),
        period_relative_uncertainty=np.array([2e-7, 3e-7]),
        start=100.0,
        time=np.arange(11.0),
        course_time=100.0 + np.arange(11.0),
        tie=more.pop("tie", None),
        damping_rate=more.pop("damping_rate", None),
        restoring=more.pop("restoring", None),
        vertical=None,
        first="1",
        second="2",
    )
    prepared: Any = SimpleNamespace(
        observation=seen, nominal=nominal, fine_budget=SimpleNamespace(by_gain=2e-4), slow_square=1e-3
    )
    estimate = Estimate(nominal, nominal, 0.0, 0.0, 0.0, 9)
    made = Case(replace(estimate, **more), prepared, 1e-3, 2.0 * G / nominal / MGAL, by_ratio, 2.0 * G / MGAL)
    made.__dict__["shares"] = shares or Shares()
    return made


@pytest.mark.parametrize("module", TRUE, ids=lambda module: module.NAME)
def test_what_is_reduced_is_what_the_disturbance_did(module: Correction) -> None:
    """To fourth order in tilt and transverse acceleration, exactly else."""
    found = module.change(case(STATED[module]), G).gravity
    assert found == pytest.approx(TRUE[module](G), rel=2e-8 if module in (tilt, transverse_acceleration) else 1e-14)


@pytest.mark.parametrize("module", STATED, ids=lambda module: module.NAME)
def test_sigma_is_what_the_uncertainties_of_all_inputs_do(module: Correction) -> None:
    """By central differences of the entry itself, n1/n2 held."""
    stated = STATED[module]
    sigmas = {name: 1e-3 * value for name, value in stated.items() if not name.endswith("reference")}
    total = 0.0
    for name, sigma in sigmas.items():
        above, below = (module.change(case({**stated, name: stated[name] + s * sigma}), G).gravity for s in (0.5, -0.5))
        alone = module.change(case({**stated, f"{name}_uncertainty": abs(sigma)}), G)
        assert alone.sigma == pytest.approx(abs(above - below) / MGAL, rel=2e-3), name
        total += ((above - below) / MGAL) ** 2
    uncertain = {f"{name}_uncertainty": np.abs(sigma) for name, sigma in sigmas.items()}
    assert module.change(case(stated | uncertain), G).sigma == pytest.approx(np.sqrt(total), rel=2e-3)
    assert np.isnan(module.change(case(stated), G).sigma)


@pytest.mark.parametrize("module", [temperature, air_density], ids=lambda module: module.NAME)
def test_what_lengthens_both_periods_alike_leaves_their_ratio(module: Correction) -> None:
    """A shared thermometer moves n1/n2 by the difference of the coefficients alone; the coefficients each by itself."""
    common, apart = ("temperature", 10.0) if module is temperature else ("air_density", 1.3 / 1.2)
    coefficient = f"{'temperature' if module is temperature else 'density'}_coefficient"
    unit = 1.0 if module is temperature else 1.2
    stated = STATED[module]
    for pair in (np.array([9e-6, 9e-6]), np.array([9.5e-6, 9e-6])):
        given = stated | {coefficient: pair, f"{common}_uncertainty": 0.1}
        change = 0.1 / unit * pair / PERIOD
        expected = abs(-7.0 * change[0] + (7.0 + 2.0 * G / MGAL) * change[1])
        assert module.change(case(given, by_ratio=7.0), G).sigma == pytest.approx(expected, rel=1e-12)
    own_part = module.change(case(stated | {f"{coefficient}_uncertainty": np.array([3e-8, 4e-8])}, by_ratio=1e6), G)
    sizes = apart * np.array([3e-8, 4e-8]) / PERIOD * np.array([1e6, 1e6 + 2.0 * G / MGAL])
    assert own_part.sigma == pytest.approx(np.hypot(*sizes), rel=1e-12)


def test_air_is_compared_with_the_warm_period() -> None:
    """Temperature and air both add to the period in vacuum: reduced one after the other, both are gone."""
    both = case(STATED[temperature] | STATED[air_density])
    after = air_density.change(both, temperature.change(both, G).gravity).gravity
    assert after == pytest.approx(G * ((PERIOD + 93e-6 + 7.7e-5 * 1.3 / 1.2) / PERIOD) ** 2, rel=1e-14)


def test_a_turn_is_compared_with_true_time() -> None:
    rate = {"chronometer_rate": 864.0, "yaw_rate": 0.01}
    n = 2.0 * np.pi / PERIOD / 1.01
    assert yaw.change(case(rate), G).gravity == pytest.approx(G * (1.0 + 1e-4 / n**2), rel=1e-14)


def test_a_chronometer_rate_of_zero_is_told_from_none() -> None:
    found = chronometer.change(case({"chronometer_rate": 0.0, "chronometer_rate_uncertainty": 0.1}), G)
    assert (found.applied, found.gravity) == (True, G)
    assert found.sigma == pytest.approx(2.0 * G / MGAL * 0.1 / 86400.0)
    assert not chronometer.change(case({}), G).applied


def test_courses_count_by_their_means() -> None:
    at = np.linspace(0.0, 1.0, 11)
    drifting = case(STATED[temperature] | {"temperature_course": 293.0 + 10.0 * at}, of_mean=True)
    found = temperature.change(drifting, G)
    assert found.gravity == pytest.approx(temperature.change(case(STATED[temperature]), G).gravity, rel=1e-14)
    assert found.reason == "293.00 to 303.00 K, acting as 298.000 K, +10.00 K from the reference"
    assert temperature.change(case(STATED[temperature]), G).reason == "298.00 K, +10.00 K from the reference"
    steady, turning = STATED[earth.way], STATED[earth.way] | {"course_course": 360.0 * at[:-1].repeat(2)[:11]}
    assert earth.way.change(case(steady), G).reason == "5.000 m/s on 70.000 deg at 40.000 deg"
    found = earth.way.change(case(turning, of_mean=True), G)
    assert found.reason == "5.000 m/s on 0.000 to 180.000 deg at 40.000 deg"
    each = [earth.eotvos(40.0, 5.0, course) for course in turning["course_course"]]
    assert found.gravity == pytest.approx(G + np.mean(each), rel=1e-14)


def test_planes_are_uncertain_in_proportion() -> None:
    """.21 mGal at 10 mrad and y'' of .1 m/s2 (a mean square of .005), which is also taken where none is stated."""
    known = {"transverse_acceleration_mean_square": 0.005}
    for angles, more, size in (
        ([0.01, 0.0], known, 0.21),
        ([0.02, 0.03], {}, 0.21),
        ([0.0, 0.01], {"transverse_acceleration_mean_square": 0.02}, 0.42),
        ([0.01, 0.01], {"plane_angle_uncertainty": np.array([0.003, 0.004])}, 0.105),
        ([0.0, 0.012], {"plane_angle_uncertainty": np.array([0.003, 0.004])}, 0.273),
    ):
        found = planes.change(case({"plane_angle": np.array(angles), **more}), G)
        assert found.sigma == pytest.approx(size, rel=0.02)
        assert found.gravity == G


def test_the_tide_is_its_mean_over_the_record() -> None:
    place = {"latitude": 45.0, "longitude": 10.0, "epoch": 1e9}
    found = earth.moon_and_sun.change(case(place), G)
    lost = earth.tidal_loss(place, 100.0 + np.arange(0.0, 10.1, 0.01)).mean()
    assert found.gravity - G == pytest.approx(lost, rel=1e-4)
    assert found.sigma == pytest.approx(0.1 * abs(lost) / MGAL + 1e-3, rel=1e-4)
    with_height = earth.tidal_loss(place | {"height": 6.4e4}, np.zeros(1))
    assert with_height == pytest.approx(1.01 * earth.tidal_loss(place, np.zeros(1)), rel=2e-3)
    dateless = earth.moon_and_sun.change(case({"latitude": 45.0, "longitude": 10.0}), G)
    assert (dateless.gravity, dateless.sigma, dateless.applied) == (G, 0.0, False)


def tie(**changes: Any) -> Tie:
    period = np.array([PERIOD, PERIOD + 1e-6])
    return replace(Tie(period, np.array([2e-7, 3e-7]), None, 0.5, 0.1, 0.25, True), **changes)


def test_a_tie_takes_the_place_of_the_stated_period() -> None:
    """Its sigma: the drift of the second period, by which n1/n2 moves too, and the bases' gravity."""
    found = base_tie.change(case({}, tie=tie(gravity_uncertainty=2e-5), by_ratio=1e6), G)
    assert found.gravity == pytest.approx(G * ((PERIOD + 1e-6) / PERIOD) ** 2, rel=1e-14)
    drift = (1e6 + 2.0 * G / MGAL) * 3e-7
    assert found.sigma == pytest.approx(np.hypot(drift, 2.0), rel=1e-12)
    assert found.reason == "misclosure +0.500 +- 0.100 mGal, record at 25 % of the way"
    assert base_tie.change(case({}, tie=tie()), G).sigma == pytest.approx(2.0 * G / MGAL * 3e-7, rel=1e-12)
    assert np.isnan(base_tie.change(case({}, tie=tie(stated=False)), G).sigma)
    # the joint fit has the periods' drift in its own sigma
    assert base_tie.change(case({}, tie=tie(gravity_uncertainty=2e-5), of_mean=True), G).sigma == pytest.approx(2.0)
    none = base_tie.change(case({}, by_ratio=-4e6), G)
    assert (none.gravity, none.applied) == (G, False)
    assert none.sigma == pytest.approx((4e6 - 2.0 * G / MGAL) * 3e-7, rel=1e-12)


@pytest.mark.parametrize("reduced", [False, True])
def test_a_methods_own_correction_splits_into_its_parts(reduced: bool) -> None:
    """Shares of n2 and parts of the joint fit, each its own entry; together the whole."""
    shares = Shares(2e-4, 3e-5, -4e-5, 1e-4, (1e-4, 4e-5), reduced)
    n = 2.0 * np.pi / PERIOD
    parts = {"zero": (1.5, 0.2, "a zero"), "case_tilt": (-2.5, 0.3, "a tilt")}
    made = case({}, shares=shares, uncorrected=n - 5e-4, parts=parts, by_ratio=1e6)
    found = own_entries(made)
    assert list(found) == [module.NAME for module in OWN]
    by = 2.0 * G / n / MGAL
    for name, value in {
        "non_isochronism": (5e-4 - 1.9e-4) * by - 1.5,
        "zero": 1.5,
        "finite_arc": 2e-4 * by,
        "case_tilt": -2.5,
        "horizontal_acceleration": 3e-5 * by + 2.5,  # Browne's term less what is listed as the case's tilt
        "vertical_acceleration": -4e-5 * by,
    }.items():
        assert found[name].value == pytest.approx(value, abs=0.03), name
    assert sum(each.value for each in found.values()) == pytest.approx(5e-4 * by, rel=1e-3)
    assert found["zero"].sigma == 0.2
    assert {name for name, each in found.items() if each.sigma} == {"non_isochronism", "zero", "case_tilt"}
    assert not found["scale"].applied
    assert found["vertical_acceleration"].applied is False
    assert found["horizontal_acceleration"].applied is reduced
    gain = by * (2e-4 + 1e-4) * 1e-3
    assert found["non_isochronism"].sigma == pytest.approx(np.hypot(1e6 * 2e-7, gain), rel=1e-9)
    mean = own_entries(case({}, shares=shares, uncorrected=n - 5e-4, by_ratio=1e6, of_mean=True))["non_isochronism"]
    assert mean.sigma == pytest.approx(gain, rel=1e-9)
    assert mean.reason == "n1/n2 from instrument/period; damping difference taken as zero, none is stated"
    assert not own_entries(case({}))["non_isochronism"].applied
    # g A^2/8
    assert re.search(r"pendulum 1 alone \+12\.2\d mGal, pendulum 2 \+4\.90$", found["finite_arc"].reason)


def test_a_part_that_no_fit_has_is_not_applied() -> None:
    change = own.ZERO.change(case({}, parts={}), G)
    assert (change.gravity, change.sigma, change.applied) == (G, 0.0, False)


def test_independent_parts_add_in_squares() -> None:
    one = case({})
    for parts in itertools.permutations([3.0, None, 4.0]):
        assert one.sigma(*parts) == 5.0
    assert np.isnan(one.sigma(None))
