from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import mpmath
import numpy as np
import pytest

import synth
from data_schemas import check, load_scene
from data_schemas.errors import SceneError
from data_schemas.scene import Scene
from synth import simulate

Maker = Callable[..., Scene]

TERMS = {
    "still": {"kind": "still"},
    "harmonics": {"kind": "harmonics", "amplitude": [0.1], "angular_frequency": [0.6]},
    "near-resonant": {"kind": "near-resonant", "amplitude": 8e-4, "beat_period": 30.0, "pendulum": "2"},
    "sea": {"kind": "sea", "significant_height": 3.0, "peak_period": 10.0, "depth": 20.0},
    "sea of its own seed": {
        "kind": "sea",
        "significant_height": 1.0,
        "peak_period": 7.0,
        "depth": 9.0,
        "seed": 5,
    },
}
EVERYTHING = {"noise": 1e-5, "jitter": 0.002, "drop_fraction": 0.1, "outliers": 3, "outlier_amplitude": 0.1}


@pytest.mark.parametrize("name", TERMS)
def test_every_term_alone_gives_a_valid_record_and_truth(make_scene: Maker, name: str) -> None:
    record, truth = simulate(make_scene(motion=[TERMS[name]]))
    assert check(record, "record") == []
    assert check(truth, "truth") == []
    at_rest = np.all(truth["truth/horizontal_acceleration"].values == 0)
    assert at_rest == (name == "still")


def test_terms_add(make_scene: Maker) -> None:
    start = {"kind": "free", "amplitude": 0.0}
    pendulums = [{"label": each, "period": period, "start": start} for each, period in (("1", 1.0), ("2", 1.1))]
    seas = [each for each in TERMS if each != "sea"]  # a sea without a seed is drawn by its place among the seas
    apart = [simulate(make_scene(pendulums=pendulums, motion=[TERMS[each]]))[1] for each in seas]
    together = simulate(make_scene(pendulums=pendulums, motion=[TERMS[each] for each in seas]))[1]
    for name in ("theta", "horizontal_acceleration"):
        total = sum(each[f"truth/{name}"].values for each in apart)
        np.testing.assert_allclose(together[f"truth/{name}"].values, total, rtol=0, atol=1e-15)


def test_four_months_read_each_half_hour(make_scene: Maker) -> None:
    """The swing's phase after 1e7 swings, from the exact product of the doubles; damping is seen from afar too."""
    start = {"kind": "free", "amplitude": 0.01, "phase": 0.3}
    pendulum = {"label": "1", "period": 1.0, "damping_rate": 1e-8, "start": start}
    recording = {"sampling_rate": "1/2000"}
    scene = make_scene(pendulums=[pendulum], motion=[], duration=1e7, gravity=9.81, recording=recording)
    _, truth = simulate(scene)
    times = truth["time"].values
    assert times[-1] == 1e7 - 2000
    with mpmath.workdps(50):
        rate, gamma = mpmath.mpf(2 * np.pi), mpmath.mpf(1e-8)
        own = mpmath.sqrt(rate**2 - gamma**2)
        exact = [float(mpmath.exp(-gamma * int(t)) * mpmath.cos(own * int(t) + mpmath.mpf(0.3))) for t in times]
    np.testing.assert_allclose(truth["truth/theta"].values[0], 0.01 * np.array(exact), rtol=0, atol=1e-16)


def test_same_seed_same_bits(make_scene: Maker) -> None:
    scene = make_scene(motion=list(TERMS.values()), recording=EVERYTHING)
    first, second = simulate(scene), simulate(scene)
    assert first[0].identical(second[0])
    assert first[1].identical(second[1])


def test_another_seed_another_record(make_scene: Maker) -> None:
    one, other = (simulate(make_scene(seed=seed, recording={"noise": 1e-5}))[0] for seed in (1, 2))
    assert not np.any(one["record/elongation"].values == other["record/elongation"].values)


def test_truth_is_free_plus_forced(make_scene: Maker) -> None:
    scene = make_scene(motion=list(TERMS.values()), recording=EVERYTHING)
    truth = simulate(scene)[1]["truth"]
    free = truth["free_amplitude"] * np.cos(truth["free_phase"])
    np.testing.assert_allclose(free + truth["forced"], truth["theta"], rtol=0, atol=1e-17)


def test_truth_phase_is_unwrapped_also_at_marks(make_scene: Maker) -> None:
    """Two readings a swing: the phase turns by more than half a turn a reading, and still runs on."""
    pendulum = {"label": "1", "period": 0.97, "start": {"kind": "free", "amplitude": 0.01, "phase": 0.4}}
    truth = simulate(make_scene(pendulums=[pendulum], recording={"marks": True}))[1]
    n = truth["truth/frequency"].item()
    phase = truth["truth/free_phase"].values[0]
    assert n * 0.5 > np.pi
    swell_free = 0.4 + n * truth["time"].values
    np.testing.assert_allclose(phase, swell_free, rtol=0, atol=1e-11)


