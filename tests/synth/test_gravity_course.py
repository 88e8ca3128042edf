"""Gravity that changes over the record: the equation of motion in both laws, its truth, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import synth_mechanics
import xarray as xr
from scipy.integrate import solve_ivp

import synth
from data_schemas import check
from data_schemas.errors import SceneError
from data_schemas.scene import Scene, load_scene

SWELL = {"kind": "harmonics", "amplitude": [0.2, 0.1], "period": [9.0, 6.0], "phase": [0.3, 1.0]}
HEAVE = SWELL | {"axis": "vertical", "phase": [2.0, 0.1]}
COURSES: dict[str, dict[str, Any]] = {
    "linear": {"kind": "linear", "rate": 4e-4},
    "sine": {"kind": "sine", "amplitude": 9e-3, "period": 13.0, "phase": 0.4},
}


def scene(**changes: Any) -> Scene:
    given: dict[str, Any] = {
        "record_id": "course",
        "duration": 20.0,
        "gravity": 9.8054321,
        "restoring": "sine",
        "pendulums": [
            {"label": "1", "period": 1.0096, "damping_rate": 2e-4, "start": {"kind": "state", "angle": 0.02}},
            {"label": "2", "period": 1.0097, "damping_rate": 1e-4, "start": {"kind": "state", "angle": -0.01}},
        ],
        "motion": [SWELL, HEAVE] if changes.get("restoring") != "linear" else [SWELL],
        "recording": {"sampling_rate": 10},
    }
    return Scene.model_validate(given | changes)


def value(truth: xr.DataTree, name: str) -> np.ndarray:
    return np.asarray(truth["truth"][name].values)


def independent(of: Scene, time: np.ndarray) -> np.ndarray:
    """Angles by DOP853 at its tightest, a part in 2e-14 a step."""
    start = np.array([0.02, 0.0, -0.01, 0.0])
    slope = synth_mechanics._fixed(of)
    return solve_ivp(slope, (0.0, time[-1]), start, "DOP853", time, rtol=2.3e-14, atol=1e-18, max_step=0.1).y[::2]


@pytest.mark.compiled
@pytest.mark.parametrize("course", COURSES)
@pytest.mark.parametrize("restoring", ["linear", "sine"])
@pytest.mark.parametrize("jitter", [0.0, 0.02])
def test_theta_obeys_its_equation(course: str, restoring: str, jitter: float) -> None:
    of = scene(restoring=restoring, gravity_course=COURSES[course], recording={"sampling_rate": 10, "jitter": jitter})
    _, truth = synth.simulate(of)
    assert truth.attrs["propagator"] == "Picard collocation"
    expected = independent(of, truth["time"].values)
    # rounding of 200 steps of order 8, in a swing that a change of 1e-3 moves by 0.1 rad of phase
    assert np.abs(value(truth, "theta") - expected).max() < 1e-12 * np.abs(expected).max()


@pytest.mark.compiled
def test_explicit_integrator_agrees_with_friction() -> None:
    """Quadratic and knife-edge friction, which collocation does not know, under both kinds of change."""
    resisted = {"quadratic_damping": 0.05, "knife_edge": {"friction": 1e-4, "rate": 0.02}}
    pendulums = [each.model_dump() | resisted for each in scene().pendulums]
    for course in COURSES.values():
        of = scene(pendulums=pendulums, gravity_course=course)
        _, truth = synth.simulate(of)
        assert truth.attrs["propagator"] == "explicit, order 8"
        # the tolerance of a scene with kinks is 1e-11
        np.testing.assert_allclose(value(truth, "theta"), independent(of, truth["time"].values), rtol=0, atol=1e-12)


@pytest.mark.compiled
def test_truth_states_the_course_and_its_mean() -> None:
    for course in COURSES.values():
        of = scene(gravity_course=course, recording={"sampling_rate": 100})
        record, truth = synth.simulate(of)
        assert check(record, "record") == check(truth, "truth") == []
        time = truth["time"].values
        expected = np.array([synth_mechanics.gravity(of, each) for each in time])
        np.testing.assert_allclose(value(truth, "gravity_course"), expected, rtol=4e-16)
        mean = np.trapezoid(expected, time) / time[-1]
        assert value(truth, "gravity") == pytest.approx(mean, rel=1e-9)  # trapezoid of 2000 samples
        frequency = 2 * np.pi / np.array([1.0096, 1.0097]) * np.sqrt(value(truth, "gravity") / 9.81)
        np.testing.assert_allclose(value(truth, "frequency"), frequency, rtol=1e-15)
        still = synth.simulate(scene(recording={"sampling_rate": 100}))[1]
        assert np.array_equal(value(truth, "vertical_acceleration"), value(still, "vertical_acceleration"))


def test_even_change_is_even_for_days() -> None:
    from synth.disturbances import gravity_change
    from synth.motion.harmonic_sum import HarmonicSum
    from synth.plan import plan
    from synth.recording.clock import set_clock

    of = scene(restoring="linear", duration=1e6, gravity_course={"kind": "linear", "rate": 5e-9})
    clock = set_clock(of)
    change = gravity_change(of, clock.true_end)
    assert isinstance(change, HarmonicSum)
    found = clock.times.acceleration(change)
    expected = 5e-9 * clock.true_seconds
    assert np.abs(found - expected).max() < 1e-13 * expected[-1]
    assert plan(of, clock).mean_change == pytest.approx(0.5 * expected[-1], rel=1e-13)


@pytest.mark.compiled
def test_table_is_read_as_a_motion_is(tmp_path: Path) -> None:
    seconds = np.arange(0.0, 31.0)
    milligals = 40.0 * np.sin(seconds / 9.0)
    (tmp_path / "track.csv").write_text("\n".join(f"{t},{g}" for t, g in zip(seconds, milligals, strict=True)))
    text = """record_id = "table"\nduration = 30.0\ngravity = 9.81\nrestoring = "sine"
        pendulums = [{ label = "1", period = 1.0, start = { kind = "free", amplitude = 0.01 } }]
        gravity_course = { kind = "table", file = "track.csv", factor = FACTOR }
        recording = { sampling_rate = 10, traces = [{ name = "1", combination = { 1 = 1 } }] }"""
    (tmp_path / "scene.toml").write_text(text.replace("FACTOR", "1e-5"))
    _, truth = synth.simulate(load_scene(tmp_path / "scene.toml"))
    np.testing.assert_allclose(value(truth, "gravity_course")[::10], 9.81 + 1e-5 * milligals[:-1], rtol=0, atol=1e-14)
    (tmp_path / "scene.toml").write_text(text.replace("FACTOR", "1.0"))
    with pytest.raises(SceneError, match=r"changes gravity by .* gravity_course\.factor"):
        synth.simulate(load_scene(tmp_path / "scene.toml"))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"gravity_course": {"kind": "linear", "rate": 1e-2}}, "changes gravity by 0.2 m/s.2, above 0.01 of it"),
        ({"gravity_course": {"kind": "sine", "amplitude": 0.2, "period": 60.0}}, "make it smaller"),
        ({"gravity_course": COURSES["sine"], "support": {"kind": "board", "coupling": 0.1}}, "on a fixed support only"),
    ],
)
def test_impossible_course_is_refused(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        scene(**changes)
