"""A disk that fails is not seen by whoever writes, who reads back what he wrote."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from data_schemas.appending import Sink


def test_what_could_not_be_written_is_read_back(tmp_path: Path) -> None:
    full = OSError(errno.ENOSPC, "No space left on device")
    with Sink(tmp_path / "file", "x+") as sink:
        sink.write(b"abcdef")
        sink.fault = full
        sink.seek(4)
        assert sink.write(b"XYZ") == 3
        sink.seek(5)
        sink.write(b"!")
        found = bytearray(b"?" * 10)
        sink.seek(0)
        assert sink.readinto(found) == 10
        assert bytes(found) == b"abcdX!Z\0\0\0"
        part = bytearray(2)
        sink.seek(6)
        sink.readinto(part)
        assert bytes(part) == b"Z\0"
        with pytest.raises(OSError, match="No space left"):
            sink.check()
    assert (tmp_path / "file").read_bytes() == b"abcdef"


def test_without_a_fault_it_is_a_file(tmp_path: Path) -> None:
    with Sink(tmp_path / "file", "x+") as sink:
        sink.write(b"abc")
        sink.seek(1)
        found = bytearray(2)
        sink.readinto(found)
        sink.check()
    assert bytes(found) == b"bc"


def test_the_length_is_set_unless_the_disk_failed_before(tmp_path: Path) -> None:
    with Sink(tmp_path / "file", "x+") as sink:
        sink.write(b"abcdef")
        assert sink.truncate(4) == 4
        sink.seek(2)
        assert sink.truncate() == 2
        assert sink.truncate(-1) == -1
        with pytest.raises(OSError, match="Invalid argument"):
            sink.check()
        assert sink.truncate(0) == 0
    assert (tmp_path / "file").read_bytes() == b"ab"
