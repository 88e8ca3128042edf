"""A file written portion by portion is the file written at once, and whole or not there."""

from __future__ import annotations

import errno
import signal
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from data_schemas import content_sha256, guard, read, validate, write, writing
from data_schemas.appending import Appended, Sink
from data_schemas.checksum import slabs
from data_schemas.contents import Contents, Entry, Group, from_tree
from data_schemas.errors import FileError
from data_schemas.reading import skim


def cut(contents: Contents, begin: int, end: int) -> Contents:
    """A portion along time."""
    return {
        path: Group(
            dict(group.attrs),
            {
                name: Entry(one.dims, one.values[..., begin:end] if "time" in one.dims else one.values, one.attrs)
                for name, one in group.variables.items()
            },
        )
        for path, group in contents.items()
    }


def append(tree, path: Path, edges: list[int], **options) -> None:
    with Appended(path, edges[-1], **options) as file:
        for begin, end in zip([0, *edges], edges, strict=False):
            file.append(cut(from_tree(tree), begin, end))
        file.finish()
        file.publish()


@pytest.mark.parametrize("kind", ["record", "truth", "result"])
@pytest.mark.parametrize("edges", [[40], [1, 40], [13, 26, 40], [8, 16, 17, 40]])
@pytest.mark.parametrize("chunk", [8, 1 << 16])
def test_portions_make_the_same_file(tmp_path, example, monkeypatch, kind, edges, chunk):
    monkeypatch.setattr(writing, "CHUNK", chunk)
    tree = example(kind)
    append(tree, tmp_path / "portions.nc", edges)
    write(tree, tmp_path / "whole.nc")
    assert read(tmp_path / "portions.nc").identical(read(tmp_path / "whole.nc"))
    sums = [h5py.File(tmp_path / name).attrs["content_sha256"] for name in ("portions.nc", "whole.nc")]
    assert sums[0] == sums[1] == content_sha256(tree)
    assert validate(tmp_path / "portions.nc") == validate(tmp_path / "whole.nc")
    assert sorted(one.name for one in tmp_path.iterdir()) == ["portions.nc", "whole.nc"]


def test_every_array_of_numbers_has_checksums(tmp_path, record):
    append(record, tmp_path / "file.nc", [20, 40])
    with h5py.File(tmp_path / "file.nc") as file:
        assert file["record/elongation"].fletcher32
        assert file["time"].fletcher32


def test_what_is_missing_is_not_written(tmp_path, record):
    with Appended(tmp_path / "file.nc", 40) as file:
        file.append(cut(from_tree(record), 0, 39))
        with pytest.raises(ValueError, match="39 of 40 samples"):
            file.finish()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "error", [OSError(errno.ENOSPC, "No space left on device"), KeyboardInterrupt(), MemoryError()]
)
@pytest.mark.parametrize("step", ["fsync", "write", "replace"])
@pytest.mark.parametrize("older", [False, True])
def test_a_fault_at_any_step_leaves_the_folder_as_it_was(tmp_path, record, monkeypatch, step, error, older):
    path = tmp_path / "file.nc"
    if older:
        write(record, path)
        before = path.read_bytes()

    def failing(*_args: object, **_options: object) -> None:
        raise error

    if step == "write":  # inside HDF5, which must not see it
        monkeypatch.setattr(Sink, "_kept", lambda sink, _: setattr(sink, "fault", sink.fault or error))
    else:
        if step == "replace":  # the name is given by link when nothing may be replaced
            monkeypatch.setattr(writing.os, "link", failing)
        monkeypatch.setattr(writing.os, step, failing)
    wanted = FileError if isinstance(error, OSError) else type(error)
    with pytest.raises(wanted) as told:
        append(record, path, [20, 40], overwrite=older)
    monkeypatch.undo()
    assert [one.name for one in tmp_path.iterdir()] == (["file.nc"] if older else [])
    if older:
        assert path.read_bytes() == before
    if wanted is FileError:
        assert str(told.value) == (
            f"{path}: cannot be written, No space left on device; free space, or choose a folder you may write to"
        )


def test_a_file_that_exists_is_kept_unless_told(tmp_path, record):
    path = tmp_path / "file.nc"
    path.write_text("mine")
    with pytest.raises(FileError, match=r"file\.nc: exists already; give --force"):
        append(record, path, [40])
    with pytest.raises(FileError, match="its folder does not exist"):
        append(record, tmp_path / "none" / "file.nc", [40])
    assert path.read_text() == "mine"
    append(record, path, [40], overwrite=True)
    assert read(path).identical(record)


_PROGRAM = """
import os, resource, signal, sys
import numpy as np
from data_schemas.appending import Appended
from data_schemas.contents import Entry, Group
from data_schemas.errors import FileError
{before}
try:
    with Appended({path!r}, 400_000) as file:
        for _ in range(4):
            file.append({{"": Group({{}}, {{"a": Entry(("time",), np.random.default_rng(1).normal(size=100_000))}})}})
            {during}
        file.finish()
        file.publish()
except FileError as error:
    print(error)
"""


def _run(path: Path, before: str = "", during: str = "") -> subprocess.CompletedProcess[str]:
    program = _PROGRAM.format(path=str(path), before=before, during=during)
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)


