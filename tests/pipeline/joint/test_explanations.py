"""`joint` on records that only one explanation fits: friction of each knife, a support that yields, noisy heave."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp
from test_method import in_sigmas, record, row

from data_schemas.errors import RefusedError
from pipeline.benchmarks.kinds import Case
from pipeline.benchmarks.records import Made, of_case
from pipeline.joint.gather import gather

pytestmark = pytest.mark.compiled


def made(duration: float = 600.0, **fields: object) -> Made:
    return of_case(Case(duration=duration, **fields), np.random.default_rng(39), "explained")


def test_friction_of_each_knife_edge_is_its_own() -> None:
    """One knife is ten times as blunt: neither kicks nor a motion of the ship stand for the difference."""
    of = made(friction=np.array([4e-5, 4e-6]), swell=(1e-5, 0.0))
    found = row(of.tree)
    assert "friction-not-viscous" in found["flags"]
    assert found["gravity_sigma_mgal"] < 0.5
    assert abs(in_sigmas(found, of.gravity)) < 4.0


@pytest.mark.parametrize("noise", [1e-3, 3e-2])
def test_noise_of_a_recorded_heave_does_not_reach_gravity(noise: float) -> None:
    """What an accelerometer adds is not felt by the pendulums, which tell it from the ship's own motion."""
    of = made(swell=(0.05, 0.05), states_heave=True, heave_noise=noise)
    found = row(of.tree)
    assert gather(of.tree).problem.heave is None
    assert found["gravity_sigma_mgal"] < 0.3  # as a force it would be 20 mGal for the larger noise
    assert abs(in_sigmas(found, of.gravity)) < 4.0


@pytest.mark.parametrize("change", ["scale", "delay"])
def test_noisy_heave_may_have_a_wrong_scale_or_come_late(change: str) -> None:
    faults = {"scale": {"heave_scale": 1.2}, "delay": {"heave_delay": 0.1}}
    of = made(swell=(0.05, 0.05), states_heave=True, heave_noise=5e-3, **faults[change])
    assert abs(in_sigmas(row(of.tree), of.gravity)) < 4.0


@pytest.mark.campaign
def test_noisy_heave_of_wrong_sign_is_refused() -> None:
    of = made(300.0, swell=(0.05, 0.1), states_heave=True, heave_noise=5e-3, heave_scale=-1.0)
    with pytest.raises(RefusedError):
        row(of.tree)


def test_difference_of_reversed_sign_is_refused() -> None:
    tree, _ = record(duration=900.0)
    stored = tree["record"].dataset
    value = stored["elongation"].values * np.array([[1.0], [-1.0]])
    tree["record"] = xr.DataTree(stored.assign(elongation=stored["elongation"].copy(data=value)))
    with pytest.raises(RefusedError, match="sign of trace 2"):
        row(tree)


def test_support_that_yields_leaves_gravity_alone() -> None:
    """The support sways by -1e-5 of the sum of both elongations: neither damping nor period stands for it."""
    tree, gravity = record()
    time, kappa, damping, sway = tree.dataset["time"].values, (2.0 * np.pi / np.array([1.01, 1.0101])) ** 2, 1e-4, -1e-5
    over_reference = gravity / float(tree["instrument"].dataset["reference_gravity"])

    def rates(t: float, state: np.ndarray) -> np.ndarray:
        angle, speed = state[:2], state[2:]
        across = 5e-3 * np.cos(2.0 * np.pi * t / 9.0) + 3e-3 * np.cos(2.0 * np.pi * t / 7.0 + 1.0) + sway * angle.sum()
        pull = over_reference * np.sin(angle) + across * np.cos(angle)
        return np.concatenate([speed, -2.0 * damping * speed - kappa * pull])

    path = solve_ivp(rates, (0.0, time[-1]), [0.012, -0.004, 0.0, 0.05], "DOP853", time, rtol=1e-11, atol=1e-13).y
    traces = np.stack([path[0], path[0] - path[1]]) + 1e-5 * np.random.default_rng(5).normal(size=(2, time.size))
    stored = tree["record"].dataset.drop_vars("vertical_acceleration")
    tree["record"] = xr.DataTree(stored.assign(elongation=stored["elongation"].copy(data=traces)))
    found = row(tree)
    assert found["gravity_sigma_mgal"] < 0.5
    assert abs(in_sigmas(found, gravity)) < 4.0


@pytest.mark.parametrize(
    ("size", "aside", "stated"), [(2.2e-5, 3e-4, 0.8), pytest.param(4e-4, 2e-3, 1.3, marks=pytest.mark.campaign)]
)
def test_line_near_the_swing_hides_no_wrong_damping(size: float, aside: float, stated: float) -> None:
    swings = [(1.00977, 0.009, 4.3), (1.0098, 0.0117, 2.8)]
    pendulums = [
        {"label": str(k), "period": period, "damping_rate": 2e-4}
        | {"start": {"kind": "free", "amplitude": amplitude, "phase": phase}}
        for k, (period, amplitude, phase) in enumerate(swings, 1)
    ]
    rng = np.random.default_rng(3)
    sea = {"amplitude": [0.007] * 40, "period": (1.0 / np.abs(0.1 + 0.025 * rng.standard_normal(40))).tolist()}
    sea["phase"] = rng.uniform(0.0, 6.28, 40).tolist()
    line = {"amplitude": [size], "period": [1.0098 / (1.0 + aside)], "phase": [2.0]}
    motion = [{"kind": "harmonics"} | each for each in (sea, line)]
    recording = {"noise": 3.7e-6, "sampling_rate": 25, "vertical_acceleration": False}
    tree, true = record(pendulums=pendulums, motion=motion, recording=recording)
    instrument = tree["instrument"].dataset
    tree["instrument"] = xr.DataTree(instrument.assign(damping_rate=stated * instrument["damping_rate"]))
    found = row(tree)
    assert abs(in_sigmas(found, true)) < 3.5
    assert found["gravity_sigma_mgal"] < 5.0


@pytest.mark.parametrize(
    ("size", "aside"),
    [
        (1e-4, 0.0),
        *(pytest.param(*each, marks=pytest.mark.campaign) for each in [(1e-6, 0.0), (1e-5, 0.0), (3e-4, 1e-4)]),
    ],
)
def test_vertical_line_at_twice_the_swing_is_no_gravity(size: float, aside: float) -> None:
    """Unrecorded, it changes both frequencies and dampings: friction, kicks and a delay together look like it."""
    line = {"axis": "vertical", "amplitude": [9.81 * size], "period": [0.505 * (1.0 + aside)], "phase": [0.7]}
    swell = {"amplitude": [0.05, 0.03], "period": [9.0, 7.0]}
    motion = [{"kind": "harmonics"} | each for each in (line, swell)]
    tree, true = record(duration=900.0, motion=motion, recording={"vertical_acceleration": False})
    found = row(tree)
    assert abs(in_sigmas(found, true)) < 3.5
    assert found["gravity_sigma_mgal"] < 0.5
    # one of 1e-6 moves gravity by .36 mGal, and kicks stand for it as well as it does
    assert size < 1e-5 or "vertical motion at 1.98 Hz" in found["choice_reason"]
