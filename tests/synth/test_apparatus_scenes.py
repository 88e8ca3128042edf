"""What a real apparatus adds to a scene, against Newton's law integrated by other means and formulas by hand."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import synth_mechanics
from scipy.integrate import solve_ivp

import synth
from data_schemas.errors import SceneError
from data_schemas.scene import Scene
from synth.kernels.tide import tide

G, REFERENCE = 9.8, 9.81
ACROSS, ALONG, UP = ({"amplitude": 0.12, "period": p, "phase": f} for p, f in ((8.0, 0.3), (9.0, 1.0), (7.0, 2.0)))
ROLL = {"amplitude": 0.03, "period": 6.0, "phase": 0.7}


def wave(of: dict[str, float]) -> Callable[[float], float]:
    return lambda t: of["amplitude"] * math.cos(2 * math.pi / of["period"] * t + of["phase"])


def term(of: dict[str, float], **more: Any) -> dict[str, Any]:
    return {"kind": "harmonics", **{name: [value] for name, value in of.items()}, **more}


def scene(**changes: Any) -> Scene:
    start = {"kind": "state", "angle": 0.012}
    given: dict[str, Any] = {
        "record_id": "apparatus",
        "duration": 60.0,
        "gravity": G,
        "restoring": "sine",
        "pendulums": [
            {"label": "1", "period": 1.0, "start": start},
            {"label": "2", "period": 1.0002, "damping_rate": 1e-3, "start": start | {"angle": -0.009}},
        ],
        "motion": [term(ACROSS), term(ALONG, axis="transverse"), term(UP, axis="vertical")],
        "recording": {"sampling_rate": 10},
    }
    return Scene.model_validate(given | changes)


def theta(of: Scene) -> np.ndarray:
    return np.asarray(synth.simulate(of)[1]["truth/theta"].values)


def elongation(of: Scene) -> np.ndarray:
    return np.asarray(synth.simulate(of)[0]["record/elongation"].values)


def solved(of: Scene, slope: Callable[[int, float, float, float], float]) -> np.ndarray:
    """Angles by DOP853 from a pendulum's angular acceleration, given number, time, angle and rate."""
    times, rows = np.arange(of.count) / 10.0, []
    for i, each in enumerate(of.pendulums):
        assert each.start.kind == "state"
        found = solve_ivp(
            lambda t, y, i=i: [y[1], slope(i, t, y[0], y[1])],
            (0.0, times[-1]), [each.start.angle, each.start.angular_velocity], "DOP853", times, rtol=1e-12, atol=1e-15,
        )  # fmt: skip
        rows.append(found.y[0])
    return np.array(rows)


def pull(of: Scene, i: int, t: float, angle: float, rate: float, across: float, down: float) -> float:
    length = synth_mechanics.lengths(of)[i]
    return -2 * of.pendulums[i].damping_rate * rate - (down * math.sin(angle) + across * math.cos(angle)) / length


def test_rolling_plane_of_swing_feels_lagranges_forces() -> None:
    """From L = l^2 (theta'^2 + b'^2 cos^2 theta)/2 - V; the simulator takes l b'^2 cos theta as the mean l b'^2."""
    of = scene(case={"roll": term(ROLL)})
    b, y, z, x = wave(ROLL), wave(ALONG), wave(UP), wave(ACROSS)
    turn = 2 * math.pi / ROLL["period"]

    def slope(i: int, t: float, angle: float, rate: float, *, taken: bool = False) -> float:
        down = (G + z(t)) * math.cos(b(t)) - y(t) * math.sin(b(t))
        spin = -turn * ROLL["amplitude"] * math.sin(turn * t + ROLL["phase"])
        lengths = synth_mechanics.lengths(of)
        share = float(lengths.mean() / lengths[i]) if taken else math.cos(angle)
        return pull(of, i, t, angle, rate, x(t), down) - spin**2 * math.sin(angle) * share

    assert np.abs(theta(of) - solved(of, functools.partial(slope, taken=True))).max() < 2e-11
    assert np.abs(theta(of) - solved(of, slope)).max() < 5e-8  # 3e-3 mGal at 30 mrad of roll


