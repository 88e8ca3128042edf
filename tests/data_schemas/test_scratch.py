"""Arrays in scratch files: like any other, given back portion by portion, in memory where no disk has room."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import data_schemas
from data_schemas import scratch
from data_schemas.errors import FileError

Example = Callable[[str], xr.DataTree]
in_files = pytest.mark.skipif(not hasattr(os, "posix_fallocate"), reason="the system reserves no room in files")


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """More than seven values are long, five are a portion."""
    monkeypatch.setattr(scratch, "LONG", 7)
    monkeypatch.setattr(scratch, "PORTION", 5)


@in_files
@pytest.mark.parametrize("shape", [9, (3, 4), (2, 1, 8)])
@pytest.mark.parametrize("dtype", ["f8", "f4", "u2", "i8"])
def test_a_long_array_is_an_array(short: None, shape: int | tuple[int, ...], dtype: str) -> None:
    array = scratch.room(shape, dtype)
    plain = np.arange(array.size, dtype=dtype).reshape(shape)
    assert (array.shape, array.dtype) == (plain.shape, plain.dtype)
    array[...] = plain
    for view in (array, array[1:], array.reshape(-1)):
        assert scratch.mapping(view) is not None
        scratch.release(view)
    assert np.array_equal(array, plain)


def test_a_short_array_is_in_memory(short: None) -> None:
    assert scratch.mapping(scratch.room(7)) is None
    assert scratch.room(()).shape == ()


@pytest.mark.parametrize("missing", ["room", "system", "address space"])
def test_without_room_it_is_in_memory(short: None, missing: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError(12, "Cannot allocate memory")

    if missing == "room":
        monkeypatch.setattr(scratch, "SHARE", 1 << 60)
    elif missing == "system":
        monkeypatch.delattr(os, "posix_fallocate", raising=False)
    else:
        monkeypatch.setattr("mmap.mmap", refuse)
    array = scratch.room(100)
    array[:] = 1.0
    monkeypatch.undo()
    assert scratch.mapping(array) is None
    assert array.sum() == 100.0


@pytest.mark.parametrize("count", [0, 1, 4, 5, 6, 23])
@pytest.mark.parametrize("unit", [1, 3, 8])
def test_portions_cover_everything_once(short: None, count: int, unit: int) -> None:
    parts = list(scratch.portions(count, unit=unit))
    covered = np.concatenate([np.empty(0, dtype=int), *(np.arange(count)[part] for part in parts)])
    assert covered.tolist() == list(range(count))
    assert all(part.start % unit == 0 for part in parts)
    values = np.arange(count, dtype=float)
    assert np.array_equal(scratch.by_portions(lambda a, b: a + 2.0 * b, values, values), 3.0 * values)


@in_files
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_memory_is_given_back() -> None:
    def held() -> int:
        text = Path("/proc/self/status").read_text()
        return int(text.partition("VmRSS:")[2].split()[0]) * 1024

    array = scratch.room(1 << 22)
    before, most = held(), 0
    for part in scratch.portions(array.size, array):
        array[part] = part.start
        most = max(most, held())
    assert most - before < array.nbytes // 4


def test_a_file_reads_the_same_by_portions(example: Example, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.record.nc"
    data_schemas.write(example("record"), path)
    plain = data_schemas.read(path)
    monkeypatch.setattr(scratch, "LONG", 7)
    monkeypatch.setattr(scratch, "PORTION", 5)
    long = data_schemas.read(path)
    xr.testing.assert_identical(long, plain)
    assert list(long.dataset.indexes) == ["time"]
    assert float(long["time"].sel(time=1.5)) == 1.5
    assert data_schemas.content_sha256(long) == data_schemas.content_sha256(plain)
    assert data_schemas.check(long, "record") == data_schemas.check(plain, "record") == []


def test_damage_is_found_by_portions(short: None, example: Example, tmp_path: Path) -> None:
    path = tmp_path / "a.record.nc"
    data_schemas.write(example("record"), path)
    import h5py

    with h5py.File(path, "r+") as file:
        file["record/elongation"][1, 33] += 1e-16 + 1e-15
    with pytest.raises(FileError, match="does not match the content"):
        data_schemas.read(path)


@pytest.mark.parametrize("at", [0, 4, 5, 6, 39])
def test_faults_are_found_in_any_portion(short: None, example: Example, at: int) -> None:
    """The same lines as all at once."""

    def spoilt(group: str, name: str, value: float) -> list[str]:
        tree = example("record")
        values = tree[group][name].values.copy() if group else tree[name].values.copy()
        values[..., at] = value
        node = tree[group] if group else tree
        kept = node.to_dataset(inherit=False).drop_vars(name)
        dims, attrs = node[name].dims, node[name].attrs
        node.dataset = kept.assign({name: (dims, values, attrs)})
        return data_schemas.check(tree, "record")

    assert any("infinite" in fault for fault in spoilt("record", "elongation", np.inf))
    assert spoilt("record", "elongation", np.nan) == []
    assert any("NaN or infinite" in fault for fault in spoilt("", "time", np.nan))
    falls = spoilt("", "time", -1.0 if at else 7.0)
    assert any(f"at sample {at or 1} " in fault and "1 such" in fault for fault in falls)
