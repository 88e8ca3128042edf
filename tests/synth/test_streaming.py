"""A simulation in chunks: the same bits in memory and on the disk, chance that knows no chunks, bounded memory."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from data_schemas import content_sha256, load_scene, read
from data_schemas.errors import SceneError
from data_schemas.scene import Scene
from synth import scene_path, simulate, simulate_to
from synth.recording import clock
from synth.recording.clock import set_clock
from synth.recording.observe import Unwrapping
from synth.streaming import stream

Maker = Callable[..., Scene]

DEFECTS: dict[str, dict[str, Any]] = {
    "none": {},
    "noise": {"noise": 2e-5},
    "jitter": {"jitter": 0.01, "noise": 2e-5},
    "dropped": {"drop_fraction": 0.3, "noise": 2e-5},
    "jitter and dropped": {"jitter": 0.05, "drop_fraction": 0.2},
    "outliers": {"outliers": 40, "outlier_amplitude": 0.1, "quantisation": 1e-4},
    "missing": {"missing_samples": 60, "missing": [[3.0, 5.5], [39.0, 50.0]]},
    "marks": {"mark_gap": 0.4, "gap_interval": 6.0, "chronometer_rate": 30.0},
    "marks only": {"marks": True, "noise": 1e-5},
    "late loss": {"missing": [[39.5, 40.0]], "horizontal_acceleration": True, "vertical_acceleration": True},
}


@pytest.fixture
def chunks_of(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Set the number of samples in a chunk."""

    def change(size: int) -> None:
        monkeypatch.setattr(clock, "CHUNK", size)

    return change


@pytest.mark.parametrize("recording", DEFECTS.values(), ids=DEFECTS)
@pytest.mark.parametrize("restoring", ["linear", "sine"])
def test_a_file_is_the_same_bits_as_memory(
    make_scene: Maker, tmp_path: Path, chunks_of: Callable[[int], None], recording: dict[str, Any], restoring: str
) -> None:
    chunks_of(128)
    scene = make_scene(recording=recording, restoring=restoring)
    in_memory = simulate(scene)
    paths = tmp_path / "a.record.nc", tmp_path / "a.truth.nc"
    assert simulate_to(scene, *paths) == in_memory[0].sizes["time"]
    for tree, path in zip(in_memory, paths, strict=True):
        assert h5py.File(path).attrs["content_sha256"] == content_sha256(tree)
        assert read(path).identical(tree)


@pytest.mark.parametrize("recording", DEFECTS.values(), ids=DEFECTS)
def test_chance_does_not_depend_on_chunks(
    make_scene: Maker, chunks_of: Callable[[int], None], recording: dict[str, Any]
) -> None:
    """The motion may differ by rounding, for matrix products of other shapes add up otherwise; nothing else does."""
    scene = make_scene(recording=recording)
    whole = simulate(scene)
    for size in (17, 256):
        chunks_of(size)
        cut = simulate(scene)
        for one, other in zip(whole, cut, strict=True):
            np.testing.assert_array_equal(one["time"].values, other["time"].values)
        assert whole[0]["record"].data_vars.keys() == cut[0]["record"].data_vars.keys()
        for name in ("elongation_qc",) if "elongation_qc" in whole[0]["record"] else ():
            np.testing.assert_array_equal(whole[0]["record"][name].values, cut[0]["record"][name].values)
        step = recording.get("quantisation", 0.0)
        difference = whole[0]["record/elongation"].values - cut[0]["record/elongation"].values
        if step:  # a reading at the edge of two steps may fall to either
            assert np.count_nonzero(difference) <= 1
        else:
            np.testing.assert_allclose(difference[np.isfinite(difference)], 0.0, rtol=0, atol=2e-16)
        np.testing.assert_array_equal(
            np.isnan(whole[0]["record/elongation"].values), np.isnan(cut[0]["record/elongation"].values)
        )
        # phases of 250 rad are rounded to 3e-14, and what is forced is what the free part of 12 mrad leaves
        for name, tolerance in (("theta", 1e-16), ("forced", 1e-15), ("free_phase", 1e-12)):
            a, b = (truth["truth"][name].values for truth in (whole[1], cut[1]))
            np.testing.assert_allclose(a, b, rtol=0, atol=tolerance)