def test_roll_by_gimbal_makes_gravity_larger_by_its_mean_square() -> None:
    """A plane that follows y'' of amplitude a feels g + a^2/(4g), and l b'^2 of its own turning (physics 1.4)."""
    still = scene(motion=[], case=None)
    swayed = scene(
        motion=[term(ALONG, axis="transverse")], case={"roll": {"kind": "gimbal", "period": 0.01, "damping": 1.0}}
    )
    times = np.arange(still.count) / 10.0
    free, rolled = theta(still)[0], theta(swayed)[0]
    rate = np.gradient(free, times)
    shift = -np.sum((rolled - free) * rate * times) / np.sum((rate * times) ** 2)  # dn/n: phase gained over time
    a, w = ALONG["amplitude"], 2 * math.pi / ALONG["period"]
    length = REFERENCE / (2 * math.pi) ** 2
    expected = (a**2 / (4 * G) + 0.5 * length * (a * w / G) ** 2) / (2 * G)
    assert -shift == pytest.approx(expected, rel=0.1)


def test_pendulum_in_another_plane_feels_its_share_of_both_axes() -> None:
    of = scene(
        pendulums=[
            {"label": "1", "period": 1.0, "plane": 0.3, "start": {"kind": "state", "angle": 0.012}},
            {"label": "2", "period": 1.0002, "start": {"kind": "state", "angle": -0.009}},
        ]
    )
    x, y, z = wave(ACROSS), wave(ALONG), wave(UP)

    def slope(i: int, t: float, angle: float, rate: float) -> float:
        plane = of.pendulums[i].plane
        across = math.cos(plane) * x(t) + math.sin(plane) * y(t)
        return pull(of, i, t, angle, rate, across, G + z(t))

    assert np.abs(theta(of) - solved(of, slope)).max() < 1e-12
    linear = scene(restoring="linear", motion=[term(ACROSS), term(ALONG, axis="transverse")])
    turned = linear.model_copy(
        update={"pendulums": tuple(p.model_copy(update={"plane": math.pi / 2}) for p in linear.pendulums)}
    )
    swapped = scene(restoring="linear", motion=[term(ALONG)])
    assert np.abs(theta(turned) - theta(swapped)).max() < 1e-15


EVENTS = [
    {"kind": "knock", "pendulum": "1", "time": 20.0, "change": 2e-3},
    {"kind": "restart", "pendulum": "2", "time": 30.0, "angle": 0.01, "angular_velocity": 0.02},
    {"kind": "release", "pendulum": "1", "time": 5.0, "angle": 0.015},
    {"kind": "clamp", "pendulum": "2", "time": 50.0, "angle": 1e-3},
]


@pytest.mark.parametrize("quadratic", [pytest.param(0.0, id="picard"), pytest.param(1e-3, id="explicit")])
def test_handling_changes_the_state_when_the_truth_says(quadratic: float) -> None:
    pendulums = [each.model_dump() | {"quadratic_damping": quadratic} for each in scene().pendulums]
    of = scene(pendulums=pendulums, events=EVENTS)
    truth = synth.simulate(of)[1]["truth"]
    knock, restart, release, clamp = truth["event_time"].values
    slope, times = synth_mechanics._fixed(of), np.arange(of.count) / 10.0
    state = np.array([0.0, 0.0, -0.009, 0.0])
    edges, rows = [0.0, release, knock, restart, 60.0], np.empty((times.size, 4))
    for number, (begin, end) in enumerate(itertools.pairwise(edges)):
        if number == 1:
            state[:2] = 0.015, 0.0
        elif number == 2:
            state[1] += 2e-3 * 2 * math.pi * math.sqrt(G / REFERENCE)
        elif number == 3:
            state[2:] = 0.01, 0.02
        here = (times >= begin) & (times < end)
        found = solve_ivp(slope, (begin, end), state, "DOP853", [*times[here], end], rtol=1e-12, atol=1e-15)
        rows[here], state = found.y.T[:-1], found.y[:, -1].copy()
    expected = rows[:, ::2].T
    expected[0, times < release], expected[1, times >= clamp] = 0.015, 1e-3
    apart = np.abs(times[:, None] - [knock, restart, release, clamp]).min(axis=1) > 1e-9
    assert np.abs(truth["theta"].values - expected)[:, apart].max() < (
        1e-12 if quadratic == 0.0 else 1e-10
    )  # a kink in the force


