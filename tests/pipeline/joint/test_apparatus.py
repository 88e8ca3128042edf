"""`joint` on records of an apparatus that is wrong: gravity within its sigma, and the fault named."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from scipy.interpolate import CubicSpline
from test_method import in_sigmas, record, row

from data_schemas.errors import RecordError, RefusedError
from pipeline.benchmarks.kinds import Case, case_of
from pipeline.benchmarks.records import of_case
from pipeline.joint.fit import reduce
from pipeline.joint.gather import _bias, _drift, _white, gather

pytestmark = pytest.mark.compiled


def changed(made: xr.DataTree, name: str, change: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> xr.DataTree:
    """A record with one of its variables changed: a function of time, s, and of the values."""
    time = made.dataset["time"].values
    stored = made["record"].dataset
    value = change(time, stored[name].values.copy())
    made["record"] = xr.DataTree(stored.assign({name: stored[name].copy(data=value)}))
    return made


def late(seconds: float) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    return lambda time, value: CubicSpline(time, value, axis=-1)(time - seconds)


def first(change: Callable[[np.ndarray, np.ndarray], np.ndarray], trace: int = 0) -> xr.DataTree:
    def of(time: np.ndarray, value: np.ndarray) -> np.ndarray:
        value[trace] = change(time, value[trace])
        return value

    return changed(record()[0], "elongation", of)


def heave(change: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> xr.DataTree:
    return changed(record()[0], "vertical_acceleration", change)


def clock() -> xr.DataTree:
    made = record()[0]
    root = made.to_dataset(inherit=False)
    time = root["time"].values
    stamped = root["time"].copy(data=time + 5e-3 * (time > 150.0))
    tree = {f"/{name}": made[name].to_dataset(inherit=False) for name in made.children}
    return xr.DataTree.from_dict({"/": root.assign_coords(time=stamped), **tree})


FAULTS: dict[str, tuple[Callable[[], xr.DataTree], str, float | None]] = {
    "zero of 3 mrad": (lambda: first(lambda time, value: value + 3e-3), "zero of trace 1", 3e-3),
    "zero that drifts": (lambda: first(lambda time, value: value + 4e-3 * time / 300.0), "drift of trace 1", 2e-3),
    "step of a zero": (lambda: first(lambda time, value: value + 1e-3 * (time > 100.02)), "step of trace 1", None),
    "step of the difference": (
        lambda: first(lambda time, value: value + 1e-3 * (time > 100.02), 1),
        "step of trace 2",
        None,
    ),
    "gain of 1 %": (lambda: first(lambda time, value: 1.01 * value), "", None),
    "delay of 10 ms": (lambda: first(late(0.01), 1), "delay of trace 2", 0.01),
    "bias of 20 mGal": (lambda: heave(lambda time, value: value + 2e-4), "", None),
    "heave of wrong sign": (lambda: heave(lambda time, value: -value), "scale of the heave", -2.0),
    "heave .3 s late": (lambda: heave(late(0.3)), "delay of the heave", 0.3),
    "clock's step of 5 ms": (clock, "", None),
    "steps of .3 mrad": (lambda: first(lambda time, value: 3e-4 * np.rint(value / 3e-4)), "", None),
    "clipped at 8 mrad": (lambda: first(lambda time, value: np.clip(value, -8e-3, 8e-3)), "", None),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_gravity_survives_a_fault_of_the_apparatus(fault: str) -> None:
    make, name, value = FAULTS[fault]
    found = row(make())
    gravity = record()[1]
    assert abs(in_sigmas(found, gravity)) < 3.5
    assert found["gravity_sigma_mgal"] < 20.0 * row(record()[0])["gravity_sigma_mgal"]
    assert name in found["choice_reason"]
    if value is not None:
        told = re.search(rf"{name}: (\S+) \+- ([\d.e-]+)", found["choice_reason"])
        assert told is not None
        assert abs(float(told[1]) - value) < 3.5 * float(told[2])


def test_cross_talk_is_weighed_against_a_period_that_is_wrong() -> None:
    """A percent of each pendulum in the other's trace turns their phases as a period does that is off by 2e-6."""
    both = [{"name": "1", "combination": {"1": 1.0}}, {"name": "2", "combination": {"2": 1.0}}]
    made, gravity = record(duration=900.0, recording={"traces": both})
    plain = row(made)
    found = row(changed(made, "elongation", lambda time, value: value + 0.01 * value[::-1]))
    assert abs(in_sigmas(plain, gravity)) < 3.5
    assert abs(in_sigmas(found, gravity)) < 3.5
    assert "cross-talk of the pendulums" in found["choice_reason"]
    assert found["gravity_sigma_mgal"] < 5.0


