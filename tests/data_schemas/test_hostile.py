"""Files made to deceive, exhaust or hang the reader: each is refused before its values are touched."""

from __future__ import annotations

import os
import socket
from pathlib import Path

import h5py
import numpy as np
import pytest
from h5py import h5d, h5f, h5p, h5s, h5t

from data_schemas import read, validate, write
from data_schemas.errors import FileError


def external_values(file, folder):
    secret = folder / "secret"
    secret.write_bytes(bytes(800))
    file.create_dataset("record/secret", (100,), "f8", external=[(str(secret), 0, 800)])


def external_link(file, folder):
    with h5py.File(folder / "other.nc", "w") as other:
        other["values"] = [1.0]
    file["record/other"] = h5py.ExternalLink(str(folder / "other.nc"), "/values")


def link_to_fifo(file, folder):
    os.mkfifo(folder / "fifo")
    file["record/other"] = h5py.ExternalLink(str(folder / "fifo"), "/values")


def soft_link(file, _):
    file["record/other"] = h5py.SoftLink("/time")


def virtual(file, folder):
    with h5py.File(folder / "other.nc", "w") as other:
        other["values"] = np.zeros(4)
    layout = h5py.VirtualLayout((4,), "f8")
    layout[:] = h5py.VirtualSource(str(folder / "other.nc"), "values", (4,))
    file.create_virtual_dataset("record/other", layout)


def second_name(file, _):
    file["record/other"] = file["time"]


def circle(file, _):
    file["record/inner"] = file["/"]


def many_values(file, _):
    file.create_dataset("record/huge", (2**40,), "f8", chunks=(2**20,), compression=1)


def many_unwritten(file, _):
    file.create_dataset("record/huge", (2**24,), "f8")


def many_texts(file, _):
    file.create_dataset("record/huge", (2**33,), h5py.string_dtype(), chunks=(2**10,))


def many_values_in_all(file, _):
    for index in range(6):
        file.create_dataset(f"record/huge{index}", (2**27,), "f8", chunks=(2**20,), compression=1)


def wide_chunk(file, _):
    file.create_dataset("record/huge", (4,), "f8", chunks=(2**26,), maxshape=(None,), compression=1)


def many_chunks(file, _):
    file.create_dataset("record/huge", (2**21,), "u1", chunks=(1,), compression=1)


def long_attribute(file, _):
    file["record"].attrs["huge"] = np.zeros(2**20)


def long_text_attribute(file, _):
    file["record"].attrs["huge"] = np.bytes_(b"x" * 2**23)


def much_text(file, _):
    file["record"].attrs["huge"] = "x" * (65 * 2**20)


def many_attributes(file, _):
    for index in range(1500):
        file["record"].attrs[f"a{index}"] = index


def deep_groups(file, _):
    file.create_group("record/" + "/".join("g" * 800))


def many_groups(file, _):
    for index in range(100):
        file.create_group(f"record/g{index}")


def many_members(file, _):
    for index in range(600):
        file.create_group(f"g{index}")


def high_rank(file, _):
    file.create_dataset("record/other", (1,) * 20, "f8")


def compound(file, _):
    file.create_dataset("record/other", (3,), [("a", "f8"), ("b", "i4")])


def references(file, _):
    file.create_dataset("record/other", (3,), h5py.ref_dtype)


def lists(file, _):
    file.create_dataset("record/other", (3,), h5py.vlen_dtype(np.float64))


def opaque(file, _):
    file["record"].create_dataset("other", data=np.void(b"abc"))


def enumerated(file, _):
    file["record/other"] = np.array([True, False])


def complex_values(file, _):
    file["record/other"] = np.array([1j])


def half_precision(file, _):
    file["record/other"] = np.array([1.0], dtype="f2")


def odd_integer(file, _):
    kind = h5t.STD_I32LE.copy()
    kind.set_precision(24)
    kind.set_size(3)
    h5d.create(file["record"].id, b"other", kind, h5s.create_simple((3,)))


