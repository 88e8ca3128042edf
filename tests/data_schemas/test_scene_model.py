from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from data_schemas.errors import SceneError
from data_schemas.scene import Scene, load_scene
from data_schemas.scene_fields import Section
from data_schemas.scene_motion import TabulatedMotion
from data_schemas.scene_recording import Recording

MINIMAL: dict[str, Any] = {
    "record_id": "one",
    "duration": 10,
    "gravity": 9.81,
    "pendulums": [{"label": "1", "period": 1, "start": {"kind": "free", "amplitude": 0.01}}],
}


def _properties(schema: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    """Every property of every object in a JSON Schema."""
    if isinstance(schema, dict):
        for name, entry in schema.get("properties", {}).items():
            yield name, entry
        for entry in schema.values():
            yield from _properties(entry)
    elif isinstance(schema, list):
        for entry in schema:
            yield from _properties(entry)


def test_every_field_has_unit_and_description() -> None:
    found = list(_properties(Scene.model_json_schema()))
    assert len(found) > 60
    for name, entry in found:
        assert "unit" in entry, name
        assert len(entry.get("description", "")) > 5, name


def test_every_number_with_a_unit_has_a_range() -> None:
    free = {"combination", "begin"}  # any factor, any time of a table
    for name, entry in _properties(Scene.model_json_schema()):
        if name in free or entry["unit"] in {"", "1"} or "items" in entry:
            continue
        options = entry.get("anyOf", [entry])
        ranged = any(limit in option for option in options for limit in ("minimum", "exclusiveMinimum", "items"))
        assert ranged or any(limit in entry for limit in ("minimum", "exclusiveMinimum", "pattern")), name


def test_scene_is_frozen() -> None:
    scene = Scene.model_validate(MINIMAL)
    with pytest.raises(ValidationError, match="frozen"):
        scene.gravity = 1.0  # type: ignore[misc]  # the assignment that must fail


def test_section_classes_forbid_what_they_do_not_know() -> None:
    def all_of(section: type[Section]) -> Iterator[type[Section]]:
        for each in section.__subclasses__():
            yield each
            yield from all_of(each)

    for section in all_of(Section):
        assert section.model_config["extra"] == "forbid"
        assert section.model_config["frozen"]


@pytest.mark.parametrize(
    ("written", "step"),
    [
        (25, Fraction(1, 25)),
        (0.1, Fraction(10)),
        ("25/3", Fraction(3, 25)),
        (Fraction(25, 3), Fraction(3, 25)),
        ("12.5", Fraction(2, 25)),
    ],
)
def test_sampling_rate_is_what_was_written(written: object, step: Fraction) -> None:
    assert Recording.model_validate({"sampling_rate": written}).step == step


def test_json_round_trip() -> None:
    scene = Scene.model_validate(MINIMAL | {"recording": {"sampling_rate": "25/3", "missing": [[1, 2]]}})
    assert Scene.model_validate_json(scene.model_dump_json()) == scene


def test_count_is_exact() -> None:
    """Tenths of a second at 10 Hz; doubles would give one reading too many at 0.7 s."""
    for tenths in range(1, 200):
        parts = MINIMAL | {"duration": tenths / 10, "recording": {"sampling_rate": 10}}
        assert Scene.model_validate(parts).count == tenths


TABLE = (
    'record_id = "a"\nduration = 1\ngravity = 9.8\n'
    "pendulums = [{label = '1', period = 1, start = {kind = 'free', amplitude = 0.01}}]\n"
    "[[motion]]\nkind = 'tabulated'\nfile = 'data/ship.csv'\n"
)


def test_table_is_looked_for_beside_the_scene(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(f"{TABLE}[[motion]]\nkind = 'tabulated'\nfile = '/data/ship.csv'\n")
    scene = load_scene(tmp_path / "scene.toml", allow_paths=True)
    files = [term.file for term in scene.motion if isinstance(term, TabulatedMotion)]
    assert files == [str(tmp_path / "data" / "ship.csv"), "/data/ship.csv"]


@pytest.mark.parametrize("file", ["/etc/passwd", "../secret.csv", "data/../../secret.csv", "link/ship.csv"])
def test_a_scene_reads_no_file_outside_its_folder(file: str, tmp_path: Path) -> None:
    folder = tmp_path / "scenes"
    folder.mkdir()
    (folder / "link").symlink_to(tmp_path)
    (folder / "scene.toml").write_text(TABLE)
    assert load_scene(folder / "scene.toml")
    (folder / "scene.toml").write_text(TABLE.replace("data/ship.csv", file))
    with pytest.raises(SceneError, match="a table lies beside its scene or below; put it there, or give --allow-paths"):
        load_scene(folder / "scene.toml")
    assert load_scene(folder / "scene.toml", allow_paths=True)
