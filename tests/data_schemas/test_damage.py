"""A damaged file gives its content or a clear refusal, never other content."""

from __future__ import annotations

import errno
from pathlib import Path

import h5py
import numpy as np
import pytest

from data_schemas import read, validate, write
from data_schemas.errors import FileError


def _same_or_refused(path, tree) -> bool:
    """Whether the file was refused, in one line; otherwise it must give what was written."""
    try:
        back = read(path)
    except FileError as error:
        told = str(error)
    else:
        assert back.identical(tree)
        return False
    assert told.startswith(f"{path}: ")
    assert told.isprintable()
    assert validate(path) == [told]
    return True


def _flips(path, tree, count, seed):
    good = path.read_bytes()
    draw = np.random.default_rng(seed)
    refused = 0
    for bit in draw.choice(8 * len(good), size=count, replace=False):
        bad = bytearray(good)
        bad[bit // 8] ^= 1 << (bit % 8)
        path.write_bytes(bad)
        refused += _same_or_refused(path, tree)
    return refused


def test_no_flipped_bit_passes_silently(tmp_path, record):
    path = tmp_path / "file.nc"
    write(record, path)
    # most bytes of a small file are metadata and values; the rest is padding, whose flips are harmless
    assert _flips(path, record, 500, seed=1) > 50


@pytest.mark.campaign
def test_no_flipped_bit_of_any_kind_passes_silently(tmp_path, example):
    for seed, kind in enumerate(("record", "truth", "result")):
        path = tmp_path / f"{kind}.nc"
        write(example(kind), path)
        assert _flips(path, example(kind), 3400, seed) > 340


def test_no_flipped_bit_in_values_passes(tmp_path, record):
    """Each bit of a value is covered twice: by fletcher32 of its chunk and by the checksum of the content."""
    path = tmp_path / "file.nc"
    write(record, path)
    good = path.read_bytes()
    start = good.find(record["record"]["elongation"].values[0].tobytes())
    assert start > 0
    for offset in range(0, 40 * 8, 13):
        bad = bytearray(good)
        bad[start + offset] ^= 1 << (offset % 8)
        path.write_bytes(bad)
        assert _same_or_refused(path, record)


def test_every_truncation_is_refused(tmp_path, record):
    path = tmp_path / "file.nc"
    write(record, path)
    good = path.read_bytes()
    for length in range(0, len(good), 97):
        path.write_bytes(good[:length])
        assert _same_or_refused(path, record), length


@pytest.mark.campaign
def test_every_truncation_at_every_byte_is_refused(tmp_path, record):
    path = tmp_path / "file.nc"
    write(record, path)
    good = path.read_bytes()
    for length in range(len(good)):
        path.write_bytes(good[:length])
        assert _same_or_refused(path, record), length


def test_no_flipped_bit_in_the_heap_hangs_or_passes(tmp_path, record):
    """The library loops for ever on some of these flips, and asks for gigabytes on others: it must not see them."""
    path = tmp_path / "file.nc"
    write(record, path)
    good = path.read_bytes()
    heap = good.find(b"GCOL")
    assert heap > 0
    label = good.find(b"1-2", heap)
    refused = 0
    for offset in (*range(heap, heap + 80), *range(label - 16, label + 24)):
        for bit in (0, 1, 7):
            bad = bytearray(good)
            bad[offset] ^= 1 << bit
            path.write_bytes(bad)
            refused += _same_or_refused(path, record)
    assert refused > 100


def test_no_flipped_bit_in_a_pointer_to_text_passes(tmp_path, record):
    path = tmp_path / "file.nc"
    write(record, path)
    good = path.read_bytes()
    with h5py.File(path) as file:
        start = file["record/trace"].id.get_offset()
    refused = 0
    for bit in range(8 * 32):
        bad = bytearray(good)
        bad[start + bit // 8] ^= 1 << (bit % 8)
        path.write_bytes(bad)
        refused += _same_or_refused(path, record)
    assert refused >= 8 * 32 - 2  # a pointer may come to point at an equal text
    # the length is refused before the library asks for that much memory, not after, by the checksum
    path.write_bytes(good[: start + 3] + b"\x80" + good[start + 4 :])
    with pytest.raises(FileError, match="record/trace: its text is damaged"):
        read(path)


def test_a_longer_file_is_the_same_or_refused(tmp_path, record):
    path = tmp_path / "file.nc"
    write(record, path)
    path.write_bytes(path.read_bytes() + b"tail")
    _same_or_refused(path, record)


def test_a_file_that_may_not_be_read_is_told(tmp_path, monkeypatch):
    (tmp_path / "file.nc").write_bytes(b"x")

    def refused(*_args, **_options):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refused)
    with pytest.raises(FileError, match=r"file\.nc: Permission denied; make the file readable"):
        read(tmp_path / "file.nc")


@pytest.mark.parametrize("error", [MemoryError(), OSError(errno.ENOMEM, "Cannot allocate memory")])
@pytest.mark.parametrize("where", ["survey", "_numbers"])
def test_a_lack_of_memory_is_no_damage(tmp_path, record, monkeypatch, error, where):
    write(record, tmp_path / "file.nc")

    def full(*_args, **_options):
        raise error

    monkeypatch.setattr(f"data_schemas.reading.{where}", full)
    with pytest.raises(FileError, match="takes more memory than this process may have; give it more"):
        read(tmp_path / "file.nc")
