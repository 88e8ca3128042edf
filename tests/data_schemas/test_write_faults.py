"""Every call of the system that writing makes fails once, each in every way: the folder stays as it was."""

from __future__ import annotations

import errno
import os

import pytest

from data_schemas import read, write, writing
from data_schemas.errors import FileError

WAYS = {
    errno.ENOSPC: "No space left on device",
    errno.EROFS: "Read-only file system",
    errno.EACCES: "Permission denied",
    errno.EIO: "Input/output error",
    errno.EDQUOT: "Disk quota exceeded",
}
CALLS = ("open", "fdopen", "fsync", "link", "replace", "close")
MOST = 4  # more than any of them is called in one write


class Faulty:
    """The module `os`, of which one call of a function fails."""

    def __init__(self, name, count, number):
        self._name, self._left, self._number = name, count, number
        self.failed = False

    def __getattr__(self, name):
        real = getattr(os, name)
        if name != self._name:
            return real

        def call(*args, **kwargs):
            self._left -= 1
            if self._left == 0:
                self.failed = True
                if name == "close":
                    real(*args)
                raise OSError(self._number, WAYS[self._number])
            return real(*args, **kwargs)

        return call


def fault_of(record, path, overwrite):
    """What writing complains of, if it does."""
    try:
        write(record, path, overwrite=overwrite)
    except FileError as error:
        return str(error)
    return None


@pytest.mark.parametrize("older", [False, True], ids=["new", "older"])
@pytest.mark.parametrize("name", CALLS)
def test_a_fault_at_every_call_leaves_whole_files(tmp_path, record, monkeypatch, name, older):
    """After it the folder holds the old file or the new one, whole; what could not be done is told in one line."""
    path = tmp_path / "file.nc"
    hit = 0
    for number in WAYS:
        for count in range(1, MOST):
            for stale in tmp_path.iterdir():
                stale.unlink()
            if older:
                record.attrs["title"] = "old"
                write(record, path)
            before = path.read_bytes() if older else None
            record.attrs["title"] = "new"
            faulty = Faulty(name, count, number)
            with monkeypatch.context() as patch:
                patch.setattr(writing, "os", faulty)
                told = fault_of(record, path, older)
            if told is None:
                assert not faulty.failed or name == "link"  # without hard links it is renamed
            else:
                assert told.startswith(f"{path}: cannot be written, {WAYS[number]}; ")
                assert "\n" not in told
            names = [one.name for one in tmp_path.iterdir()]
            assert names in (["file.nc"], [])
            if names and path.read_bytes() != before:
                assert read(path).attrs["title"] == "new"
            elif older:
                assert path.read_bytes() == before
            hit += faulty.failed
    assert hit >= len(WAYS) or (name == "replace" and not older) or (name == "link" and older)


def test_a_short_write_is_finished_or_told(tmp_path, record, monkeypatch):
    """A disk that takes a few bytes at a time gets all; one that then stops leaves nothing."""
    import io

    class Slow(io.FileIO):
        most = 1 << 30

        def write(self, data):
            if self.tell() >= self.most:
                raise OSError(errno.ENOSPC, WAYS[errno.ENOSPC])
            return super().write(memoryview(data).cast("B")[:1000])

    instead = Faulty("none", 1, errno.EIO)
    instead.fdopen = lambda descriptor, mode: io.BufferedWriter(Slow(descriptor, mode), 512)
    path = tmp_path / "file.nc"
    with monkeypatch.context() as patch:
        patch.setattr(writing, "os", instead)
        write(record, path)
        assert read(path).identical(record)
        Slow.most = 3000
        with pytest.raises(FileError, match="cannot be written, No space left on device"):
            write(record, tmp_path / "other.nc")
    assert [one.name for one in tmp_path.iterdir()] == ["file.nc"]