def test_collocation_does_not_depend_on_chunks(make_scene: Maker, chunks_of: Callable[[int], None]) -> None:
    """It marches in strides of its own, whatever is asked of it."""
    scene = make_scene(restoring="sine")
    whole = simulate(scene)[1]
    chunks_of(50)
    cut = simulate(scene)[1]
    np.testing.assert_array_equal(whole["truth/theta"].values, cut["truth/theta"].values)
    assert whole.attrs == cut.attrs


def test_phases_unwrap_as_numpy_does_whatever_the_chunks() -> None:
    chance = np.random.default_rng(8)
    base = 6.2 * np.arange(400) / 5 + np.array([[0.3], [-20.0]])
    phase = base + np.cumsum(chance.normal(scale=0.5, size=base.shape), axis=1)
    signal = np.exp(1j * phase)
    whole = Unwrapping()(signal, base)
    expected = base + np.unwrap(np.angle(np.exp(1j * (phase - base))), axis=1)
    turns = (whole - expected) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.rint(turns[:, :1]) + np.zeros_like(turns), rtol=0, atol=1e-12)
    assert np.all(np.abs(whole[:, 0]) <= np.pi)
    for size in (1, 7, 399):
        unwrapped = Unwrapping()
        parts = [unwrapped(signal[:, at : at + size], base[:, at : at + size]) for at in range(0, 400, size)]
        np.testing.assert_array_equal(np.concatenate(parts, axis=1), whole)
    assert Unwrapping()(signal[:, :0], base[:, :0]).shape == (2, 0)


def test_even_clocks_are_not_listed(make_scene: Maker, chunks_of: Callable[[int], None]) -> None:
    whole = set_clock(make_scene(recording={"sampling_rate": "25/3", "chronometer_rate": 20.0}))
    chunks_of(64)
    parts = list(whole.chunks())
    assert [part.count for part in parts] == [64] * 5 + [14]
    np.testing.assert_array_equal(np.concatenate([part.seconds for part in parts]), whole.seconds)
    assert whole.true_end == whole.true_seconds[-1]


@pytest.mark.parametrize("recording", [{}, {"noise": 1e-5, "mark_gap": 0.5, "missing": [[5.0, 6.0]]}])
def test_memory_does_not_grow_with_the_record(
    make_scene: Maker, chunks_of: Callable[[int], None], tmp_path: Path, recording: dict[str, Any]
) -> None:
    chunks_of(1 << 13)

    def peak(duration: float) -> int:
        scene = make_scene(duration=duration, recording=recording)
        tracemalloc.start()
        try:
            simulate_to(scene, tmp_path / "a.record.nc", tmp_path / "a.truth.nc", overwrite=True)
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    peak(80.0)  # imports
    short, long = peak(3000.0), peak(9000.0)  # both longer than what is read back at once
    # 150 000 further readings of 13 numbers would be 16 MB
    assert long < short + 300_000


