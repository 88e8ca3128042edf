"""An ensemble: each member depends on its number alone, is `simulate` of its scene, and is made once."""

from __future__ import annotations

import csv
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from data_schemas import content_sha256, read
from data_schemas.errors import FileError, SceneError, UsageError
from data_schemas.scene import Scene
from synth import simulate, simulate_ensemble, write_ensemble
from synth.ensemble import member, member_scenes, value

Maker = Callable[..., Scene]
NOISY = {"noise": 2e-5, "outliers": 3, "outlier_amplitude": 0.1}
VARY = {"pendulums.1.start.phase": (0.0, 6.0), "recording.missing_samples": (1, 9), "gravity": (9.7, 9.9)}


@pytest.fixture
def scene(make_scene: Maker) -> Scene:
    return make_scene(duration=8.0, recording=NOISY)


def sums(*trees: Any) -> list[str]:
    return [content_sha256(tree) for tree in trees]


def test_a_member_is_the_simulation_of_its_scene(scene: Scene) -> None:
    for number, record, truth in simulate_ensemble(scene, 3, vary=VARY):
        own = Scene.model_validate_json(truth.attrs["scene"])
        assert own == member(scene, number, vary=VARY)
        assert sums(record, truth) == sums(*simulate(own))


def test_a_member_depends_on_its_number_alone(scene: Scene) -> None:
    few, many = (
        [sums(record, truth) for _, record, truth in simulate_ensemble(scene, count, vary=VARY)] for count in (2, 4)
    )
    by_two = [sums(record, truth) for _, record, truth in simulate_ensemble(scene, 4, vary=VARY, workers=2)]
    assert few == many[:2]
    assert by_two == many
    assert len({one for pair in many for one in pair}) == 8


def test_members_have_noise_of_their_own(scene: Scene, make_scene: Maker) -> None:
    clean = simulate(make_scene(duration=8.0))[0]["record/elongation"].values
    noise = [record["record/elongation"].values[0] - clean[0] for _, record, _ in simulate_ensemble(scene, 2)]
    small = (np.abs(noise[0]) < 0.05) & (np.abs(noise[1]) < 0.05)  # outliers apart
    assert np.std(noise[0][small]) == pytest.approx(2e-5, rel=0.2)
    # 200 independent readings: the correlation is 0.07 by chance
    assert abs(np.corrcoef(noise[0][small], noise[1][small])[0, 1]) < 0.3


def test_another_seed_is_another_ensemble(scene: Scene) -> None:
    seeds = {one.seed for seed in (None, 1, 2) for one in member_scenes(scene, 5, seed=seed)}
    assert len(seeds) == 15
    same = member_scenes(scene, 5, seed=scene.seed)
    assert [one.seed for one in member_scenes(scene, 5)] == [one.seed for one in same]


def test_a_further_key_changes_no_other(scene: Scene) -> None:
    fewer = {key: VARY[key] for key in list(VARY)[1:]}
    for one, other in zip(member_scenes(scene, 5, vary=VARY), member_scenes(scene, 5, vary=fewer), strict=True):
        assert [value(one, key) for key in fewer] == [value(other, key) for key in fewer]
        assert one.seed == other.seed


def test_draws_are_even_over_the_range(scene: Scene) -> None:
    drawn = {key: [value(one, key) for one in member_scenes(scene, 300, vary=VARY)] for key in VARY}
    for key, (low, high) in VARY.items():
        values = np.array(drawn[key], dtype=float)
        assert low <= values.min() < low + (high - low) / 8
        assert high >= values.max() > high - (high - low) / 8
        # the mean of 300 even draws is off by 1/sqrt(12*300) of the range, 0.017: four times that
        assert abs(values.mean() - (low + high) / 2) < 0.07 * (high - low)
    assert set(drawn["recording.missing_samples"]) == set(range(1, 10))


def test_a_callable_draws_as_it_likes(scene: Scene) -> None:
    vary = {
        "gravity": lambda chance: float(chance.normal(9.81, 1e-3)),
        "pendulums.0.start": lambda chance: {"kind": "state", "angle": float(chance.choice([0.1, 0.2]))},
        "recording.noise": lambda _: 0.0,
    }
    made = list(member_scenes(scene, 20, vary=vary))
    assert {one.pendulums[0].start.angle for one in made} == {0.1, 0.2}
    assert {one.recording.noise for one in made} == {0.0}
    assert len({one.gravity for one in made}) == 20


def test_rates_stay_ratios(scene: Scene) -> None:
    (one,) = member_scenes(scene, 1, vary={"recording.sampling_rate": (20.0, 25.0)})
    assert isinstance(one.recording.sampling_rate, Fraction)
    assert 20 <= one.recording.sampling_rate <= 25