def test_trace_errors_are_what_they_say() -> None:
    perfect = scene()
    errors = {"zero": 1e-3, "drift": 4e-3, "scale": 0.01, "cubic": 0.3, "steps": [{"time": 30.0, "size": 2e-3}]}
    of = scene(recording={"sampling_rate": 10, "errors": [errors | {"trace": "1"}, {"trace": "1-2", "lever": 2.0}]})
    angle, shown, t = elongation(perfect), elongation(of), np.arange(600) / 10.0
    expected = 1.01 * (angle[0] + 0.3 * angle[0] ** 3) + 1e-3 + 4e-3 * (t / 60.0 - 0.5) + 2e-3 * (t >= 30.0)
    assert np.abs(shown[0] - expected).max() < 1e-15
    assert np.abs(shown[1] - 0.5 * np.tan(2.0 * angle[1])).max() < 1e-15


def test_late_trace_shows_the_angle_of_an_earlier_time() -> None:
    recording = {"sampling_rate": 10, "errors": [{"trace": "1", "delay": 0.03}, {"trace": "1-2", "delay": -0.02}]}
    shown = elongation(scene(recording=recording))
    fine = theta(scene(recording={"sampling_rate": 100}))
    assert np.isnan(shown[0, 0])
    assert np.abs(shown[0, 1:] - fine[0, 7:-3:10]).max() < 1e-14
    assert np.abs(shown[1] - (fine[0] - fine[1])[2::10]).max() < 1e-14


def test_clipping_comes_after_noise() -> None:
    recording = {"sampling_rate": 10, "noise": 1e-3, "errors": [{"clip": 0.02}]}
    assert np.abs(elongation(scene(recording=recording))).max() == 0.02


def test_pitch_is_taken_off_each_pendulum_and_written() -> None:
    case = {"pitch": term(ROLL), "write_tilt": True}
    record, truth = synth.simulate(scene(case=case))
    shown, pitch = record["record/elongation"].values, wave(ROLL)
    tilt = np.array([pitch(t) for t in np.arange(600) / 10.0])
    assert record["record"].attrs["reference"] == "case"
    assert np.abs(record["record/case_tilt"].values - tilt).max() < 1e-15
    assert np.abs(truth["truth/case_pitch"].values - tilt).max() < 1e-15
    assert np.abs(shown[0] - (truth["truth/theta"].values[0] - tilt)).max() < 1e-15
    assert np.abs(shown[1] - elongation(scene())[1]).max() < 1e-15
    absolute = elongation(scene(case=case | {"reference": "vertical"}))
    assert np.array_equal(absolute, elongation(scene()))


def test_gimbal_follows_the_apparent_vertical() -> None:
    """b'' + 2 d w b' + w^2 b = -w^2 x''/g, in the steady state."""
    truth = synth.simulate(scene(case={"pitch": {"kind": "gimbal", "period": 3.0, "damping": 0.4}}))[1]["truth"]
    w, own, t = 2 * math.pi / ACROSS["period"], 2 * math.pi / 3.0, truth["time"].values
    b = truth["case_pitch"].values
    turned = 1j * w * t
    phasor = np.mean(b[:560] * np.exp(-turned[:560])) * 2  # seven waves
    residual = (own**2 - w**2 + 2j * 0.4 * own * w) * phasor
    assert residual == pytest.approx(-(own**2) * ACROSS["amplitude"] / G * np.exp(1j * ACROSS["phase"]), rel=1e-9)


def test_accelerometers_err_as_they_say() -> None:
    horizontal = {"bias": 0.02, "scale": 0.05, "delay": 0.3, "missing": [[10.0, 12.0]]}
    of = scene(recording={"sampling_rate": 10, "horizontal_acceleration": horizontal, "vertical_acceleration": True})
    record = synth.simulate(of)[0]["record"]
    t = np.arange(600) / 10.0
    expected = 1.05 * np.array([wave(ACROSS)(each - 0.3) for each in t]) + 0.02
    gone = (t >= 10.0) & (t < 12.0)
    assert np.array_equal(np.isnan(record["horizontal_acceleration"].values), gone)
    assert np.abs(record["horizontal_acceleration"].values - expected)[~gone].max() < 1e-14
    assert np.abs(record["vertical_acceleration"].values - [wave(UP)(each) for each in t]).max() < 1e-14


