"""Random kicks: the law of the walk, the impulses against other integrators, and what stays as it is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import synth_mechanics
import xarray as xr
from scipy.integrate import solve_ivp

import synth
from data_schemas import content_sha256
from data_schemas.scene import Scene
from synth.disturbances import Kicks
from synth.plan import plan
from synth.recording.clock import set_clock

K = 1e-5
N = 2 * np.pi
SWELL = {"kind": "harmonics", "amplitude": [0.2, 0.1], "period": [9.0, 6.0], "phase": [0.3, 1.0]}
HEAVE = SWELL | {"axis": "vertical", "phase": [2.0, 0.1]}


def pendulum(label: str, angle: float, **given: Any) -> dict[str, Any]:
    return {"label": label, "period": 1.0, "kick_intensity": K, "start": {"kind": "state", "angle": angle}} | given


def scene(pendulums: list[dict[str, Any]], **changes: Any) -> Scene:
    given: dict[str, Any] = {
        "record_id": "kicked",
        "seed": 5,
        "duration": 20.0,
        "gravity": 9.81,
        "restoring": "linear",
        "pendulums": pendulums,
        "recording": {"sampling_rate": 10, "traces": [{"name": "1", "combination": {"1": 1}}]},
    }
    return Scene.model_validate(given | changes)


def theta(truth: xr.DataTree) -> np.ndarray:
    return np.asarray(truth["truth"]["theta"].values)


def drawn(of: Scene) -> Kicks:
    found = plan(of, set_clock(of)).kicks
    assert found is not None
    return found


def by_pieces(of: Scene, start: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Angles by DOP853 from impulse to impulse, (pendulums, samples)."""
    kicks = drawn(of)
    step, count = float(kicks.step), int(time[-1] / kicks.step) + 1
    slope = synth_mechanics._fixed(of)
    rates = kicks.changes(0, count)[2] * np.array([2 * np.pi / each.period for each in of.pendulums])[:, None]
    states, state = np.empty((time.size, start.size)), start.copy()
    for j in range(count):
        here = np.flatnonzero((time >= j * step) & (time < (j + 1) * step))
        span = (j * step, (j + 1) * step)
        found = solve_ivp(slope, span, state, "DOP853", [*time[here], span[1]], rtol=2.3e-14, atol=1e-18)
        states[here], state = found.y.T[:-1], found.y[:, -1].copy()
        state[1::2] += rates[:, j]
    return states[:, ::2].T


@pytest.mark.compiled
@pytest.mark.parametrize(
    "recording", [{"sampling_rate": 25}, {"sampling_rate": 2}, {"sampling_rate": 10, "jitter": 0.02}]
)
def test_variance_grows_alike_at_any_sampling(recording: dict[str, Any]) -> None:
    """Of a pendulum at rest E theta^2 = k^2 (t/2 - sin(2 n t)/(4 n)), so that E |z|^2 = k^2 t."""
    many = [pendulum(f"{i}", 0.0) for i in range(100)]
    squares, count = 0.0, 0
    for seed in range(4):
        of = scene(many, seed=seed, duration=400.0, recording=recording)
        _, truth = synth.simulate(of)
        time = truth["time"].values
        late = time > 200.0
        expected = K**2 * (time / 2 - np.sin(2 * N * time) / (4 * N))
        squares += float(np.sum(np.mean(theta(truth)[:, late] ** 2 / expected[late], axis=1)))
        count += len(many)
    # the mean of a squared walk over its later half scatters by 0.9 of itself, at half seconds, which show one
    # quadrature of the swing alone, by 1.4 (measured); 3 sigmas of that
    assert squares / count == pytest.approx(1.0, abs=3 * 1.4 / np.sqrt(count))


@pytest.mark.compiled
def test_slope_of_the_phase_scatters_as_the_law_says() -> None:
    """1 sigma of the phase's regression slope is .77 k/(a sqrt(T)) (physics of a random walk, variance 6/5 q/T)."""
    amplitude, duration = 0.02, 400.0
    many = [pendulum(f"{i}", amplitude) for i in range(100)]
    slopes = []
    for seed in range(4):
        _, truth = synth.simulate(scene(many, seed=seed, duration=duration))
        time = truth["time"].values
        blocks = (theta(truth) * np.exp(-1j * N * time)).reshape(100, -1, 10).mean(axis=2)  # one swing each
        phase = np.unwrap(np.angle(blocks), axis=1)
        slopes += list(np.polyfit(np.arange(phase.shape[1]) + 0.45, phase.T, 1)[0])
    expected = np.sqrt(0.6) * K / (amplitude * np.sqrt(duration))
    assert np.std(slopes) == pytest.approx(expected, rel=4 / np.sqrt(2 * len(slopes)))  # 4 sigmas of a deviation


def test_impulses_stand_for_white_noise_within_what_is_stated() -> None:
    of = scene([pendulum("1", 0.0)])
    step = float(drawn(of).step)
    assert step <= 1 / 16
    for time in (5.0, 60.0, 601.3):
        instants = step * np.arange(1, int(time / step) + 1)
        impulses = step * np.sum(np.sin(N * (time - instants)) ** 2)
        white = time / 2 - np.sin(2 * N * time) / (4 * N)
        assert abs(impulses / white - 1) <= step / time  # h/(2 t), and as much for the sample's place among impulses


