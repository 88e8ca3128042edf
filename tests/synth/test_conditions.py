"""Heat, air, tilt, turn and way of the ship in scenes, against an integration that shares no formula with them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import data_schemas
from data_schemas.scene import Scene, felt_gravity, frequency
from synth import simulate
from synth.disturbances import stiffening

Maker = Callable[..., Scene]
X, Z, RATE = 0.1, 0.08, 0.7  # m/s2, m/s2, rad/s
MOTION = [
    {"kind": "harmonics", "amplitude": [X], "angular_frequency": [RATE]},
    {"kind": "harmonics", "amplitude": [Z], "angular_frequency": [RATE], "phase": [0.5], "axis": "vertical"},
]


def pendulums(**more: Any) -> list[dict[str, Any]]:
    return [
        {"label": "1", "period": 1.0096, "temperature_coefficient": 1.01e-4, **more, "start": start(0.02)},
        {"label": "2", "period": 1.0097, "temperature_coefficient": 1.01001e-4, **more, "start": start(0.015)},
    ]


def start(angle: float) -> dict[str, Any]:
    return {"kind": "state", "angle": angle, "angular_velocity": 0.01}


def integrated(made: Scene, time: np.ndarray, stiffness: Callable[[float], np.ndarray]) -> np.ndarray:
    """Angles (pendulums, n); `stiffness(t)` is g/l of a still support, s-2; accelerations act with 1/l."""
    length = made.reference_gravity * (np.array([each.period for each in made.pendulums]) / (2 * np.pi)) ** 2

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        angle, rate = y[::2], y[1::2]
        across, up = X * np.cos(RATE * t), Z * np.cos(RATE * t + 0.5)
        pull = (stiffness(t) + up / length) * np.sin(angle) + across / length * np.cos(angle)
        turn = (made.conditions.yaw_rate or 0.0) ** 2 * np.sin(angle) * np.cos(angle)
        return np.stack([rate, turn - pull], axis=-1).ravel()

    first = np.ravel([[each.start.angle, each.start.angular_velocity] for each in made.pendulums])
    return solve_ivp(slope, (0.0, time[-1]), first, "DOP853", time, rtol=1e-12, atol=1e-15).y[::2]


@pytest.mark.compiled
def test_a_course_of_temperature_against_its_own_equation(make_scene: Maker) -> None:
    """A pendulum whose length follows the temperature: the simulator makes it of a slow vertical acceleration."""
    given = {"temperature": 288.15, "temperature_amplitude": 4.0, "temperature_period": 120.0, "temperature_phase": 0.3}
    made = make_scene(pendulums=pendulums(), motion=MOTION, conditions=given, restoring="sine", duration=60.0)
    record, truth = simulate(made)
    time = record["time"].values
    own = np.array([each.period for each in made.pendulums])
    part = np.array([each.temperature_coefficient for each in made.pendulums]) / own

    def stiffness(t: float) -> np.ndarray:
        warm = 4.0 * np.sin(2 * np.pi / 120.0 * t + 0.3)
        return (2 * np.pi / own) ** 2 * made.gravity / made.reference_gravity / (1.0 + part * warm) ** 2

    off = np.abs(truth["truth"]["theta"].values - integrated(made, time, stiffness)).max()
    # 4 K change n^2 by 8e-4, the angle by 3e-3 rad in a minute; the course's square is kept, its cube (1e-10) not,
    # nor its product with accelerations (1e-5 of the forced 0.01 rad)
    assert off < 1e-6
    # the record states the course, and the acceleration of the ship alone
    course = record["instrument"]["temperature"].values
    np.testing.assert_allclose(course, 288.15 + 4.0 * np.sin(2 * np.pi / 120.0 * time + 0.3), rtol=1e-14)
    np.testing.assert_allclose(truth["truth"]["vertical_acceleration"], Z * np.cos(RATE * time + 0.5), atol=1e-14)


@pytest.mark.compiled
def test_tilt_and_turn_against_their_own_equation(make_scene: Maker) -> None:
    """Gravity's part along a tilted plane, the centrifugal force of its turn."""
    given = {"tilt": 0.02, "yaw_rate": 0.04}
    made = make_scene(pendulums=pendulums(), motion=MOTION, conditions=given, restoring="sine", duration=60.0)
    record, truth = simulate(made)
    length = made.reference_gravity * (np.array([each.period for each in made.pendulums]) / (2 * np.pi)) ** 2
    along = made.gravity * np.cos(0.02) / length
    off = np.abs(truth["truth"]["theta"].values - integrated(made, record["time"].values, lambda t: along)).max()
    # W^2 sin cos as W^2 sin: W^2 theta^3/2 = 6e-9 s-2 rad, in phase with the swing for a minute; 2e-4 of tilt is 4e-2 s
    assert off < 2e-7


