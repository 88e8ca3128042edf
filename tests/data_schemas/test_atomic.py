"""A write is whole or leaves no trace: full disk, no permission, interrupts, competitors."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from data_schemas import read, write, writing
from data_schemas.errors import FileError


def _fail(error):
    def failing(*_args, **_kwargs):
        raise error

    return failing


FULL = OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize("step", ["open", "fsync", "replace", "fdopen"])
@pytest.mark.parametrize("error", [FULL, KeyboardInterrupt(), MemoryError()], ids=["full", "interrupt", "memory"])
@pytest.mark.parametrize("older", [False, True])
def test_a_fault_at_any_step_leaves_the_folder_as_it_was(tmp_path, record, monkeypatch, step, error, older):
    path = tmp_path / "file.nc"
    if older:
        write(record, path)
        before = path.read_bytes()
    if step == "replace":  # the name is given by link when nothing may be replaced
        monkeypatch.setattr(writing.os, "link", _fail(OSError(errno.EPERM, "no hard links here")))
    monkeypatch.setattr(writing.os, step, _fail(error))
    wanted = FileError if isinstance(error, OSError) else type(error)
    with pytest.raises(wanted) as told:
        write(record, path, overwrite=older)
    monkeypatch.undo()
    assert [one.name for one in tmp_path.iterdir()] == (["file.nc"] if older else [])
    if older:
        assert path.read_bytes() == before
    if wanted is FileError:
        assert str(told.value).startswith(f"{path}: cannot be written, No space left on device; ")


def test_a_limit_of_file_size_is_told_in_one_line(tmp_path):
    """A real failure of the write itself, in a process of its own."""
    program = f"""
import resource, signal, xarray
from data_schemas import write
from data_schemas.errors import FileError
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (3000, 3000))
try:
    write(xarray.DataTree(xarray.Dataset({{"a": ("x", [1.0] * 1000)}})), {str(tmp_path / "file.nc")!r})
except FileError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == f"{tmp_path / 'file.nc'}: cannot be written, File too large; " + (
        "free space, or choose a folder you may write to\n"
    )
    assert list(tmp_path.iterdir()) == []


def test_a_kill_leaves_no_file_of_that_name(tmp_path):
    """The worst moment: all bytes written, nothing flushed."""
    program = f"""
import os, signal, xarray
from data_schemas import write, writing
writing.os.fsync = lambda _: os.kill(os.getpid(), signal.SIGKILL)
write(xarray.DataTree(xarray.Dataset({{"a": ("x", [1.0] * 1000)}})), {str(tmp_path / "file.nc")!r})
"""
    done = subprocess.run([sys.executable, "-c", program], check=False)
    assert done.returncode == -signal.SIGKILL
    assert not (tmp_path / "file.nc").exists()
    assert all(one.name.startswith(".") and one.name.endswith(".part") for one in tmp_path.iterdir())


def test_an_existing_file_is_kept_unless_told(tmp_path, record):
    path = tmp_path / "file.nc"
    path.write_text("mine")
    with pytest.raises(FileError, match=r"exists already; give --force"):
        write(record, path)
    assert path.read_text() == "mine"
    write(record, path, overwrite=True)
    assert read(path).identical(record)


def test_a_file_that_appears_meanwhile_is_kept(tmp_path, record, monkeypatch):
    path = tmp_path / "file.nc"
    encode = writing.encoded

    def slow(contents):
        path.write_text("another was faster")
        return encode(contents)

    monkeypatch.setattr(writing, "encoded", slow)
    with pytest.raises(FileError, match="exists already"):
        write(record, path)
    assert path.read_text() == "another was faster"
    assert [one.name for one in tmp_path.iterdir()] == ["file.nc"]


def test_what_would_not_read_back_is_not_written(tmp_path, record):
    record.attrs |= {f"a{index}": index for index in range(300)}
    with pytest.raises(FileError, match="was not written, it would not read back: root: more than 256 attributes"):
        write(record, tmp_path / "file.nc")
    assert list(tmp_path.iterdir()) == []