def named_type(file, _):
    file["record/kind"] = np.dtype("f8")


def nothing_at_all(file, _):
    file["record/other"] = h5py.Empty("f8")


def unknown_filter(file, _):
    file.create_dataset("record/other", (300,), "i4", chunks=(100,), scaleoffset=0)


def compound_attribute(file, _):
    file["record"].attrs["other"] = np.zeros(2, dtype=[("a", "f8")])


def table_attribute(file, _):
    file["record"].attrs["other"] = np.zeros((2, 2))


def text_as_scale(file, _):
    file["record/elongation"].attrs["scale_factor"] = "two"


def several_offsets(file, _):
    file["record/elongation"].attrs["add_offset"] = [1.0, 2.0]


def not_utf8(file, _):
    file["record/other"] = np.array([b"\xff\xfe"], dtype="S2")


def not_utf8_attribute(file, _):
    file["record"].attrs["other"] = np.bytes_(b"\xff\xfe")


def compressed_text(file, _):
    file.create_dataset("record/other", data=["a", "b"], dtype=h5py.string_dtype(), chunks=(2,), compression=1)


def compact_text(file, _):
    made = h5p.create(h5p.DATASET_CREATE)
    made.set_layout(h5d.COMPACT)
    kind = h5t.py_create(h5py.string_dtype(), logical=True)
    h5d.create(file["record"].id, b"other", kind, h5s.create_simple((2,)), made)


def control_characters(file, _):
    file["record/a\nb\x1b[31m"] = 1.0


MAKERS = {
    external_values: "outside the file",
    external_link: "soft or external link",
    link_to_fifo: "soft or external link",
    soft_link: "soft or external link",
    virtual: "outside the file",
    second_name: "linked from two places",
    circle: "linked from two places",
    many_values: "bytes of values",
    many_unwritten: "never written",
    many_texts: "texts",
    many_values_in_all: "bytes of values",
    wide_chunk: "bytes in a chunk",
    many_chunks: "chunks",
    long_attribute: "elements",
    long_text_attribute: "bytes",
    much_text: "bytes outside its arrays",
    many_attributes: "attributes",
    deep_groups: "levels of groups",
    many_groups: "groups",
    many_members: "members",
    high_rank: "dimensions",
    compound: "neither a plain number nor text",
    references: "neither a plain number nor text",
    lists: "neither a plain number nor text",
    opaque: "neither a plain number nor text",
    enumerated: "neither a plain number nor text",
    complex_values: "neither a plain number nor text",
    half_precision: "neither a plain number nor text",
    odd_integer: "neither a plain number nor text",
    named_type: "user-defined type",
    nothing_at_all: "no values at all",
    unknown_filter: "unknown filter",
    compound_attribute: "neither a plain number nor text",
    table_attribute: "dimensions",
    text_as_scale: "scale_factor: is 'two', not a number",
    several_offsets: "add_offset",
    compressed_text: "compressed or compact; store it plainly",
    compact_text: "compressed or compact; store it plainly",
    not_utf8: "UTF-8",
    not_utf8_attribute: "UTF-8",
    control_characters: "do not print",
}


@pytest.mark.parametrize("make", MAKERS, ids=lambda make: make.__name__)
def test_hostile_content_is_refused(tmp_path, record, make):
    path = tmp_path / "file.nc"
    write(record, path)
    # the later format stores attributes of any length; its files are read all the same
    with h5py.File(path, "r+", libver="latest") as file:
        del file.attrs["content_sha256"]
        make(file, tmp_path)
    with pytest.raises(FileError, match=MAKERS[make]) as refusal:
        read(path)
    told = str(refusal.value)
    assert told.startswith(f"{path}: ")
    assert told.isprintable()
    assert ";" in told  # the remedy
    assert validate(path) == [told]


def _fifo(path: Path) -> None:
    os.mkfifo(path)