def test_the_acceleration_that_acts_like_a_course_of_temperature(make_scene: Maker) -> None:
    """(1 + k sin)^-2 - 1 of gravity, k = 4e-4; its square makes 2e-6 m/s2, k itself is rounded here to 5e-6."""
    given = {"temperature": 288.15, "temperature_amplitude": 4.0, "temperature_period": 120.0, "temperature_phase": 0.3}
    made = make_scene(pendulums=pendulums(), conditions=given, restoring="sine")
    found = stiffening(made)
    assert found is not None
    time = np.linspace(0.0, 120.0, 13)
    turned = np.exp(1j * found.angular_frequency[:, None] * time)
    part = 4.0 * 1.01e-4 / 1.00965 * np.sin(2 * np.pi / 120.0 * time + 0.3)
    expected = made.gravity * ((1.0 + part) ** -2 - 1.0)
    np.testing.assert_allclose((found.acceleration @ turned).real, expected, atol=1e-7)
    record, _ = simulate(make_scene(conditions={"temperature": 288.15}))
    assert record["instrument"]["temperature"].ndim == 0
    assert stiffening(make_scene()) is None


def test_frequencies_follow_the_conditions(make_scene: Maker) -> None:
    given = {"temperature": 298.15, "air_density": 1.2, "yaw_rate": 0.03, "tilt": 0.01, "latitude": 0.0}
    way = {"speed": 4 * 1852 / 3600, "course": 90.0}
    made = make_scene(
        pendulums=pendulums(density_coefficient=7e-5, drift=1e-6), conditions=given | way, duration=43200.0
    )
    gravity = (9.8123 - 30.08e-5) * np.cos(0.01)
    for each in made.pendulums:
        period = each.period + each.temperature_coefficient * 10.0 + 7e-5 + 1e-6 * 0.25
        n = np.sqrt((2 * np.pi / period) ** 2 * gravity / 9.81 - 0.03**2)
        # the Eotvos effect is written to 0.005 mGal
        assert frequency(made, each) == pytest.approx(n, rel=5e-9)
    length = 9.81 * (period / (2 * np.pi)) ** 2
    assert felt_gravity(made) == pytest.approx(gravity - 0.03**2 * length, rel=1e-7)


def test_a_scene_without_conditions_states_none(make_scene: Maker) -> None:
    record, _ = simulate(make_scene())
    assert set(record["instrument"].dataset.data_vars) == {"period", "reference_gravity", "damping_rate"}


def test_what_acts_is_stated_and_conforms(make_scene: Maker) -> None:
    bases = [{"label": "before", "time": -9e4, "gravity": 9.80}, {"label": "after", "time": 9e4, "gravity": 9.82}]
    given = {
        "temperature": 290.0, "temperature_uncertainty": 0.1, "air_density": 1.2, "air_density_uncertainty": 0.01,
        "tilt": 0.01, "tilt_uncertainty": 1e-3, "yaw_rate": 0.01, "yaw_rate_uncertainty": 1e-3, "latitude": 50.0,
        "speed": 5.0, "speed_uncertainty": 0.1, "course": 10.0, "course_uncertainty": 1.0,
        "chronometer_rate_uncertainty": 0.2, "bases": bases, "base_period_uncertainty": 1e-7,
    }  # fmt: skip
    made = make_scene(pendulums=pendulums(drift=1e-6), conditions=given)
    record, _ = simulate(made)
    again, _ = simulate(made)
    assert data_schemas.check(record, "record") == []
    instrument = record["instrument"].dataset
    for name in ("temperature", "air_density", "tilt_mean_square", "yaw_rate", "speed", "course", "chronometer_rate"):
        assert f"{name}_uncertainty" in instrument
        assert float(instrument[name]) == float(again["instrument"].dataset[name])
    # a base's own gravity, and the drift of a day and a bit
    expected = (1.0097 + 1e-6 * 9e4 / 86400) * np.sqrt(9.81 / 9.82)
    assert float(instrument["base_period"].values[1, 1]) == pytest.approx(expected, abs=6e-7)
    assert [str(name) for name in instrument["base"].values] == ["before", "after"]


FAULTS = [
    ({"speed": 3.0}, {}, "needs latitude, speed and course together"),
    ({"speed": 3.0, "course": 9.0}, {}, "needs latitude, speed and course together"),
    ({"temperature_amplitude": 3.0}, {}, "needs the mean temperature"),
    ({"tilt_uncertainty": 0.1}, {}, "tilt_uncertainty needs tilt"),
    ({"base_period_uncertainty": 0.1}, {}, "needs bases"),
    ({"bases": [{"label": "a", "time": 1, "gravity": 9.8}, {"label": "b", "time": 0, "gravity": 9.8}]}, {}, "in order"),
    ({"temperature": 280.0, "temperature_amplitude": 3.0}, {}, "set restoring = 'sine'"),
    ({"yaw_rate": 0.999}, {"pendulums": [{"label": "1", "period": 3.0, "start": start(0.1)}]}, "would hardly swing"),
    ({"tilt": 0.1}, {"support": {"kind": "board", "coupling": 0.1}, "restoring": "sine"}, "on a fixed support only"),
]


@pytest.mark.parametrize(("given", "more", "said"), FAULTS)
def test_faults_are_said(make_scene: Maker, given: dict[str, Any], more: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        make_scene(conditions=given, **more)


def test_a_course_needs_one_metal(make_scene: Maker) -> None:
    two = pendulums()
    two[1]["temperature_coefficient"] = 1e-6
    with pytest.raises(ValueError, match="of one metal"):
        make_scene(
            pendulums=two, conditions={"temperature": 280.0, "temperature_amplitude": 1.0}, restoring="sine", motion=[]
        )