def test_a_library_that_writes_something_else_is_found_out(tmp_path, record, monkeypatch):
    class Wrong:
        """HDF5 with a fault in its last bit."""

        def __init__(self, array):
            self._array = array

        def __getattr__(self, name):
            return getattr(self._array, name)

        def write(self, memory, file, values):
            self._array.write(memory, file, np.nextafter(values, np.inf) if values.dtype.kind == "f" else values)

    lay_out = writing.lay_out
    monkeypatch.setattr(
        writing,
        "lay_out",
        lambda *given: {name: SimpleNamespace(id=Wrong(each.id)) for name, each in lay_out(*given).items()},
    )
    with pytest.raises(FileError, match="was not written, it would not read back: other values come back"):
        write(record, tmp_path / "file.nc")
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_gives_something_else_back_is_found_out(tmp_path, record, monkeypatch):
    flushed = writing._flushed

    def wrong(temporary, image):
        flushed(temporary, image)
        with temporary.open("r+b") as file:
            file.seek(image.nbytes // 2)
            file.write(bytes([image[image.nbytes // 2] ^ 1]))

    monkeypatch.setattr(writing, "_flushed", wrong)
    with pytest.raises(FileError, match="was not written, the disk gives other bytes back; check the disk"):
        write(record, tmp_path / "file.nc")
    assert list(tmp_path.iterdir()) == []


def test_places_where_no_file_can_be(tmp_path, record):
    with pytest.raises(FileError, match="its folder does not exist; make the folder first"):
        write(record, tmp_path / "none" / "file.nc")
    with pytest.raises(FileError, match="is not an ordinary file"):
        write(record, tmp_path, overwrite=True)
    os.mkfifo(tmp_path / "pipe")  # a device would be destroyed where the code is wrong and root runs the tests
    with pytest.raises(FileError, match="is not an ordinary file"):
        write(record, tmp_path / "pipe", overwrite=True)
    with pytest.raises(FileError, match="cannot be written, File name too long"):
        write(record, tmp_path / ("x" * 300))


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_permission(tmp_path, record):
    tmp_path.chmod(0o500)
    with pytest.raises(FileError, match="cannot be written, Permission denied"):
        write(record, tmp_path / "file.nc")


@pytest.mark.parametrize("there", [True, False])
def test_a_link_is_replaced_and_what_it_points_to_stays(there, tmp_path, record):
    """It was followed, and its target destroyed; one that pointed nowhere counted as not there."""
    link, target = tmp_path / "link.nc", tmp_path / "target"
    if there:
        target.write_text("precious")
    link.symlink_to(target)
    with pytest.raises(FileError, match="exists already"):
        write(record, link)
    write(record, link, overwrite=True)
    assert not link.is_symlink()
    assert read(link).identical(record)
    assert (target.read_text() == "precious") if there else not target.exists()


def test_a_link_to_a_folder_is_followed_on_the_way(tmp_path, record):
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    write(record, tmp_path / "link/file.nc")
    assert read(tmp_path / "real/file.nc").identical(record)


def test_the_file_has_the_usual_permissions(tmp_path, record):
    path = tmp_path / "file.nc"
    mask = os.umask(0o027)
    try:
        write(record, path)
    finally:
        os.umask(mask)
    assert path.stat().st_mode & 0o777 == 0o640


def test_a_tree_read_from_a_file_can_replace_it(tmp_path, record):
    path = tmp_path / "file.nc"
    write(record, path)
    write(read(path), path, overwrite=True)
    assert read(path).identical(record)


def test_text_is_whole_or_not_there(tmp_path, monkeypatch):
    path = tmp_path / "table.csv"
    writing.write_text("a,b\n", path)
    with pytest.raises(FileError, match="exists"):
        writing.write_text("c\n", path)
    monkeypatch.setattr(writing.os, "fsync", _fail(FULL))
    with pytest.raises(FileError, match=r"table\.csv: cannot be written, No space left"):
        writing.write_text("c\n", path, overwrite=True)
    monkeypatch.undo()
    assert [(one.name, one.read_text()) for one in tmp_path.iterdir()] == [("table.csv", "a,b\n")]


def test_folders_are_made_to_remember_where_that_can_be_asked(tmp_path, monkeypatch):
    monkeypatch.setattr(writing.os, "open", _fail(FULL))
    with pytest.raises(OSError, match="No space"):
        writing.sync_folder(tmp_path)
    monkeypatch.setattr(writing.os, "name", "nt")
    writing.sync_folder(tmp_path)
    monkeypatch.undo()