@pytest.mark.parametrize("limit", [0, 1000, 10**5, 10**6, 2 * 10**6])
def test_a_disk_that_fills_up_is_told_in_one_line(tmp_path, limit):
    """A real failure inside HDF5, in a process of its own, which must end in peace."""
    program = f"resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))"
    done = _run(tmp_path / "file.nc", before=f"signal.signal(signal.SIGXFSZ, signal.SIG_IGN); {program}")
    assert done.stdout.startswith(f"{tmp_path / 'file.nc'}: cannot be written, File too large; ")
    assert done.stdout.count("\n") == 1
    assert (done.returncode, done.stderr) == (0, "")
    assert list(tmp_path.iterdir()) == []


def test_a_kill_leaves_no_file_of_that_name(tmp_path):
    done = _run(tmp_path / "file.nc", during="os.kill(os.getpid(), signal.SIGKILL)")
    assert done.returncode == -signal.SIGKILL
    assert all(one.name.startswith(".") and one.name.endswith(".part") for one in tmp_path.iterdir())


def test_what_the_disk_changed_is_not_handed_out(tmp_path, record, monkeypatch):
    path = tmp_path / "file.nc"
    with Appended(path, 40) as file:
        file.append(cut(from_tree(record), 0, 40))
        (temporary,) = tmp_path.iterdir()
        stored = record["record/elongation"].values[1].tobytes()
        verified = file._verified

        def damaged():
            image = bytearray(temporary.read_bytes())
            image[image.index(stored) + 7] ^= 1
            temporary.write_bytes(image)
            return verified()

        monkeypatch.setattr(file, "_verified", damaged)
        with pytest.raises(FileError, match=r"file\.nc: was not written, it would not read back: .* damaged"):
            file.finish()
    assert list(tmp_path.iterdir()) == []


def test_what_the_guard_would_refuse_is_not_written(tmp_path, record):
    record.attrs |= {f"a{index}": index for index in range(300)}
    with pytest.raises(FileError, match="was not written, it would not read back: root: more than 256 attributes"):
        append(record, tmp_path / "file.nc", [40])
    assert list(tmp_path.iterdir()) == []


def test_only_the_last_dimension_grows(tmp_path):
    with (
        Appended(tmp_path / "file.nc", 4) as file,
        pytest.raises(FileError, match=r"file\.nc: a: grows along 'time'; make that its last dimension"),
    ):
        file.append({"": Group({}, {"a": Entry(("time", "trace"), np.zeros((2, 2)))})})


def test_skimming_sums_up_what_reading_does(tmp_path, record):
    path = tmp_path / "file.nc"
    write(record, path)
    contents, digest = skim(path)
    assert digest == content_sha256(record)
    assert contents[""].attrs == from_tree(record)[""].attrs
    with h5py.File(path, "r+") as file:
        file["record/elongation"][0, 3] += 1e-16
    with pytest.raises(FileError, match=r"file\.nc: content_sha256 does not match"):
        skim(path)


@pytest.mark.parametrize("shape", [(), (0,), (7,), (3, 5), (5, 3), (2, 3, 4), (4, 0), (1, 1, 1, 9)])
@pytest.mark.parametrize("most", [1, 2, 4, 7, 100])
def test_slabs_cover_an_array_in_order(shape, most):
    array = np.arange(np.prod(shape, dtype=int)).reshape(shape)
    parts = [np.asarray(array[place]) for place in slabs(shape, most)]
    assert [number for part in parts for number in part.ravel().tolist()] == array.ravel().tolist()
    assert all(part.size <= most for part in parts)


@pytest.mark.parametrize("window", [1, 8, 9, 16, 17, 64, 4096])
def test_heaps_are_found_wherever_windows_end(tmp_path, record, monkeypatch, window):
    write(record, tmp_path / "file.nc")
    whole = guard.sound_heaps(tmp_path / "file.nc")
    assert whole
    monkeypatch.setattr(guard, "_WINDOW", window)
    assert guard.sound_heaps(tmp_path / "file.nc") == whole


def test_a_file_that_never_began_is_closed(tmp_path):
    file = Appended(tmp_path / "file.nc", 3)
    file._close()
    file._sink = Sink(tmp_path / "file.nc", "x+")  # HDF5 could not open it
    file._close(lasting=True)
    assert file._sink is None


def test_what_does_not_grow_is_of_the_first_portion(tmp_path):
    def portion(number: float) -> Contents:
        grown, fixed, empty = np.full(2, number), np.array([number]), np.empty((0, 2))
        variables = {"a": Entry(("time",), grown), "b": Entry(("x",), fixed), "c": Entry(("none", "time"), empty)}
        return {"": Group({"n": number}, variables)}

    with Appended(tmp_path / "file.nc", 4) as file:
        for number in (1.0, 2.0):
            file.append(portion(number))
        file.finish()
        file.publish()
    tree = read(tmp_path / "file.nc")
    assert tree["a"].values.tolist() == [1.0, 1.0, 2.0, 2.0]
    assert tree["b"].values.tolist() == [1.0]
    assert tree["c"].shape == (0, 4)
    assert tree.attrs == {"n": 2.0}