@pytest.mark.parametrize("older", [False, True])
def test_an_interrupt_leaves_the_folder_as_it_was(
    make_scene: Maker, chunks_of: Callable[[int], None], tmp_path: Path, older: bool
) -> None:
    chunks_of(300)
    paths = tmp_path / "a.record.nc", tmp_path / "a.truth.nc"
    if older:
        simulate_to(make_scene(seed=3), *paths)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    seen = []

    def interrupt(done: int, total: int) -> None:
        seen.append((done, total))
        if done == 600:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_to(make_scene(), *paths, overwrite=older, progress=interrupt)
    assert seen == [(300, 1000), (600, 1000)]
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_motion_that_turns_out_too_wild_leaves_nothing(
    make_scene: Maker, chunks_of: Callable[[int], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    chunks_of(300)
    monkeypatch.setattr("synth.plan.CLOSED_FORM_ERROR", 1e-3)
    with pytest.raises(SceneError, match=r"estimated error is 0\.001"):
        simulate_to(make_scene(), tmp_path / "a.record.nc", tmp_path / "a.truth.nc")
    assert list(tmp_path.iterdir()) == []


def test_a_kill_leaves_no_file_of_either_name(tmp_path: Path) -> None:
    program = f"""
import os, signal
from data_schemas import load_scene
from synth import scene_path, simulate_to
from synth.recording import clock
clock.CHUNK = 1 << 13
kill = lambda done, total: os.kill(os.getpid(), signal.SIGKILL) if done > total / 2 else None
simulate_to(load_scene(scene_path("linear")), {str(tmp_path / "a.nc")!r}, {str(tmp_path / "b.nc")!r}, progress=kill)
"""
    done = subprocess.run([sys.executable, "-c", program], check=False)
    assert done.returncode == -signal.SIGKILL
    assert all(path.name.startswith(".") for path in tmp_path.iterdir())


_DAY = """
import resource, sys
from data_schemas import load_scene
from data_schemas.scene import Scene
from synth import scene_path, simulate_to
changes, duration = {changes}, float(sys.argv[1])
scene = load_scene(scene_path("linear")).model_dump() | {{"duration": duration, "restoring": {restoring!r}}}
scene["recording"] |= changes
print(simulate_to(Scene.model_validate(scene), "day.record.nc", "day.truth.nc"))
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


_SHIPPED = """
import resource, sys
from data_schemas import load_scene
from data_schemas.scene import Scene
from synth import scene_path, simulate_to
scene = load_scene(scene_path({name!r})).model_dump() | {{"duration": float(sys.argv[1])}}
scene["recording"] |= {{"sampling_rate": 25.0}}
print(simulate_to(Scene.model_validate(scene), "day.record.nc", "day.truth.nc"))
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.mark.compiled
@pytest.mark.parametrize("name", ["clocks-on-beam", "escapement"])
def test_an_integrated_motion_does_not_depend_on_chunks(
    name: str, tmp_path: Path, chunks_of: Callable[[int], None]
) -> None:
    """It is integrated whole, and written in chunks."""
    scene = Scene.model_validate(load_scene(scene_path(name)).model_dump() | {"duration": 20.0})
    whole = simulate(scene)[1]
    chunks_of(64)
    paths = tmp_path / "a.record.nc", tmp_path / "a.truth.nc"
    simulate_to(scene, *paths)
    assert read(paths[1]).identical(simulate(scene)[1])
    np.testing.assert_array_equal(read(paths[1])["truth/theta"].values, whole["truth/theta"].values)


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["clocks-on-beam", "metronomes", "escapement"])
def test_a_day_of_a_general_integrator_stays_below_1_gb(tmp_path: Path, name: str) -> None:
    """Its states are held, 8 bytes a reading and component."""
    _day(tmp_path, _SHIPPED.format(name=name), 2_160_000, 1_000_000)


@pytest.mark.campaign
@pytest.mark.parametrize("restoring", ["linear", "sine"])
@pytest.mark.parametrize("changes", [{}, {"jitter": 0.001, "drop_fraction": 0.1, "missing_samples": 1000}])
def test_a_day_at_25_hz_stays_below_300_mb(tmp_path: Path, restoring: str, changes: dict[str, Any]) -> None:
    """The bar of the project, as the operating system counts; the very first run also holds the compiler, 80 MB."""
    _day(tmp_path, _DAY.format(restoring=restoring, changes=changes), 1_944_000 if changes else 2_160_000)


def _day(folder: Path, program: str, readings: int, most: int = 300_000) -> None:
    """A minute, that all is compiled, and then a day."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    for duration in (60, 86_400):
        done = subprocess.run(
            [sys.executable, "-c", program, str(duration)],
            cwd=folder, capture_output=True, text=True, check=True, env=environment,
        )  # fmt: skip
        for path in folder.glob("day.*.nc"):
            path.unlink()
    written, kilobytes = map(int, done.stdout.split())
    assert written == readings
    assert kilobytes < most


def test_a_stream_is_lazy(make_scene: Maker, chunks_of: Callable[[int], None]) -> None:
    chunks_of(100)
    scene = make_scene(duration=1e6)  # 25 million readings, which nobody waits for
    record, truth = next(stream(scene, set_clock(scene)))
    assert record["record"].variables["elongation"].values.shape == (2, 100)
    assert truth["truth"].variables["theta"].values.shape == (2, 100)
