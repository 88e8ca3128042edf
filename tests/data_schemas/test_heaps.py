"""Text storage is stepped through as the library would, to the byte."""

from __future__ import annotations

import itertools
import struct
from pathlib import Path

import numpy as np
import pytest

from data_schemas import guard
from data_schemas.errors import FileError

SIZE = 4096  # the least that a collection has


def collection(*lengths: int, size: int = SIZE, rest: int | None = None) -> bytes:
    """Objects of these lengths, numbered from 1, and the free rest, which states its own length or another."""
    made = b"GCOL\x01\0\0\0" + struct.pack("<Q", size)
    for index, length in enumerate(lengths, start=1):
        made += struct.pack("<HHIQ", index, 1, 0, length) + b"x" * length + bytes(-length % 8)
    left = size - len(made)
    assert left >= 0
    if left < 16:
        return made + bytes(left)
    return made + struct.pack("<HHIQ", 0, 0, 0, left if rest is None else rest) + bytes(left - 16)


def found(tmp_path: Path, data: bytes) -> guard.Heaps:
    (tmp_path / "file").write_bytes(data)
    return guard.sound_heaps(tmp_path / "file")


@pytest.mark.parametrize(("limit", "window"), [(0, 17), (1, 64), (2, 1000), (3, SIZE + 5)])
def test_windows_of_any_size_find_the_same(tmp_path, monkeypatch, limit: int, window: int) -> None:
    """Also where a mark, or the length that follows it, lies across two windows; what is too short is none."""
    short = b"GCOL\x01\0\0\0" + struct.pack("<Q", SIZE - 1)
    data, starts = b"", []
    for gap in range(limit, 40, 3):
        starts.append(len(data) + gap)
        data += bytes(gap) + collection(gap, 8) + short
    monkeypatch.setattr(guard, "_WINDOW", window)
    assert found(tmp_path, data) == {
        start: {1: gap, 2: 8} for start, gap in zip(starts, range(limit, 40, 3), strict=True)
    }


@pytest.mark.parametrize("lengths", [(), (0,), (1,), (8, 9), (7, 0, 300), (SIZE - 32,), (SIZE - 40,), (SIZE - 47,)])
def test_objects_have_their_lengths_by_index(tmp_path, lengths: tuple[int, ...]) -> None:
    assert found(tmp_path, b"head" + collection(*lengths)) == {4: dict(enumerate(lengths, start=1))}


@pytest.mark.parametrize("rest", [0, 15, SIZE - 16 - 24 + 1, SIZE, 1 << 63])
def test_a_step_that_stands_still_or_leaves_is_damage(tmp_path, rest: int) -> None:
    with pytest.raises(FileError, match="damaged at byte 8; restore it"):
        found(tmp_path, bytes(8) + collection(8, rest=rest))


def test_an_object_longer_than_its_collection_is_damage(tmp_path) -> None:
    data = bytearray(collection(8))
    data[16 + 8 : 16 + 16] = struct.pack("<Q", SIZE - 32 + 1)
    with pytest.raises(FileError, match="damaged at byte 0"):
        found(tmp_path, bytes(data))


def test_neighbours_are_sound_and_one_within_another_is_not(tmp_path) -> None:
    assert list(found(tmp_path, collection(8) + collection(16))) == [0, SIZE]
    inner = collection(8)
    outer = bytearray(collection(SIZE + 8, size=2 * SIZE))
    outer[32 : 32 + SIZE] = inner
    with pytest.raises(FileError, match="damaged at byte 32"):
        found(tmp_path, bytes(outer))
    with pytest.raises(FileError, match=f"damaged at byte {SIZE + 8}"):
        found(tmp_path, bytes(8) + collection(8) + collection(8)[: SIZE - 1])
    with pytest.raises(FileError, match="damaged at byte 5"):
        found(tmp_path, bytes(5) + collection()[:15])


def test_all_collections_are_bounded_together(tmp_path, monkeypatch) -> None:
    data = collection(8, 8) + bytes(100) + collection(8, size=SIZE + 8)
    for limit, need in (("MOST_BYTES", 2 * SIZE + 8), ("MOST_OBJECTS", 3)):
        with monkeypatch.context() as patch:
            patch.setattr(guard, limit, need)
            assert len(found(tmp_path, data)) == 2
            patch.setattr(guard, limit, need - 1)
            with pytest.raises(FileError, match=f"file: more than {need - 1} "):
                found(tmp_path, data)


def test_pointers_claim_what_is_there_at_most() -> None:
    known = {100: {1: 5, 2: 0}, 4200: {1: 7}}

    def pointed(*pointers: tuple[int, int, int], rest: bytes = b"") -> int:
        return guard._pointed(np.array(list(pointers), dtype=guard._POINTER).tobytes() + rest, known, "a")

    assert pointed((5, 100, 1), (3, 4200, 1), (0, 100, 2), (0, 9, 9)) == 8
    assert pointed((7, 4200, 1), rest=b"\xff" * 15) == 7
    for wrong in ((6, 100, 1), (1, 100, 2), (1, 100, 3), (1, 101, 1)):
        for place in itertools.permutations([wrong, (1, 100, 1)]):
            with pytest.raises(FileError, match="a: its text is damaged; restore the file"):
                pointed(*place)
