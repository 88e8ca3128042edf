"""Whatever is wrong with a scene is said in one line: file, dotted key, value, what is allowed."""

from __future__ import annotations

from pathlib import Path

import pytest

from data_schemas.errors import SceneError
from data_schemas.scene import load_scene

GOOD = """
record_id = "two"
duration = 60
gravity = 9.8123
restoring = "linear"
[[pendulums]]
label = "1"
period = 1.00966
start = { kind = "free", amplitude = 0.006, phase = 0.4 }
[[pendulums]]
label = "2"
period = 1.00976
damping_rate = 1e-4
start = { kind = "state", angle = 0.012 }
[[motion]]
kind = "harmonics"
amplitude = [0.1, 0.05]
period = [10, 7]
[[motion]]
kind = "near-resonant"
amplitude = 8e-4
beat_period = 120
[[motion]]
kind = "sea"
significant_height = 3
peak_period = 10
depth = 30
[recording]
sampling_rate = "25/3"
"""

FAULTS = [
    # misspelt keys, at every depth
    (
        "gravity =",
        "gravty =",
        ["gravty = 9.8123 is not a known key; did you mean 'gravity'?", "gravity is missing"],
    ),
    (
        "damping_rate",
        "damping",
        ["pendulums[1].damping = 0.0001 is not a known key; did you mean 'damping_rate'?"],
    ),
    (
        "peak_period",
        "peak_perid",
        ["motion[2].peak_perid = 10 is not a known key; did you mean 'peak_period'?"],
    ),
    ("angle =", "angel =", ["pendulums[1].start.angel = 0.012", "did you mean 'angle'?"]),
    ("[recording]", "[recordin]", ["recordin = ", "did you mean 'recording'?"]),
    ("sampling_rate", "sample_rate", ["recording.sample_rate", "did you mean 'sampling_rate'?"]),
    ('kind = "sea"', 'kind = "see"', ["motion[2].kind = 'see' is none of", "did you mean 'sea'?"]),
    ('kind = "sea"\n', "", ["motion[2].kind is missing"]),
    # impossible numbers
    (
        "period = 1.00966",
        "period = -1",
        ["pendulums[0].period = -1: should be greater than or equal to 0.01"],
    ),
    ("damping_rate = 1e-4", "damping_rate = -1", ["pendulums[1].damping_rate = -1: should be greater"]),
    ("duration = 60", "duration = inf", ["duration = inf: should be a finite number"]),
    ("duration = 60", "duration = nan", ["duration = nan: should be a finite number"]),
    ("duration = 60", 'duration = "60"', ["duration = '60': should be a valid number"]),
    ("depth = 30", "depth = true", ["motion[2].depth = True: should be a valid number"]),
    ("[10, 7]", '[10, "a"]', ["motion[0].period[1] = 'a': should be a valid number"]),
    ("[10, 7]", "[10, 0]", ["motion[0]: period must be at least 1e-4 s"]),
    ("period = [10, 7]", "angular_frequency = [1, -1]", ["motion[0]: angular_frequency must be between"]),
    ("[10, 7]", "[10]", ["motion[0]: period must have one number for each of the 2 amplitudes"]),
    ("[10, 7]", "[10, 7]\nphase = [1]", ["motion[0]: phase must have one number"]),
    (
        "[10, 7]",
        "[10, 7]\nangular_frequency = [1, 2]",
        ["motion[0]: give either angular_frequency or period"],
    ),
    ("[10, 7]", "[]", ["motion[0]"]),
    ("beat_period = 120", "", ["motion[1]: give either detuning or beat_period"]),
    ("beat_period = 120", 'beat_period = 120\npendulum = "9"', ["names the pendulum '9'; there are 1, 2"]),
    ('"25/3"', '"25/0"', ["recording.sampling_rate = '25/0': must be a number or a ratio"]),
    ('"25/3"', "true", ["recording.sampling_rate = True: must be a number or a ratio"]),
    ('"25/3"', "-2", ["recording.sampling_rate = -2: must be above 0"]),
    ('"25/3"', '"1/3000000000000"', ["recording.sampling_rate", "below 1e12"]),
    ('"25/3"', "90000\n[x]", ["x = {} is not a known key"]),
    # what does not fit together
    ('restoring = "linear"', 'restoring = "cubic"', ["restoring = 'cubic'", "'linear' or 'sine'"]),
    ('restoring = "linear"', 'start_time = "2001-02-31T00:00:00Z"', ["start_time", "day"]),
    ('label = "2"', 'label = "1"', ["pendulums must have different labels"]),
    ('"25/3"', "25\nmarks = true\nsampling_rate = 20", ["is not TOML"]),
    ('sampling_rate = "25/3"', "marks = true\nsampling_rate = 20", ["give either sampling_rate or marks"]),
    ('sampling_rate = "25/3"', "mark_interval = 1", ["mark_interval needs marks = true"]),
    ('sampling_rate = "25/3"', "mark_gap = 60.0", ["mark_gap must be shorter than gap_interval"]),
    ('sampling_rate = "25/3"', "outliers = 3", ["outliers need an outlier_amplitude"]),
    ('sampling_rate = "25/3"', "outlier_amplitude = 3", ["outlier_amplitude needs a number of outliers"]),
    ('sampling_rate = "25/3"', "missing_samples = 9999", ["missing_samples is more than the 1500 readings"]),
    ('sampling_rate = "25/3"', "missing = [[1, 2, 3]]", ["recording.missing[0] = [1, 2, 3]"]),
    (
        'sampling_rate = "25/3"',
        "missing = [[2, 1]]",
        ["recording.missing[0] = [2, 1]: stop must be after start"],
    ),
    ('sampling_rate = "25/3"', "missing = [[70, 80]]", ["recording.missing begins at 70 s"]),
    (
        'sampling_rate = "25/3"',
        'traces = [{name="a", combination={3=1}}]',
        ["trace 'a' names the pendulum '3'"],
    ),
    ('sampling_rate = "25/3"', "traces = []", ["traces must name at least one trace"]),
    (
        'sampling_rate = "25/3"',
        "traces = [{name='a', combination={1=1}}, {name='a', combination={2=1}}]",
        ["traces must have different names"],
    ),
    ("gravity = 9.8123", "gravity = ", ["is not TOML", "line 4"]),
]