def test_forced_part_is_slow(make_scene: Maker) -> None:
    """psi of a 10 s swell is that swell: a free start begins on the forced solution (P 10, 16)."""
    motion = [{"kind": "harmonics", "amplitude": [0.1], "angular_frequency": [0.6]}]
    scene = make_scene(motion=motion)
    truth = simulate(scene)[1]
    n = truth["truth/frequency"].values[0]
    expected = -(n**2) * 0.1 / scene.gravity / (n**2 - 0.36) * np.cos(0.6 * truth["time"].values)
    np.testing.assert_allclose(truth["truth/forced"].values[0], expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(truth["truth/free_amplitude"].values[0], 0.006, rtol=1e-12)


def test_frequency_follows_true_gravity(make_scene: Maker) -> None:
    """g = g_ref (n/n_ref)^2."""
    truth = simulate(make_scene(gravity=9.9, reference_gravity=9.8))[1]["truth"]
    period = np.array([1.00966, 1.00976])
    np.testing.assert_allclose(9.8 * (truth["frequency"] * period / (2 * np.pi)) ** 2, 9.9, rtol=1e-15)
    assert truth["gravity"].item() == 9.9


def test_vibration_is_placed_beside_the_pendulum_it_names(make_scene: Maker) -> None:
    """In exact resonance with the second, undamped, pendulum: its amplitude grows as n alpha t/(2 g)."""
    start = {"kind": "free", "amplitude": 0.0}
    pendulums = [{"label": each, "period": period, "start": start} for each, period in (("1", 1.0), ("2", 1.1))]
    motion = [{"kind": "near-resonant", "amplitude": 8e-4, "detuning": 0.0, "pendulum": "2"}]
    scene = make_scene(pendulums=pendulums, motion=motion)
    truth = simulate(scene)[1]["truth"]
    growth = truth["frequency"].values[1] * 8e-4 / scene.gravity / 2 * truth["time"].values
    np.testing.assert_allclose(truth["free_amplitude"].values[1], growth, rtol=0, atol=1e-16)
    # the first pendulum is 0.6 rad/s away and only beats: n alpha/g over that difference
    assert np.max(truth["free_amplitude"].values[0]) < 0.15 * growth[-1]


def test_truth_carries_the_scene(make_scene: Maker) -> None:
    scene = make_scene(motion=list(TERMS.values()), recording={"sampling_rate": "25/3", "missing": [[1, 2]]})
    truth = simulate(scene)[1]
    assert Scene.model_validate_json(truth.attrs["scene"]) == scene
    assert json.loads(truth.attrs["scene"])["recording"]["sampling_rate"] == "25/3"
    assert truth.attrs["seed"] == 11


def test_recorded_motion_of_all_frequencies(make_scene: Maker, tmp_path: Path) -> None:
    """A 10 Hz table of noise pushes at the pendulums' own frequency too: that part counts as free."""
    noise = np.random.default_rng(6).normal(scale=0.02, size=500)
    table = tmp_path / "push.csv"
    table.write_text("\n".join(f"{k / 10},{value!r}" for k, value in enumerate(noise.tolist())))
    term = {"kind": "tabulated", "file": str(table), "begin": 2.0}
    scene = make_scene(motion=[term, TERMS["harmonics"]], recording={"sampling_rate": 10})
    truth = simulate(scene)[1]["truth"]
    swell = 0.1 * np.cos(0.6 * truth["time"].values)
    np.testing.assert_allclose(truth["horizontal_acceleration"] - swell, noise[20:420], rtol=0, atol=1e-13)
    growth = truth["free_amplitude"].values
    assert growth[0, 0] == pytest.approx(0.006, rel=1e-12)
    assert np.ptp(growth[0]) > 0.003
    free = truth["free_amplitude"] * np.cos(truth["free_phase"])
    np.testing.assert_allclose(free + truth["forced"], truth["theta"], rtol=0, atol=1e-17)


def test_pendulum_that_hardly_swings(make_scene: Maker) -> None:
    """Beyond half its frequency a damping rate would cost the closed form its digits: it is integrated instead."""
    pendulum = {"label": "1", "period": 90.0, "damping_rate": 0.05, "start": {"kind": "state", "angle": 0.1}}
    truth = simulate(make_scene(pendulums=[pendulum], motion=[], recording={"sampling_rate": 1}))[1]
    time, n = truth.dataset["time"].values, float(truth["truth/frequency"].values[0])
    own = np.sqrt(n**2 - 0.05**2)
    swing = 0.1 * np.exp(-0.05 * time) * (np.cos(own * time) + 0.05 / own * np.sin(own * time))
    np.testing.assert_allclose(truth["truth/theta"].values[0], swing, rtol=0, atol=1e-13)
    assert truth.attrs["propagator"].startswith("explicit")


IN_CLOSED_FORM = {"linear", "ship"}


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name in IN_CLOSED_FORM else pytest.mark.compiled) for name in synth.scenes()],
)
def test_shipped_scenes(name: str) -> None:
    record, truth = simulate(load_scene(synth.scene_path(name)))
    assert check(record, "record") == []
    assert check(truth, "truth") == []
    assert record.attrs["record_id"] == name


@pytest.mark.parametrize("name", ["demo", "linear"])
def test_scene_is_what_it_promises(name: str) -> None:
    scene = load_scene(synth.scene_path(name))
    first, second = (pendulum.period for pendulum in scene.pendulums)
    assert (second - first) / first == pytest.approx(1e-4, rel=1e-3)
    assert scene.count == 45_000
    assert scene.restoring == ("linear" if name == "linear" else "sine")
    assert {term.axis for term in scene.motion} >= ({"vertical"} if name == "demo" else {"horizontal"})


def test_unknown_shipped_scene() -> None:
    with pytest.raises(SceneError, match="there are: clocks-on-beam, cruise, demo, "):
        synth.scene_path("absent")


def test_package_is_lazy_and_honest() -> None:
    films = ["expose", "expose_to", "film_truth_path", "films", "load_film"]
    scenes = ["scene_path", "scenes", "simulate", "simulate_ensemble", "simulate_to", "write_ensemble"]
    assert dir(synth) == films + scenes
    with pytest.raises(AttributeError, match="absent"):
        synth.absent  # noqa: B018  the look-up is the test