def _socket(path: Path) -> None:
    here = os.getcwd()
    os.chdir(path.parent)  # a socket's path may have only some hundred bytes
    try:
        with socket.socket(socket.AF_UNIX) as one:
            one.bind(path.name)
    finally:
        os.chdir(here)


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (_fifo, "not an ordinary file"),
        (_socket, "not an ordinary file"),
        (Path.mkdir, "a folder"),
        (Path.touch, "is empty"),
        (lambda path: path.write_text("time,angle\n0,1\n"), "is not netCDF-4"),
        (lambda path: path.write_bytes(b"\x89HDF"), "is not netCDF-4"),
        (lambda path: path.write_bytes(b"\x89HDF\r\n\x1a\n"), "cannot be read"),
        (lambda path: path.symlink_to("/dev/zero"), "not an ordinary file"),
        (lambda path: path.symlink_to(path.name), "give the path of an existing file"),
        (lambda _: None, "No such file"),
    ],
)
def test_what_is_no_file_is_refused_before_it_is_opened(tmp_path, make, told):
    path = tmp_path / "file.nc"
    make(path)
    with pytest.raises(FileError, match=told):
        read(path)
    assert len(validate(path)) == 1


def test_a_path_that_no_system_has():
    with pytest.raises(FileError, match="null byte"):
        read("a\0b")


def test_a_dimension_that_points_astray_is_not_followed(tmp_path, record):
    """References to what is no scale of the file are passed over; names then come from the table."""
    path = tmp_path / "file.nc"
    write(record, path)
    with h5py.File(path, "r+") as file:
        del file.attrs["content_sha256"]
        listed = np.empty(2, dtype=object)
        listed[0] = np.array([file["instrument"].ref], dtype=h5py.ref_dtype)
        listed[1] = np.array([], dtype=h5py.ref_dtype)
        del file["record/elongation"].attrs["DIMENSION_LIST"]
        file["record/elongation"].attrs.create("DIMENSION_LIST", listed, dtype=h5py.vlen_dtype(h5py.ref_dtype))
        del file["record/combination"].attrs["DIMENSION_LIST"]
        file["record/combination"].attrs["DIMENSION_LIST"] = 5
    assert read(path).identical(record)


def test_an_old_format_is_read(tmp_path, record):
    """Superblock 0, as the library writes when it is asked for nothing else."""
    path = tmp_path / "file.nc"
    access = h5p.create(h5p.FILE_ACCESS)
    access.set_libver_bounds(h5f.LIBVER_EARLIEST, h5f.LIBVER_V110)
    identifier = h5f.create(os.fsencode(path), fapl=access)
    with h5py.File(identifier) as file:
        file["time"] = np.arange(3.0)
    assert path.read_bytes()[8] == 0
    assert read(path)["time"].values.tolist() == [0.0, 1.0, 2.0]


def test_a_name_that_is_there_twice_is_refused(tmp_path):
    path = tmp_path / "file.nc"
    with h5py.File(path, "w") as file:
        file["a"], file["_nc4_non_coord_a"] = [1.0], [2.0]
    with pytest.raises(FileError, match="a: is there twice; keep one"):
        read(path)


def test_much_in_little_is_refused(tmp_path):
    """3.5 MB that unpack to gigabytes."""
    path = tmp_path / "file.nc"
    with h5py.File(path, "w") as file:
        values = file.create_dataset("values", (1 << 26,), dtype="f8", compression="gzip", chunks=(1 << 22,))
        for start in range(0, 1 << 26, 1 << 22):
            values[start : start + (1 << 22)] = 0.0
    with pytest.raises(FileError, match="declares 512 MiB of values in"):
        read(path)


def test_a_file_larger_than_any_is_refused_unread(tmp_path):
    path = tmp_path / "file.nc"
    with path.open("wb") as file:
        file.write(b"\x89HDF\r\n\x1a\n")
        file.truncate(1 << 40)
    with pytest.raises(FileError, match="has 1099511627776 bytes, more than 5368709120; give a netCDF-4 file"):
        read(path)
