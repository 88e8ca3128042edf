"""Scene files made to hang, to exhaust or to trip the parser: each is refused in one line."""

from __future__ import annotations

import os

import pytest

from data_schemas import validate
from data_schemas.errors import SceneError
from data_schemas.scene import load_scene
from data_schemas.text_files import MOST_TOML


def large(path):
    with path.open("wb") as file:
        file.truncate(MOST_TOML + 1)


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda path: path.write_text("a = " + "[" * 100_000), "nested too deeply"),
        (lambda path: path.write_text("a = " + "{b = " * 100_000), "nested too deeply"),
        (lambda path: path.write_text("a = " + "9" * 5000), "is not TOML: Exceeds the limit"),
        (lambda path: path.write_bytes(b"\xff\xfe"), "not text in UTF-8"),
        (lambda path: path.write_text("a = 1\na = 2"), "is not TOML: "),
        (lambda path: path.symlink_to("/dev/zero"), "not an ordinary file"),
        (os.mkfifo, "not an ordinary file"),
        (os.mkdir, "is a folder"),
        (large, "more than 16777216; give the path of a scene"),
        (lambda _: None, "No such file"),
    ],
)
def test_it_is_refused_in_one_line(tmp_path, make, told):
    path = tmp_path / "scene.toml"
    make(path)
    with pytest.raises(SceneError, match=told) as refusal:
        load_scene(path)
    assert str(refusal.value).startswith(f"{path}: ")
    assert len(str(refusal.value).splitlines()) == 1
    assert validate(path) == [str(refusal.value)]


def test_a_path_that_no_system_has():
    with pytest.raises(SceneError, match="null byte"):
        load_scene("a\0b.toml")


@pytest.mark.parametrize("key", [".".join(["a"] * 30_000), "x" * 200_000 + ".a" * 101, " . ".join(['"a"'] * 200)])
def test_a_key_of_very_many_parts_is_refused(key, tmp_path):
    """Each part is looked up from the first on: 200,000 took more than 30 s."""
    path = tmp_path / "scene.toml"
    path.write_text(f"{key} = 1\n")
    with pytest.raises(SceneError, match="a key of more than 100 parts; give the path of a scene in TOML"):
        load_scene(path)
    path.write_text(f"a = [{', '.join(['0.5'] * 10_000)}]\nb = '{'x' * 200_000}'\n")
    with pytest.raises(SceneError) as told:
        load_scene(path)
    assert "a key of" not in str(told.value)