def test_the_scale_is_not_told_by_vertical_motion_that_is_not_known() -> None:
    swings = {"start": {"kind": "free", "amplitude": 0.02, "phase": 0.4}}
    rough = [
        {"kind": "harmonics", "amplitude": [0.15, 0.1], "period": [9.0, 7.0]},
        {"kind": "harmonics", "axis": "vertical", "amplitude": [0.2, 0.15], "period": [8.0, 7.2]},
    ]
    made, gravity = record(
        duration=900.0, pendulum=swings, motion=rough, recording={"vertical_acceleration": False, "noise": 5e-5}
    )
    plain = row(made)
    made["instrument"] = xr.DataTree(made["instrument"].to_dataset(inherit=False).assign(scale_uncertainty=0.01))
    found = row(made)
    assert abs(in_sigmas(found, gravity)) < 3.5
    # by the arcs alone: a fifth of the square of an amplitude of 20 mrad, a hundredth of it, is 1 mGal
    assert 0.5 < found["gravity_sigma_mgal"] < 3.0
    assert abs(found["gravity_m_s2"] - plain["gravity_m_s2"]) < 0.2e-5


def test_no_fault_is_named_where_there_is_none() -> None:
    assert "apparatus-fault" not in row(record()[0])["flags"]


@pytest.mark.parametrize("states", ["tilt", "acceleration"])
@pytest.mark.parametrize("degrees", [1.0, 5.0])
def test_a_case_that_tilts_is_allowed_for_where_something_tells_its_tilt(states: str, degrees: float) -> None:
    case = Case(duration=600.0, tilt=degrees, states_tilt=states)
    made = of_case(case, np.random.default_rng(17), "case")
    found = row(made.tree)
    assert abs(in_sigmas(found, made.gravity)) < 3.5
    assert found["gravity_sigma_mgal"] < 0.2


def test_a_case_whose_tilt_nothing_tells_is_refused() -> None:
    made = of_case(Case(duration=600.0, tilt=1.0, states_tilt="acceleration"), np.random.default_rng(1), "case").tree
    sway = made["record"]["horizontal_acceleration"].values.copy()
    made["record"]["horizontal_acceleration"].values[::2] = np.nan
    with pytest.raises(RefusedError, match="nothing tells how the case tilts"):
        row(made)
    made["record"]["horizontal_acceleration"].values[:] = sway
    made["instrument"].attrs["acceleration_frame"] = "case"
    with pytest.raises(RefusedError, match="nothing tells how the case tilts"):
        row(made)
    del made["record"].attrs["reference"]
    with pytest.raises(RefusedError, match="as the tilt of a case does"):
        row(made)


def test_a_small_tilt_that_nothing_tells_is_in_sigma() -> None:
    """.2 degrees, 3 mGal: refusing what is below 10 mGal cost three sound films of nine."""
    base = case_of("case tilts, recorded", "weak")
    made = of_case(replace(base, tilt=0.2, states_tilt=""), np.random.default_rng(2), "unsaid")
    found = row(made.tree)
    assert abs(in_sigmas(found, made.gravity)) < 2.0
    assert 0.3 < found["gravity_sigma_mgal"] < 5.0


def test_a_tilt_recorded_beside_elongations_from_the_vertical_is_not_added() -> None:
    made = of_case(Case(duration=600.0, tilt=1.0), np.random.default_rng(17), "case").tree
    made["record"].attrs["reference"] = "vertical"
    plain = made["record"]["elongation"].values
    traces = gather(made).problem.lattice
    assert np.array_equal(traces.value[traces.trace == 0], plain[0])


def test_linear_pendulums_are_read_from_any_case() -> None:
    made = of_case(
        Case(duration=600.0, tilt=1.0, states_tilt="acceleration", linear=True), np.random.default_rng(17), ""
    )
    assert abs(in_sigmas(row(made.tree), made.gravity)) < 3.5


def test_a_wrong_scale_of_all_angles_is_told_by_the_arcs() -> None:
    case = Case(duration=900.0, noise=1e-6, gain_all=0.02, amplitudes=(0.03, 0.02))
    made = of_case(case, np.random.default_rng(5), "scale")
    found = row(made.tree)
    assert "scale of all angles" in found["choice_reason"]
    assert abs(in_sigmas(found, made.gravity)) < 3.5