@pytest.mark.compiled
def test_linear_answer_is_the_sum_of_all_impulses() -> None:
    """Superposition, without any integrator: exp(-gamma t) sin(omega t)/omega for each impulse."""
    of = scene([pendulum("1", 0.0, damping_rate=0.01), pendulum("2", 0.0, period=1.01, kick_intensity=0.0)])
    _, truth = synth.simulate(of)
    time, kicks = truth["time"].values, drawn(of)
    after = time[:, None] - float(kicks.step) * np.arange(1, 401)
    omega = np.sqrt(N**2 - 0.01**2)
    answer = np.where(after > 0, np.exp(-0.01 * after) * np.sin(omega * after) / omega, 0.0)
    np.testing.assert_allclose(theta(truth)[0], answer @ kicks.changes(0, 400)[2, 0] * N, rtol=0, atol=1e-12 * K)
    assert not theta(truth)[1].any()
    np.testing.assert_array_equal(truth["truth/kick_intensity"].values, [K, 0.0])


RESISTED = {"quadratic_damping": 0.05, "knife_edge": {"friction": 1e-4, "rate": 0.02}}


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("resisted", "propagator", "recording"),
    [
        ({}, "Picard collocation", {"sampling_rate": 10}),
        ({}, "Picard collocation", {"sampling_rate": 7, "jitter": 0.01}),
        (RESISTED, "explicit, order 8", {"sampling_rate": 10, "drop_fraction": 0.1}),
    ],
)
def test_sine_law_against_another_integrator(
    resisted: dict[str, Any], propagator: str, recording: dict[str, Any]
) -> None:
    """Kicks of 1e-5, heave, changing gravity and, where stated, friction, all at once."""
    pendulums = [pendulum("1", 0.02, damping_rate=1e-3, **resisted), pendulum("2", -0.03, period=1.01, **resisted)]
    course = {"kind": "linear", "rate": 4e-4}
    of = scene(pendulums, restoring="sine", motion=[SWELL, HEAVE], gravity_course=course, recording=recording)
    _, truth = synth.simulate(of)
    assert truth.attrs["propagator"] == propagator
    expected = by_pieces(of, np.array([0.02, 0.0, -0.03, 0.0]), truth["time"].values)
    # of the largest angle: rounding of some thousand steps of order 8; the tolerance of a scene with kinks
    limit = 1e-11 if resisted else 2e-12
    assert np.abs(theta(truth) - expected).max() < limit * np.abs(expected).max()


@pytest.mark.compiled
def test_propagators_and_seeds() -> None:
    """The same seed is the same motion by whichever propagator; another seed is another."""
    pendulums = [pendulum("1", 0.02), pendulum("2", 0.7, kick_intensity=1e-4)]  # a large arc: with a shadow
    of = scene(pendulums, restoring="sine", motion=[SWELL])
    one, again, other = (theta(synth.simulate(each)[1]) for each in (of, of, of.model_copy(update={"seed": 6})))
    assert np.array_equal(one, again)
    assert np.abs(one - other).max() > 1e-6
    explicit = Scene.model_validate(of.model_dump() | {"simulation": {"propagator": "explicit"}})
    np.testing.assert_allclose(theta(synth.simulate(explicit)[1]), one, rtol=0, atol=1e-12)


@pytest.mark.compiled
def test_short_intervals_of_violent_motion_get_the_same_impulses() -> None:
    """Vibration at 30 Hz needs intervals shorter than the step of impulses."""
    shaken = {"kind": "harmonics", "amplitude": [20.0], "period": [1 / 30]}
    of = scene([pendulum("1", 0.3)], restoring="sine", motion=[shaken | {"axis": "vertical"}, shaken], duration=5.0)
    _, truth = synth.simulate(of)
    assert truth.attrs["propagator"] == "Picard collocation"
    np.testing.assert_allclose(
        theta(truth), by_pieces(of, np.array([0.3, 0.0]), truth["time"].values), rtol=0, atol=1e-11
    )


@pytest.mark.compiled
def test_file_by_chunks_is_the_record_in_memory(tmp_path: Path) -> None:
    of = scene([pendulum("1", 0.02)], restoring="sine", duration=7000.0)
    paths = [tmp_path / f"a.{kind}.nc" for kind in ("record", "truth")]
    synth.simulate_to(of, *paths)
    for path, tree in zip(paths, synth.simulate(of), strict=True):
        assert h5py.File(path).attrs["content_sha256"] == content_sha256(tree)


def test_no_kicks_no_trace_of_them() -> None:
    _, truth = synth.simulate(scene([pendulum("1", 0.02, kick_intensity=0.0)]))
    assert truth.attrs["propagator"] == "closed form"
    assert "kick_intensity" not in truth["truth"]


def test_kicks_on_a_support_that_yields_are_refused() -> None:
    with pytest.raises(ValueError, match="kick_intensity acts on pendulums on a fixed support only"):
        scene([pendulum("1", 0.1)], restoring="sine", support={"kind": "board", "coupling": 0.1})
