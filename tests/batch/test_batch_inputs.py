"""Which files are meant, what their results are called, which values a sweep takes."""

from __future__ import annotations

import errno
import itertools
import os

import pytest

from data_schemas.errors import UsageError
from pipeline.batch.inputs import find_inputs, grid, kind_of, parse_sweep
from pipeline.cli.batch import KINDS


@pytest.fixture
def tree(tmp_path, monkeypatch):
    for name in ("b/2.record.nc", "b/1.record.nc", "a/1.record.nc", "a/1.truth.nc", "a/deep/3.nc", "a/s.toml"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def names(*words):
    return [(one.name, one.kind.name) for one in find_inputs(words, KINDS)]


def test_a_folder_gives_its_records_in_order_with_their_places(tree):
    assert names(".") == [("a/1", "record"), ("b/1", "record"), ("b/2", "record")]


def test_patterns_files_and_scenes(tree):
    assert names("*/1.record.nc") == [("a/1", "record"), ("b/1", "record")]
    assert names("a/s.toml", "a/deep/3.nc") == [("s", "scene"), ("deep/3", "record")]
    assert names("b/2.record.nc") == [("2", "record")]


def test_each_file_counts_once(tree):
    assert len(names(".", "b", "b/*.record.nc", "b/1.record.nc")) == 3


def test_a_file_that_is_not_there_is_an_input_all_the_same(tree):
    assert names("none.record.nc") == [("none", "record")]


def test_links_to_folders_never_lead_round(tree):
    for name in ("l1", "l2"):  # two that lead back up: a search that followed them would not end
        (tree / "a" / name).symlink_to(tree, target_is_directory=True)
    (tree / "a/.hidden").mkdir()
    (tree / "a/.hidden/4.record.nc").write_text("")
    assert names("**/*.record.nc") == [("a/1", "record"), ("b/1", "record"), ("b/2", "record")]
    assert names("b/**/[12].record.nc") == [("1", "record"), ("2", "record")]
    assert names(f"{tree}/*/**/deep/**/*.nc") == [("3", "record")]


def test_an_empty_name_is_not_the_present_folder(tree):
    with pytest.raises(UsageError, match="an input has an empty name; name files"):
        names("b", "")


@pytest.mark.parametrize("word", [".", "**/*.record.nc"])
def test_a_folder_that_cannot_be_searched_is_told(tree, monkeypatch, word):
    scan = os.scandir

    def refuse(path):
        if str(path).endswith("b"):
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return scan(path)

    monkeypatch.setattr(os, "scandir", refuse)
    with pytest.raises(UsageError, match=r"b: cannot be searched \(Permission denied\); make it readable"):
        names(word)


@pytest.mark.parametrize("word", ["*.none", "empty"])
def test_what_means_no_file_is_refused(tree, word):
    (tree / "empty").mkdir()
    with pytest.raises(UsageError, match=r"there is no \.record\.nc, \.tif file"):
        names(word)


def test_a_film_is_read_with_the_description_beside_it(tree):
    beside = {name: kind_of(tree / name, KINDS)[0].beside for name in ("a.film.tif", "a.png", "a.nc", "a.toml")}
    assert beside["a.nc"] is beside["a.toml"] is None
    assert [beside[name](tree / name) for name in ("a.film.tif", "a.png")] == [tree / "a.film.toml"] * 2


def test_an_unknown_kind_is_refused_with_the_known_ones(tree):
    with pytest.raises(
        UsageError, match=r"it knows record \(\.record\.nc, \.nc\); film \(\.tif, \.tiff\); .*; scene \(\.toml\)"
    ):
        kind_of(tree / "x.txt", KINDS)


@pytest.mark.parametrize(
    ("word", "values"),
    [
        ("k=1,2.5,x", [1, 2.5, "x"]),
        ("k=0:1:3", [0.0, 0.5, 1.0]),
        ("k=9.78:9.83:3", [9.78, 9.805, 9.83]),
    ],
)
def test_values_of_a_sweep(word, values):
    assert parse_sweep(word) == ("k", values)


@pytest.mark.parametrize("word", ["k", "k=", "=1", "k=1:2", "k=1:2:1", "k=1:2:3:4", "k=a:2:3", "k=0:inf:3", "k=1:2:x"])
def test_a_sweep_that_means_nothing_is_refused(word):
    with pytest.raises(UsageError, match="--sweep wants KEY=A,B,C or KEY=LOW:HIGH:COUNT"):
        parse_sweep(word)


def test_the_grid_is_the_product():
    sweeps = [("a", [1, 2]), ("b", [3, 4, 5])]
    points = grid(sweeps)
    assert [tuple(value for _, value in point) for point in points] == list(itertools.product([1, 2], [3, 4, 5]))
    assert grid([]) == [()]


def test_a_grid_that_cannot_be_is_refused():
    with pytest.raises(UsageError, match="names a key twice"):
        grid([("a", [1]), ("a", [2])])
    with pytest.raises(UsageError, match="more than 1000000 points"):
        grid([("a", list(range(2000))), ("b", list(range(2000)))])