def test_cubic_optics_are_found_and_named() -> None:
    """x + 10 x^3: .1 % at 12 mrad, which a gain does not stand for."""
    made = of_case(Case(duration=600.0, cubic=10.0), np.random.default_rng(23), "cubic")
    found = row(made.tree)
    assert abs(in_sigmas(found, made.gravity)) < 3.5
    value, sigma = re.search(r"cubic error of the angles: ([\d.]+) \+- ([\d.]+)", found["choice_reason"]).groups()
    assert abs(float(value) - 10.0) < 4.0 * float(sigma)


def test_planes_of_swing_that_are_not_parallel_are_allowed_for() -> None:
    made = of_case(Case(duration=600.0, plane=0.02), np.random.default_rng(5), "planes")
    assert abs(in_sigmas(row(made.tree), made.gravity)) < 3.5
    assert "transverse" in {each.axis for each in reduce(gather(made.tree)).fit.model.assumed.ship}


def test_pendulums_that_are_held_at_first_are_left_out() -> None:
    made = of_case(Case(duration=400.0, released=20.0), np.random.default_rng(5), "released")
    found = row(made.tree)
    assert abs(in_sigmas(found, made.gravity)) < 3.5
    assert "stands still from 0 to" in found["choice_reason"]


def test_a_damping_stated_wrong_is_found_and_named() -> None:
    made = of_case(Case(duration=900.0, damping_error=0.5), np.random.default_rng(6), "damping")
    found = row(made.tree)
    assert "other damping than stated" in found["choice_reason"]
    assert abs(in_sigmas(found, made.gravity)) < 3.5
    assert found["gravity_sigma_mgal"] < 0.2


def told(made: xr.DataTree, group: str, name: str, change: Callable[[np.ndarray], np.ndarray]) -> xr.DataTree:
    """A record that says something else."""
    stored = made[group].dataset
    made[group] = xr.DataTree(stored.assign({name: stored[name].copy(data=change(stored[name].values))}))
    return made


WRONG: dict[str, tuple[str, str, Callable[[np.ndarray], np.ndarray], str]] = {
    "millimetres": ("record", "elongation", lambda value: 1e3 * value, "give elongations in rad"),
    "degrees": ("record", "elongation", np.degrees, r"unit of the elongations \(rad\)"),
    "a period in ms": ("instrument", "period", lambda value: 1e-3 * value, "give times and periods in s"),
    "heave in mGal": ("record", "vertical_acceleration", lambda value: 1e5 * value, "give m s-2"),
    "gravity in mGal": ("instrument", "reference_gravity", lambda value: 1e5 * value, "no planet's"),
    "a pendulum for a difference": (
        "record",
        "elongation",
        lambda value: np.stack([value[0], value[0] - value[1]]),
        "trace '1-2' has .1.00 of the slow motion of '1'",
    ),
    "traces exchanged": ("record", "elongation", lambda value: value[::-1].copy(), "say which pendulums"),
    "a difference for a pendulum": ("record", "combination", lambda value: np.eye(2), "say which pendulums"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_units_and_labels_that_cannot_be_meant_are_refused_with_the_remedy(wrong: str) -> None:
    group, name, change, words = WRONG[wrong]
    with pytest.raises(RefusedError, match=words):
        row(told(record()[0], group, name, change))


def test_exchanged_traces_are_refused_at_marks_too() -> None:
    made, _ = record()
    every = round(0.5 / float(np.median(np.diff(made["time"].values))))
    sparse = made.isel(time=slice(None, None, every))
    assert row(sparse)["status"] == "ok"
    with pytest.raises(RefusedError, match="a difference, sways with the ship"):
        row(told(sparse, "record", "elongation", lambda value: value[::-1].copy()))


def test_gravity_in_a_recorded_heave_is_its_bias() -> None:
    made, gravity = record()
    found = row(told(made, "record", "vertical_acceleration", lambda value: value + 9.8))
    assert abs(in_sigmas(found, gravity)) < 3.5


@pytest.mark.parametrize("begins", [False, True])
def test_a_heave_that_is_recorded_for_a_part_is_not_drawn_on(begins: bool) -> None:
    made, gravity = record()
    found = row(
        changed(made, "vertical_acceleration", lambda time, value: np.where((time > 150.0) == begins, value, np.nan))
    )
    assert found["status"] == "ok"
    assert abs(in_sigmas(found, gravity)) < 3.5
    assert found["gravity_sigma_mgal"] < 5.0


def test_what_two_traces_hold_alike_for_long_is_left_out_of_both() -> None:
    def copied(time: np.ndarray, value: np.ndarray) -> np.ndarray:
        value[1] = np.where((time > 60.0) & (time < 90.0), value[0], value[1])
        return value

    made, gravity = record()
    found = row(changed(made, "elongation", copied))
    assert abs(in_sigmas(found, gravity)) < 3.5
    assert found["gravity_sigma_mgal"] < 20.0 * row(record()[0])["gravity_sigma_mgal"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda time, value: np.stack([value[0], value[0]]), "hold the same values"),
        (lambda time, value: 5e-3 * np.rint(value / 5e-3), "too coarse"),
    ],
)
def test_traces_that_are_one_and_readings_too_coarse_are_refused(
    change: Callable[[np.ndarray, np.ndarray], np.ndarray], words: str
) -> None:
    with pytest.raises(RefusedError, match=words):
        row(changed(record()[0], "elongation", change))


