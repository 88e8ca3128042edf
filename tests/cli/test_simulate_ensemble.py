"""`simulate --ensemble`, and an end in order when `simulate` is stopped."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

import data_schemas
from pipeline.cli.files import orderly

SCENE = """
record_id = "small"
duration = 8.0
gravity = 9.81
[recording]
noise = 1e-4
[[pendulums]]
label = "1"
period = 1.0
start = { kind = "free", amplitude = 0.01 }
[[pendulums]]
label = "2"
period = 1.001
start = { kind = "free", amplitude = 0.01, phase = 1.0 }
"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(SCENE)
    return path


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_an_ensemble_fills_a_folder_beside_the_scene(run, scene, tmp_path):
    command = ("simulate", scene, "--vary", "pendulums.0.start.phase=-1:1", "--vary=gravity=9.7:9.9", "--ensemble")
    outcome = run(*command, 2)
    folder = tmp_path / "small.ensemble"
    assert outcome == (0, f"{folder}/small.ensemble.csv: 2 members\n", "")
    assert names(folder) == [
        *(f"small-000{number}.{kind}.nc" for number in (1, 2) for kind in ("record", "truth")),
        "small.ensemble.csv",
    ]
    assert all(data_schemas.validate(path) == [] for path in folder.glob("*.nc"))
    assert folder.joinpath("small.ensemble.csv").read_text().startswith("member,seed,pendulums.0.start.phase,gravity,")
    assert run(*command, 3).out == f"{folder}/small.ensemble.csv: 3 members, 2 of them kept from before\n"
    assert run(*command, 3, "--force", "--workers", 2).out == f"{folder}/small.ensemble.csv: 3 members\n"
    refused = run(*command, 3, "--seed", 4)
    assert refused.status == 3
    assert "small-0001.record.nc: exists already, of another scene or seed; give --force" in refused.fault


def test_the_folder_and_the_seed_may_be_named(run, scene, tmp_path):
    for folder, seed in (("a", 5), ("b/c", 5), ("d", 6)):
        assert run("simulate", scene, "--ensemble", 1, "--seed", seed, "-o", tmp_path / folder).status == 0
    a, b, d = (
        data_schemas.read(tmp_path / folder / "small-0001.record.nc")["record/elongation"].values
        for folder in ("a", "b/c", "d")
    )
    assert (a == b).all()
    assert (a != d).all()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--vary", "gravity=9:10"), "--vary is about ensembles; give --ensemble N too"),
        (("--workers", "2"), "--workers is about ensembles; give --ensemble N too"),
        (("--ensemble", "0"), "--ensemble wants a whole number from 1 to 1000000, not '0'"),
        (("--ensemble", "2", "--vary", "gravity"), "--vary wants KEY=LOW:HIGH, such as gravity=9.7:9.9, not 'gravity'"),
        (("--ensemble", "2", "--vary", "gravity=9:inf"), "--vary wants finite ends"),
        (("--ensemble", "2", "--vary", "gravity=9:x"), "--vary wants KEY=LOW:HIGH"),
        (("--ensemble", "2", "--vary", "gravity=9:10", "--vary", "gravity=9:9.5"), "--vary names a key twice"),
        (("--ensemble", "2", "--vary", "gravty=9:10"), "did you mean 'gravity'?"),
        (("--ensemble", "2", "--vary", "gravity=99.9:200"), "member 1: gravity = "),
        (("--ensemble", "2", "-o", "small.toml"), "small.toml: is a file, but an ensemble needs a folder"),
    ],
)
def test_misuse_is_told_and_leaves_nothing(run, scene, tmp_path, monkeypatch, words, told):
    monkeypatch.chdir(tmp_path)
    outcome = run("simulate", scene, *words)
    assert outcome.status == 2
    assert told in outcome.fault
    assert names(tmp_path) == ["small.toml"]


def test_a_scene_that_cannot_be_simulated_leaves_no_folder(run, scene, tmp_path):
    scene.write_text(SCENE + '[[motion]]\nkind = "tabulated"\nfile = "none.csv"\n')
    for words in ((), ("--ensemble", "1")):
        assert run("simulate", scene, "-o", f"{tmp_path}/new/deep/", *words).status == 2
        assert names(tmp_path) == ["small.toml"]


@pytest.mark.parametrize(
    ("number", "words", "status"),
    [
        (signal.SIGINT, (), 130),
        (signal.SIGTERM, (), 143),
        (signal.SIGINT, ("--ensemble", "4", "--workers", "2"), 130),
        (signal.SIGTERM, ("--ensemble", "4", "--workers", "2"), 143),
    ],
)
def test_who_is_stopped_leaves_nothing_half_written(scene, tmp_path, number, words, status):
    """A record of 28 days at 25 Hz, stopped as soon as its files are being written."""
    scene.write_text(SCENE.replace("8.0", "2.4e6"))
    folder = tmp_path / "out"
    command = [sys.executable, "-m", "pipeline.cli", "simulate", str(scene), "-o", f"{folder}/", *words]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment, start_new_session=True
    ) as process:
        deadline = time.monotonic() + 60
        wanted = 2 if not words else 4
        while time.monotonic() < deadline and len(list(folder.glob(".*.part"))) < wanted:
            time.sleep(0.05)
        assert process.poll() is None
        # a terminal sends Ctrl-C to all, a service manager may do so with SIGTERM; the first process is enough too
        os.killpg(process.pid, number) if number == signal.SIGINT else process.send_signal(number)
        out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (status, "")
    assert err == ("isochrony: interrupted\n" if number == signal.SIGINT else "")
    assert names(tmp_path) == ["small.toml"]


def test_a_request_to_end_that_a_library_makes_an_error_of_is_one():
    def library() -> None:
        try:
            signal.raise_signal(signal.SIGTERM)
        except SystemExit as leaving:
            raise ValueError("cannot be serialised") from leaving

    with pytest.raises(SystemExit) as leaving, orderly():
        library()
    assert leaving.value.code == 143