@pytest.mark.parametrize(
    ("key", "how", "told"),
    [
        ("gravty", (9.7, 9.9), "vary gravty: there is no 'gravty' in this scene; did you mean 'gravity'?"),
        ("pendulums.2.period", (1, 2), "vary pendulums.2.period: '2' is none of its parts, .* from 0 to 1"),
        ("pendulums.one.period", (1, 2), "vary pendulums.one.period: 'one' is none of its parts"),
        ("gravity.value", (1, 2), "vary gravity.value: there is nothing below it; leave 'value' out"),
        ("pendulums.0.start", (1, 2), "vary pendulums.0.start: is no number"),
        ("title", (1, 2), "vary title: is no number"),
        ("recording.marks", (0, 1), "vary recording.marks: is no number"),
        ("seed", (1, 2), "vary seed: every member has its own anyway"),
        ("gravity", (9.9, 9.7), "vary gravity: the range 9.9 to 9.7 is empty"),
        ("gravity", (9.7, float("nan")), "vary gravity: the range 9.7 to nan is empty"),
        ("recording.outliers", (0.5, 2), "vary recording.outliers: takes whole numbers"),
    ],
)
def test_what_cannot_be_meant_is_told_at_once(scene: Scene, key: str, how: tuple[float, float], told: str) -> None:
    with pytest.raises(SceneError, match=told):
        simulate_ensemble(scene, 2, vary={key: how})


def test_values_that_are_not_allowed_name_the_member(scene: Scene, tmp_path: Path) -> None:
    vary = {"gravity": (99.0, 101.0)}
    with pytest.raises(SceneError, match=r"member \d+: gravity = 100\.[0-9]+: should be less than or equal to 100"):
        list(member_scenes(scene, 20, vary=vary))
    with pytest.raises(SceneError, match="gravity"):
        write_ensemble(scene, 20, tmp_path, vary=vary)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(SceneError, match="an ensemble of 0 members; ask for 1 or more"):
        simulate_ensemble(scene, 0)
    for function in (simulate_ensemble, lambda *_, **options: write_ensemble(scene, 2, tmp_path, **options)):
        with pytest.raises(UsageError, match="workers = 0"):
            function(scene, 2, workers=0)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_files_are_the_members_with_a_table(scene: Scene, tmp_path: Path) -> None:
    seen: list[tuple[int, int]] = []
    written = write_ensemble(scene, 3, tmp_path, name="x", vary=VARY, progress=lambda *done: seen.append(done))
    assert (written.made, written.kept, seen) == (3, 0, [(1, 3), (2, 3), (3, 3)])
    assert written.manifest == tmp_path / "x.ensemble.csv"
    with written.manifest.open() as file:
        rows = list(csv.DictReader(file))
    for row, (number, record, truth) in zip(rows, simulate_ensemble(scene, 3, vary=VARY), strict=True):
        assert int(row["member"]) == number
        assert int(row["seed"]) == truth.attrs["seed"]
        assert float(row["gravity"]) == float(truth["truth/gravity"])
        assert float(row["pendulums.1.start.phase"]) == member(scene, number, vary=VARY).pendulums[1].start.phase
        assert read(tmp_path / row["record"]).identical(record)
        assert read(tmp_path / row["truth"]).identical(truth)
    assert len(names(tmp_path)) == 7


def test_an_interrupted_run_goes_on(scene: Scene, tmp_path: Path) -> None:
    def interrupt(done: int, _total: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_ensemble(scene, 4, tmp_path, vary=VARY, progress=interrupt)
    assert len(names(tmp_path)) == 5
    (tmp_path / "test-0002.truth.nc").unlink()  # as if the end had come between the two
    kept = {name: (tmp_path / name).stat().st_mtime_ns for name in ("test-0001.record.nc", "test-0001.truth.nc")}
    assert write_ensemble(scene, 4, tmp_path, vary=VARY)[1:] == (3, 1)
    assert kept == {name: (tmp_path / name).stat().st_mtime_ns for name in kept}
    assert write_ensemble(scene, 5, tmp_path, vary=VARY)[1:] == (1, 4)
    for number, record, truth in simulate_ensemble(scene, 5, vary=VARY):
        assert read(tmp_path / f"test-{number:04d}.record.nc").identical(record)
        assert read(tmp_path / f"test-{number:04d}.truth.nc").identical(truth)
    assert write_ensemble(scene, 2, tmp_path, vary=VARY, overwrite=True)[1:] == (2, 0)


@pytest.mark.parametrize("fault", ["another seed", "other values", "another scene's record", "damaged", "foreign"])
def test_files_that_are_not_the_members_are_not_touched(scene: Scene, tmp_path: Path, fault: str) -> None:
    write_ensemble(scene, 2, tmp_path, vary=VARY)
    changes: dict[str, Any] = {"vary": VARY}
    told = "of another scene or seed; give --force"
    if fault == "another seed":
        changes["seed"] = 5
    elif fault == "other values":
        changes["vary"] = VARY | {"gravity": (9.7, 9.8)}
    elif fault == "another scene's record":
        (tmp_path / "test-0001.record.nc").rename(tmp_path / "test-0002.record.nc")
    else:
        path = tmp_path / "test-0002.truth.nc"
        content = path.read_bytes()
        path.write_bytes(content[:-1000] if fault == "damaged" else b"mine")
        told = r"test-0002\.truth\.nc: .*; or give --force"
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(FileError, match=told):
        write_ensemble(scene, 3, tmp_path, **changes)
    assert before == {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert write_ensemble(scene, 3, tmp_path, overwrite=True, **changes)[1:] == (3, 0)