def _fault(tmp_path: Path, text: str) -> str:
    path = tmp_path / "scene.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    assert len(message) < 700
    assert caught.value.exit_status == 2
    return message


@pytest.mark.parametrize(("good", "bad", "said"), FAULTS)
def test_fault_is_said(tmp_path: Path, good: str, bad: str, said: list[str]) -> None:
    assert good in GOOD
    message = _fault(tmp_path, GOOD.replace(good, bad, 1))
    for part in said:
        assert part in message


def test_the_scene_that_the_faults_are_planted_in_is_good(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(GOOD, encoding="utf-8")
    assert load_scene(path).count == 500


def test_several_faults_at_once(tmp_path: Path) -> None:
    message = _fault(tmp_path, GOOD.replace("depth = 30", "depth = -1").replace("period = 1.00966", "period = 0"))
    assert "motion[2].depth = -1" in message
    assert "pendulums[0].period = 0" in message


def test_many_faults_are_counted(tmp_path: Path) -> None:
    message = _fault(tmp_path, "".join(f"key{number} = {number}\n" for number in range(30)))
    assert message.endswith("more")


def test_long_values_are_cut(tmp_path: Path) -> None:
    assert "..." in _fault(tmp_path, GOOD.replace("depth = 30", f'depth = "{"9" * 500}"'))


def test_hostile_keys_are_cut_and_kept_on_the_line(tmp_path: Path) -> None:
    assert "..." in _fault(tmp_path, GOOD.replace("[recording]", f"[{'r' * 5000}]"))
    assert "'two\\nlines' = 3" in _fault(tmp_path, '"two\\nlines" = 3\n' + GOOD)


def test_too_many_readings(tmp_path: Path) -> None:
    text = GOOD.replace("duration = 60", "duration = 2000000").replace('"25/3"', "90000")
    assert "at most 200000000" in _fault(tmp_path, text)


def test_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="cannot be read"):
        load_scene(tmp_path / "absent.toml")
    with pytest.raises(SceneError, match="is a folder"):
        load_scene(tmp_path)


def test_file_that_is_not_text(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_bytes(b"\x89HDF\r\n\x1a\n\xff\xfe")
    with pytest.raises(SceneError, match="UTF-8"):
        load_scene(tmp_path / "scene.toml")
