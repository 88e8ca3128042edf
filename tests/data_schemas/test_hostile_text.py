"""Text storage of an HDF5 file that a stranger left: bounded over the whole file, read once, never believed."""

from __future__ import annotations

import os

import h5py
import numpy as np
import pytest

from data_schemas import guard, read, write
from data_schemas.errors import FileError
from data_schemas.guard import Budget
from data_schemas.reading import load


def test_one_text_told_many_times_is_counted(tmp_path):
    """Ten thousand elements that all point at one long text would fill the memory: what they point at is summed."""
    path = tmp_path / "file.nc"
    with h5py.File(path, "w") as file:
        texts = file.create_dataset("texts", data=["x" * 1000] * 50, dtype=h5py.string_dtype())
        start = texts.id.get_offset()
    bad = bytearray(path.read_bytes())
    bad[start : start + 50 * 16] = bad[start : start + 16] * 50
    path.write_bytes(bad)
    assert load(path, Budget(text_bytes=60_000))[""].variables["texts"].values[49] == "x" * 1000
    with pytest.raises(FileError, match="more than 40000 bytes of text"):
        load(path, Budget(text_bytes=40_000))


def test_text_is_counted_over_the_whole_file(tmp_path):
    path = tmp_path / "file.nc"
    with h5py.File(path, "w") as file:
        for name in "abc":
            file[name] = name * 1000
            file.attrs[name] = name * 1000
    assert load(path, Budget(text_bytes=6000))
    with pytest.raises(FileError, match="more than 5999 bytes of text"):
        load(path, Budget(text_bytes=5999))


def test_one_long_text_among_many_short_ones_is_refused(tmp_path):
    """Each of them would take the room of the longest, 12 GB."""
    path = tmp_path / "file.nc"
    with h5py.File(path, "w") as file:
        file.create_dataset("texts", data=["x" * 300_000, *["y"] * 9_999], dtype=h5py.string_dtype())
    with pytest.raises(FileError, match="texts: more than 67108864 bytes of text; shorten it"):
        read(path)


def test_pointers_in_chunks_of_millions_are_refused(tmp_path):
    path = tmp_path / "file.nc"
    with h5py.File(path, "w") as file:
        file.create_dataset("texts", data=["x"], dtype=h5py.string_dtype(), chunks=(100_000,), maxshape=(None,))
    with pytest.raises(FileError, match="more than 1048576 bytes of pointers to text; use fewer chunks"):
        read(path)


def test_chunked_text_is_read(tmp_path):
    """Text along an unlimited dimension, partly never written."""
    path = tmp_path / "file.nc"
    with h5py.File(path, "w") as file:
        file.create_dataset("written", data=["a", "bc", "d"], dtype=h5py.string_dtype(), chunks=(2,), maxshape=(None,))
        file.create_dataset("unwritten", (2,), dtype=h5py.string_dtype())
    tree = read(path)
    assert tree["written"].values.tolist() == ["a", "bc", "d"]
    assert tree["unwritten"].values.tolist() == ["", ""]


def test_a_heap_cut_short_is_refused(tmp_path, record):
    path = tmp_path / "file.nc"
    write(record, path)
    path.write_bytes(path.read_bytes() + b"GCOL\x01\0\0\0")
    with pytest.raises(FileError, match="text storage is damaged at byte"):
        read(path)


def test_scales_that_are_no_text_are_passed_over(tmp_path):
    """The marks of a dimension scale may be of any type in a hostile file: then it is no scale."""
    path = tmp_path / "file.nc"
    with h5py.File(path, "w") as file:
        for name, mark in (("a", 5), ("b", "DIMENSION_SCALE"), ("c", [b"DIMENSION_SCALE"])):
            file[name] = [1.0]
            file[name].attrs["CLASS"] = mark
    assert read(path)["a"].dims == ("phony_dim_0",)


def test_a_list_of_many_texts_in_an_attribute_is_refused(tmp_path):
    path = tmp_path / "file.nc"
    with h5py.File(path, "w") as file:
        file.attrs["texts"] = ["x" * 1000] * 100
    assert len(read(path).attrs["texts"]) == 100
    with pytest.raises(FileError, match="too many texts; join them into one"):
        load(path, Budget(text_bytes=10_000))


def test_marks_of_text_storage_in_an_array_are_each_read_once(tmp_path, monkeypatch):
    """Each of 16,000 would be walked to its end, 4 kB of it: two minutes and 6 GB."""
    path = tmp_path / "file.nc"
    one = b"GCOL\x01\0\0\0" + (4096).to_bytes(8, "little") + b"\x01\0" + bytes(14)
    with h5py.File(path, "w") as file:
        file.create_dataset("values", data=np.frombuffer(one * 13_000, dtype="u1"))
    taken, seen = [], os.pread
    monkeypatch.setattr(os, "pread", lambda *given: taken.append(given[1]) or seen(*given))
    with pytest.raises(FileError, match="text storage is damaged at byte"):
        read(path)
    assert sum(taken) < 3 * path.stat().st_size


def test_marks_that_the_library_refuses_itself_are_passed_over(tmp_path, record):
    """Collections of less than 4096 bytes are none: of 8 million in an array each was looked at."""
    path = tmp_path / "file.nc"
    one = b"GCOL\x01\0\0\0" + (4095).to_bytes(8, "little") + bytes(16)
    values = np.frombuffer(one * 13_000, dtype="u1")
    with h5py.File(path, "w") as file:
        file["values"] = values
        file["text"] = ["label"]
    assert len(guard.sound_heaps(path)) == 1
    assert np.array_equal(read(path)["values"], values)
    raw = bytearray(path.read_bytes())
    start = raw.rfind(b"GCOL")
    raw[start + 8 : start + 16] = (4095).to_bytes(8, "little")
    path.write_bytes(raw)
    with pytest.raises(FileError, match="text: its text is damaged"):
        read(path)
    with h5py.File(path) as file, pytest.raises(OSError, match="global heap size is too small"):
        file["text"][()]


@pytest.mark.parametrize(("limit", "most"), [("MOST_OBJECTS", 1), ("MOST_BYTES", 4096)])
def test_text_storage_is_bounded(limit, most, tmp_path, monkeypatch):
    path = tmp_path / "file.nc"
    with h5py.File(path, "w") as file:
        file["texts"] = ["x" * 3000] * 3
    assert guard.sound_heaps(path)
    monkeypatch.setattr(guard, limit, most)
    with pytest.raises(FileError, match=f"more than {most} "):
        guard.sound_heaps(path)


def test_a_file_that_is_cut_while_it_is_looked_over_is_damaged(tmp_path, record, monkeypatch):
    """It ended the process with SIGBUS."""
    path = tmp_path / "file.nc"
    write(record, path)
    seen = guard._starts

    def cutting(descriptor):
        for start in seen(descriptor):
            os.truncate(path, start + 20)
            yield start

    monkeypatch.setattr(guard, "_starts", cutting)
    with pytest.raises(FileError, match="text storage is damaged at byte"):
        read(path)