def test_a_trace_that_stands_still_is_named() -> None:
    def dead(time: np.ndarray, value: np.ndarray) -> np.ndarray:
        return np.where(time > 200.0, np.random.default_rng(3).normal(scale=1e-5, size=time.size), value)

    gravity = record()[1]
    found = row(first(dead, trace=1))
    assert "stands still from 200 to 300 s" in found["choice_reason"]
    assert "apparatus-fault" in found["flags"]
    assert abs(in_sigmas(found, gravity)) < 3.5


@pytest.mark.parametrize("lost", [0.0, 0.3])
def test_noise_of_a_recorded_heave_is_told_at_any_times(lost: float) -> None:
    random = np.random.default_rng(8)
    time = 0.1 * np.arange(18000)
    heave = 0.02 * np.sin(0.8 * time) + 0.01 * np.cos(1.1 * time) + random.normal(scale=2e-6, size=time.size)
    there = random.random(time.size) >= lost
    spacing = np.diff(time[there])
    expected = 2e-6 * np.sqrt(np.sum(spacing**2) / np.sum(spacing))
    assert _white(time[there], heave[there]) == pytest.approx(expected, rel=0.05)


def test_bias_of_a_recorded_heave_is_not_doubted_for_its_noise() -> None:
    random = np.random.default_rng(9)
    time = 0.1 * np.arange(18000)
    heave = 3e-4 + 0.02 * np.sin(0.8 * time) + random.normal(scale=2e-6, size=time.size)
    found, doubt = _bias(heave, 2e-6)
    assert found == pytest.approx(3e-4, abs=1e-7)
    assert doubt < 2e-8
    assert _bias(heave + 1e-5 * np.sin(2.0 * np.pi * 9.0 * time / time[-1]), 2e-6)[1] > 1e-6


def test_a_record_without_readings_is_refused_in_one_line() -> None:
    with pytest.raises(RecordError, match="no trace has a reading"):
        gather(changed(record()[0], "elongation", lambda time, value: np.full_like(value, np.nan)))


@pytest.mark.parametrize(("every", "error"), [(np.inf, 3e-5), (900.0, 3e-5), (200.0, 0.0)])
def test_bias_of_the_heave_is_followed_below_the_sea(every: float, error: float) -> None:
    time = np.arange(0.0, 1800.0, 0.25)
    bias = 0.003 * (time / 1800.0) ** 2 - 0.002 * np.exp(-time / 600.0)
    heave = bias + 0.02 * np.cos(0.5 * time) + 0.01 * np.cos(0.83 * time + 1.0)
    heave[(time + 3.0) % every < 6.0] = np.nan
    found, _ = _drift(time, heave)
    if error:
        known = np.isfinite(heave)
        assert found - found[known].mean() == pytest.approx(bias - bias[known].mean(), abs=error)
    else:  # gaps leave no taper
        assert not found.any()
    short = slice(0, 480)  # 120 s: a taper of that length lets the sea pass
    assert not _drift(time[short], heave[short])[0].any()


@pytest.mark.parametrize("rate", [4.0, 25.0])
def test_an_accelerometers_bias_that_drifts_is_no_gravity(rate: float) -> None:
    case = Case(duration=900.0, rate=rate, noise=1e-5, swell=(0.01, 0.01), states_heave=True)
    made = of_case(case, np.random.default_rng(7), "drift")
    drawn = np.random.default_rng(8).standard_normal

    def drifting(heave: np.ndarray) -> np.ndarray:
        since = np.linspace(0.0, 1.0, heave.size)
        return heave + 0.03 + 0.006 * since**2 + 1e-4 * drawn(heave.size)

    found = row(told(made.tree, "record", "vertical_acceleration", drifting))
    assert abs(in_sigmas(found, made.gravity)) < 3.5
    assert found["gravity_sigma_mgal"] < 1.5
    assert "bias" not in found["choice_reason"]
