"""Where outputs go, and what is refused before any work."""

from __future__ import annotations

from pathlib import Path

import pytest

from data_schemas.errors import UsageError
from pipeline.cli.files import make_folder, place, refuse_clashes, stem

ONE, TWO = Path("a/ship.record.nc"), Path("b/boat.nc")


@pytest.mark.parametrize(
    ("name", "expected"),
    [("a/ship.record.nc", "ship"), ("ship.v2.toml", "ship.v2"), ("ship.nc", "ship"), ("ship", "ship"), (".nc", ".nc")],
)
def test_the_stem_is_the_name_without_its_kind(name, expected):
    assert stem(Path(name)) == expected


def test_without_o_the_output_is_beside_its_input():
    assert place([ONE, TWO], None, ".result.nc") == [Path("a/ship.result.nc"), Path("b/boat.result.nc")]


def test_o_is_a_file_for_one_input(tmp_path):
    assert place([ONE], str(tmp_path / "x.nc"), ".result.nc") == [tmp_path / "x.nc"]


@pytest.mark.parametrize("end", ["/", ""])
def test_o_is_a_folder_if_it_ends_with_a_slash_or_is_one(tmp_path, end):
    folder = tmp_path / "out"
    if not end:
        folder.mkdir()
    assert place([ONE], f"{folder}{end}", ".result.nc") == [folder / "ship.result.nc"]
    assert folder.exists() == (not end)  # a folder is made only when there is something to write


def test_o_is_a_folder_for_several_inputs(tmp_path):
    folder = tmp_path / "out"
    assert place([ONE, TWO], str(folder), ".nc") == [folder / "ship.nc", folder / "boat.nc"]


@pytest.mark.parametrize(
    ("out", "inputs", "told"),
    [("", [ONE], "empty"), ("there", [ONE, TWO], "must be a folder"), ("there/", [ONE], "must be a folder"),
     ("no/x.nc", [ONE], "no folder")],
)  # fmt: skip
def test_places_that_cannot_be_are_refused(tmp_path, monkeypatch, out, inputs, told):
    monkeypatch.chdir(tmp_path)
    Path("there").write_text("a file")
    with pytest.raises(UsageError, match=told):
        place(inputs, out, ".result.nc")


def test_an_existing_output_is_refused_without_force(tmp_path):
    path = tmp_path / "x.nc"
    path.write_text("precious")
    with pytest.raises(UsageError, match=r"x\.nc: exists already; add --force"):
        refuse_clashes([ONE], [path], force=False)
    refuse_clashes([ONE], [path], force=True)


def test_a_link_to_nothing_is_there(tmp_path):
    link = tmp_path / "link.nc"
    link.symlink_to(tmp_path / "none")
    with pytest.raises(UsageError, match=r"link\.nc: exists already; add --force"):
        refuse_clashes([ONE], [link], force=False)


def test_an_input_is_never_an_output_even_by_force_or_another_name(tmp_path):
    path, link = tmp_path / "x.nc", tmp_path / "link.nc"
    path.write_text("precious")
    link.symlink_to(path)
    for output in (path, link, tmp_path / "sub" / ".." / "x.nc"):
        with pytest.raises(UsageError, match="is an input"):
            refuse_clashes([path], [output], force=True)


def test_two_inputs_never_share_an_output(tmp_path):
    with pytest.raises(UsageError, match="two inputs"):
        refuse_clashes([ONE, TWO], [tmp_path / "x.nc", tmp_path / "x.nc"], force=True)


def test_a_folder_is_no_output(tmp_path):
    with pytest.raises(UsageError, match="is a folder"):
        refuse_clashes([ONE], [tmp_path], force=True)


def test_a_folder_that_cannot_be_made_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="cannot be created"):
        make_folder(tmp_path / "file" / "sub" / "x.nc")
