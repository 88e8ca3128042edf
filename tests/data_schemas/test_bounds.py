"""Each limit holds to the unit: what a file needs passes, and one less is refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import h5py
import numpy as np
import pytest

from data_schemas import guard, text_files
from data_schemas.errors import FileError
from data_schemas.guard import Budget, ordinary
from data_schemas.reading import load
from data_schemas.text_files import MOST_BYTES, MOST_LINE, MOST_TEXT, text_of


def groups(file: h5py.File) -> None:
    for name in "abc":
        file.create_group(name)


def nested(file: h5py.File) -> None:
    file.create_group("a/b/c")


def three(file: h5py.File) -> None:
    for name in "abc":
        file[name] = [1.0]


def attributes(file: h5py.File) -> None:
    file["a"] = [1.0]
    file["a"].attrs.update({"b": np.arange(6.0), "c": 1.0})


def packed(file: h5py.File) -> None:
    file.create_dataset("a", data=np.zeros((25, 30), "i2"), chunks=(10, 10), compression=1)
    file.create_dataset("b", data=np.zeros(11), chunks=(5,), compression=1)


NEEDS: dict[str, tuple[Callable[[h5py.File], None], int]] = {
    "groups": (groups, 4),  # the root is one
    "depth": (nested, 3),
    "links": (three, 3),
    "arrays": (three, 3),
    "rank": (lambda file: file.create_dataset("a", (1, 1, 1), "f8"), 3),
    "texts": (lambda file: file.create_dataset("a", data=[["x"] * 3] * 2, dtype=h5py.string_dtype()), 6),
    "bytes": (packed, 25 * 30 * 2 + 11 * 8),
    "chunk": (packed, 10 * 10 * 2),
    "chunks": (packed, 3 * 3),
    "unwritten": (lambda file: file.create_dataset("a", (100,), "f8"), 800),
    "attributes": (attributes, 2),
    "attribute_elements": (attributes, 6),
    "attribute_bytes": (attributes, 6 * 8),
}


@pytest.mark.parametrize("name", NEEDS)
def test_a_limit_holds_to_the_unit(name: str, tmp_path: Path) -> None:
    make, need = NEEDS[name]
    with h5py.File(tmp_path / "file.nc", "w") as file:
        make(file)
    assert load(tmp_path / "file.nc", Budget(**{name: need}))
    with pytest.raises(FileError, match=f"more than {need - 1} ") as refusal:
        load(tmp_path / "file.nc", Budget(**{name: need - 1}))
    assert str(refusal.value).endswith("; split the file or remove what no schema uses")


def test_what_lies_outside_the_arrays_is_bounded(tmp_path: Path) -> None:
    path = tmp_path / "file.nc"
    with h5py.File(path, "w") as file:
        packed(file)
        stored = sum(file[name].id.get_storage_size() for name in "ab")
    rest = path.stat().st_size - stored
    assert load(path, Budget(heap=rest))
    with pytest.raises(FileError, match=f"more than {rest - 1} bytes outside its arrays"):
        load(path, Budget(heap=rest - 1))


def test_values_are_bounded_by_the_size_of_their_file(tmp_path: Path) -> None:
    path = tmp_path / "file.nc"
    with h5py.File(path, "w") as file:
        file.create_dataset("a", data=np.zeros(1 << 20), chunks=(1 << 16,), compression=1)
    beyond = 8 * (1 << 20) - 2 * path.stat().st_size
    assert load(path, Budget(packed=2, always=beyond))
    with pytest.raises(FileError, match=f"declares 8 MiB of values in {path.stat().st_size} bytes"):
        load(path, Budget(packed=2, always=beyond - 1))


def test_the_size_of_a_file_is_bounded(tmp_path: Path) -> None:
    path = tmp_path / "file.nc"
    with h5py.File(path, "w") as file:
        three(file)
    size = path.stat().st_size
    assert ordinary(path, size) == size
    with pytest.raises(FileError, match=f"has {size} bytes, more than {size - 1}"):
        ordinary(path, size - 1)


def test_a_line_of_a_table_is_bounded(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text("a\n" + "b" * MOST_LINE)
    assert text_of(path, "shorten it").endswith("b")
    path.write_text("a\n" + "b" * (MOST_LINE + 1))
    with pytest.raises(FileError, match=f"line 2 has {MOST_LINE + 1} bytes, more than {MOST_LINE}; shorten it"):
        text_of(path, "shorten it")


@pytest.mark.parametrize("kind", ["S7", h5py.string_dtype()], ids=["fixed", "variable"])
def test_texts_take_the_room_of_the_longest(kind: object, tmp_path: Path) -> None:
    path = tmp_path / "file.nc"
    with h5py.File(path, "w") as file:
        file.create_dataset("a", data=[b"x" * 7, b"y"], dtype=kind)
    assert load(path, Budget(text_bytes=14))[""].variables["a"].values.tolist() == ["x" * 7, "y"]
    with pytest.raises(FileError, match="a: more than 13 bytes of text; shorten it"):
        load(path, Budget(text_bytes=13))


def test_each_text_of_an_attribute_may_be_a_quarter_of_all(tmp_path: Path) -> None:
    path = tmp_path / "file.nc"
    with h5py.File(path, "w") as file:
        file.attrs["texts"] = ["x"] * 100
    most = 100 * path.stat().st_size // 4
    assert load(path, Budget(text_bytes=most))[""].attrs["texts"] == ["x"] * 100
    with pytest.raises(FileError, match="attribute texts: too many texts; join them into one"):
        load(path, Budget(text_bytes=most - 1))


def test_limits_are_as_announced() -> None:
    """A change here refuses files that were read before, or reads what was refused."""
    mebibyte = 1 << 20
    assert asdict(Budget()) == {
        "file": 5 * 1024 * mebibyte,
        "bytes": 4 * 1024 * mebibyte,
        "packed": 50,
        "always": 256 * mebibyte,
        "unwritten": 64 * mebibyte,
        "heap": 64 * mebibyte,
        "chunk": 256 * mebibyte,
        "chunks": mebibyte,  # half a day at 25 Hz, a sample in each
        "rank": 8,
        "texts": 10_000,
        "text_bytes": 64 * mebibyte,
        "attributes": 256,
        "attribute_elements": 1024,
        "attribute_bytes": 4 * mebibyte,
        "groups": 64,
        "depth": 8,
        "links": 512,
        "arrays": 1024,
    }
    of_text = [guard.MOST_BYTES, guard.MOST_OBJECTS, guard.MOST_POINTERS]
    assert of_text == [64 * mebibyte, mebibyte // 2, mebibyte]
    of_files = [MOST_BYTES, MOST_TEXT, MOST_LINE, text_files.MOST_TOML, text_files.MOST_PARTS]
    assert of_files == [32 * 1024 * mebibyte, 256 * mebibyte, mebibyte // 16, 16 * mebibyte, 100]