def test_accelerometer_on_a_gimbal_reads_nothing() -> None:
    """In the case's frame it reads x'' cos p + (g + z'') sin p: nothing where the case follows at once."""
    recording = {"sampling_rate": 10, "horizontal_acceleration": {"frame": "case"}}
    still = [term(ACROSS | {"amplitude": 1e-3})]
    of = scene(motion=still, case={"pitch": {"kind": "gimbal", "period": 1e-3}}, recording=recording)
    record = synth.simulate(of)[0]
    assert record["instrument"].attrs["acceleration_frame"] == "case"
    assert np.abs(record["record/horizontal_acceleration"].values).max() < 2e-6


def test_clock_errors_move_the_records_time_alone() -> None:
    recording = {
        "sampling_rate": 10,
        "clock_steps": [{"time": 20.0, "size": 0.02}, {"time": 40.0, "size": -0.05}],
        "wow": {"amplitude": 1e-3, "period": 7.0, "phase": 0.2},
    }
    record, truth = synth.simulate(scene(recording=recording))
    t = truth["time"].values
    expected = t + 0.02 * (t >= 20.0) - 0.05 * (t >= 40.0) + 1e-3 * np.sin(2 * np.pi * t / 7.0 + 0.2)
    assert np.abs(record["time"].values - expected).max() < 1e-12
    assert np.array_equal(record["record/elongation"].values, elongation(scene()))
    back = {"sampling_rate": 10, "clock_steps": [{"time": 20.0, "size": -0.2}]}
    with pytest.raises(ValueError, match="backwards"):
        scene(recording=back)


# of Moon and Sun by ERFA's series (astropy 8.0 `get_body`, rotated to the Earth), attraction at the place less that at
# the centre, along the place's radius; rigid Earth, microgal
EPHEMERIS = [
    (0.0, 45.0, 0.0, 0.0, -8.84),
    (-3e8, 10.0, -60.0, 0.0, 97.03),
    (9.5e8, -35.0, 150.0, 0.0, -57.08),
    (1.2e9, 70.0, 25.0, 1000.0, -6.19),
    (1.5e9, 0.0, 100.0, 0.0, -40.31),
    (1.7e9, -80.0, -170.0, -30.0, -12.62),
]


@pytest.mark.parametrize(("time", "latitude", "longitude", "height", "microgal"), EPHEMERIS)
def test_tide_is_that_of_another_ephemeris(
    time: float, latitude: float, longitude: float, height: float, microgal: float
) -> None:
    assert tide(np.array([time]), latitude, longitude, height)[0] * 1e8 / 1.16 == pytest.approx(microgal, abs=0.3)


def test_tide_acts_as_a_change_of_gravity() -> None:
    place = {"latitude": 45.0, "longitude": 10.0, "height": 0.0}
    without, tidal = scene(motion=[]), scene(motion=[], conditions=place | {"tide": True})
    lost = float(np.mean(tide(946684800.0 + np.arange(60.0), 45.0, 10.0)))
    lighter = scene(motion=[], gravity=G - lost)
    assert abs(lost) > 1e-8
    assert np.abs(theta(tidal) - theta(lighter)).max() < 0.01 * np.abs(theta(without) - theta(lighter)).max()
    stated = synth.simulate(tidal)[0]["instrument"]
    assert {name: float(stated[name]) for name in place} == place


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"events": [EVENTS[0] | {"pendulum": "3"}]}, "name the pendulum '3'; there are 1, 2"),
        ({"events": [EVENTS[0] | {"time": 60.0}]}, "after the record's end"),
        ({"recording": {"errors": [{"trace": "2"}]}}, "name the trace '2'; there are 1, 1-2"),
        ({"conditions": {"tide": True, "latitude": 1.0}}, "tide needs latitude and longitude"),
        ({"case": {"roll": term(ROLL)}, "restoring": "linear", "motion": []}, "case.roll acts on real pendulums only"),
    ],
)
def test_scene_refuses_what_cannot_be(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        scene(**changes)


def test_planes_with_turbulent_air_are_refused() -> None:
    pendulums = [{"label": "1", "period": 1.0, "plane": 0.1, "quadratic_damping": 1e-3, "start": EVENT_FREE}]
    with pytest.raises(SceneError, match=r"pendulums.plane"):
        synth.simulate(scene(pendulums=pendulums, motion=[]))


EVENT_FREE = {"kind": "free", "amplitude": 0.01}
