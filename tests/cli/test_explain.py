"""`simulate --explain` and `--tolerance`."""

from __future__ import annotations

import json

import pytest

import data_schemas

SCENE = """
record_id = "clock"
duration = 2
gravity = 9.81
restoring = "sine"
[[pendulums]]
label = "1"
period = 1.0
quadratic_damping = 0.1
start = { kind = "state", angle = 0.1 }
"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "clock.toml"
    path.write_text(SCENE)
    return path


def test_explain_tells_and_writes_nothing(run, scene, tmp_path):
    outcome = run("simulate", scene, "--explain")
    assert outcome.status == 0, outcome.err
    lines = outcome.out.splitlines()
    assert lines[0] == "clock"
    for heading in ("scene", "terms", "propagator"):
        assert heading in lines
    told = {line[:21].strip(): line[21:] for line in lines if line.startswith("  ")}
    assert told["quadratic damping"] == "0.1 rad-1"
    assert told["left out"].startswith("viscous damping, knife edge, escapement")
    assert told["chosen"] == "explicit, order 8"
    assert told["why"].startswith("quadratic damping: not stiff")
    assert told["expected error"] == "1e-11 of the largest angle"
    assert list(tmp_path.iterdir()) == [scene]


def test_explain_in_json(run, scene):
    outcome = run("simulate", scene, "--explain", "--json", "--tolerance", "2e-8")
    assert outcome.status == 0, outcome.err
    (line,) = outcome.out.splitlines()
    told = json.loads(line)
    assert told["record_id"] == "clock"
    assert told["terms"] == {"restoring": "the full sine", "quadratic damping": "0.1 rad-1"}
    assert told["tolerance"] == told["expected_error"] == 2e-8


def test_explain_of_a_scene_that_cannot_be_is_one_line(run, scene):
    scene.write_text(SCENE + '[simulation]\npropagator = "picard"\n')
    outcome = run("simulate", scene, "--explain")
    assert outcome.status == 2
    assert "does not know quadratic damping; choose 'explicit' or 'radau' or 'auto'" in outcome.fault


def test_tolerance_goes_into_the_truth(run, scene, tmp_path):
    assert run("simulate", scene, "--tolerance", "1e-6").status == 0
    truth = data_schemas.read(tmp_path / "clock.truth.nc")
    assert truth.attrs["tolerance"] == 1e-6
    assert truth.attrs["estimated_error"] <= 1e-6


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--tolerance", "2"), "--tolerance wants a relative error from 1e-15 to 0.01, not '2'"),
        (("--tolerance", "small"), "--tolerance wants a number, not 'small'"),
        (("--json",), "--json goes with --explain"),
    ],
)
def test_misuse_is_one_line(run, scene, words, said):
    outcome = run("simulate", scene, *words)
    assert outcome.status == 2
    assert said in outcome.fault
