"""What is written is what is read, by us and by every other reader."""

from __future__ import annotations

import h5py
import netCDF4
import numpy as np
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from data_schemas import content_sha256, read, write
from data_schemas.contents import NUMBERS
from data_schemas.errors import FileError
from data_schemas.layouts import LAYOUTS

TEXT = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=12)
GROUPS = ("a", "b")  # a group and a variable cannot share a name
NAME = st.from_regex(r"[A-Za-zµθ][A-Za-z0-9 _.-]{0,7}", fullmatch=True).filter(
    lambda name: name == name.strip() and name not in GROUPS
)
ATTRIBUTE = st.one_of(
    TEXT,
    st.integers(-(2**63), 2**63 - 1),
    st.floats(),
    st.lists(TEXT, min_size=2, max_size=3),
    hnp.arrays(st.sampled_from(sorted(NUMBERS)), st.integers(2, 4)),
)
SIZES = {"x": 3, "y": 2, "nothing": 0}


@st.composite
def datasets(draw: st.DrawFn) -> xr.Dataset:
    variables = {}
    for name in draw(st.lists(NAME.filter(lambda one: one not in SIZES), max_size=3, unique=True)):
        dims = tuple(draw(st.lists(st.sampled_from(sorted(SIZES)), max_size=2, unique=True)))
        shape = tuple(SIZES[dim] for dim in dims)
        kind = draw(st.sampled_from([*sorted(NUMBERS), "text"]))
        if kind == "text":
            values = np.array(draw(st.lists(TEXT, min_size=6, max_size=6)), dtype=object)
            values = np.resize(values, shape) if np.prod(shape) else np.empty(shape, dtype="<U1")
            values = np.asarray(values, dtype=object) if np.prod(shape) else values
        else:
            values = draw(hnp.arrays(kind, shape))
        variables[name] = (dims, values, draw(st.dictionaries(NAME, ATTRIBUTE, max_size=2)))
    return xr.Dataset(variables, attrs=draw(st.dictionaries(NAME, ATTRIBUTE, max_size=2)))


@settings(max_examples=40, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(root=datasets(), child=datasets(), grandchild=datasets())
def test_any_plain_tree_survives(tmp_path, root, child, grandchild):
    tree = xr.DataTree.from_dict({"/": root, "/a": child, "/a/b": grandchild})
    path = tmp_path / "any.nc"
    write(tree, path, overwrite=True)
    back = read(path)
    assert back.identical(tree)
    assert content_sha256(back) == content_sha256(tree)
    for node in tree.subtree:
        for name, one in node.variables.items():
            if one.dtype.kind in "iuf":
                other = back[node.path].variables[name]
                assert other.dtype == one.dtype
                assert other.values.tobytes() == one.values.tobytes()  # to the last bit, NaN and -0.0 too


@pytest.mark.parametrize("kind", LAYOUTS)
def test_every_other_reader_reads_every_kind(tmp_path, example, kind):
    tree, path = example(kind), tmp_path / "file.nc"
    write(tree, path)
    for engine in ("h5netcdf", "netcdf4"):
        with xr.open_datatree(path, engine=engine, decode_times=False) as other:
            other.load()
            assert {node.path for node in other.subtree} == {node.path for node in tree.subtree}
            for node in tree.subtree:
                for name, one in node.variables.items():
                    np.testing.assert_array_equal(other[node.path].variables[name].values, one.values)
                    assert other[node.path].variables[name].dims == one.dims
        for group in tree.children:
            with xr.open_dataset(path, group=group, engine=engine, decode_times=False) as one:
                assert set(one.load().variables) == set(tree[group].to_dataset(inherit=False).variables)
    with netCDF4.Dataset(path) as plain:
        assert plain.schema == LAYOUTS[kind].schema
        for name, one in tree.variables.items():
            np.testing.assert_array_equal(plain[name][:], one.values)
        for group in tree.children:
            labels = [name for name, one in tree[group].variables.items() if one.dtype.kind == "U" and one.ndim]
            for name in labels:
                assert plain[group][name][:].tolist() == tree[group][name].values.tolist()


def test_layout_on_disk(tmp_path, example):
    path = tmp_path / "file.nc"
    write(example("record"), path)
    assert path.read_bytes()[8] == 3  # superblock version of the 1.10 format, with checksummed metadata
    with h5py.File(path) as file:
        arrays = []
        file.visititems(lambda _, one: arrays.append(one) if isinstance(one, h5py.Dataset) else None)
        numbers = [one for one in arrays if one.shape and one.dtype.kind in "iuf"]
        assert len(numbers) > 10
        for one in numbers:
            assert one.fletcher32
            assert one.compression is None
            assert "_FillValue" not in one.attrs
        text = [one for one in arrays if one.dtype.kind == "O"]
        assert len(text) >= 5
        assert all(h5py.check_string_dtype(one.dtype).encoding == "utf-8" for one in text)
        assert len(file.attrs["content_sha256"]) == 64


def test_time_stays_seconds_and_checksum_is_left_out(tmp_path, record):
    record["time"].attrs["units"] = "seconds since 1958-07-01T06:00:00Z"
    write(record, tmp_path / "file.nc")
    back = read(tmp_path / "file.nc")
    assert back["time"].dtype == np.float64
    assert "content_sha256" not in back.attrs
    assert back.identical(record)


@pytest.mark.parametrize(
    ("values", "told"),
    [
        (np.array([1 + 2j]), "store amplitude and phase"),
        (np.array([True]), "store 0 and 1 as uint8"),
        (np.array([1], dtype="m8[ns]"), "store seconds"),
        (np.array([None]), "store numbers or str"),
        (np.array(["\ud800"]), "not valid Unicode"),
        (np.array(["a\0b"]), "NUL"),
        (np.array([1.0], dtype=np.float16), "cannot be stored"),
    ],
)
def test_a_type_that_does_not_travel_is_named(tmp_path, record, values, told):
    record["record"].dataset = record["record"].to_dataset(inherit=False).assign(extra=("one", values))
    with pytest.raises(FileError, match=rf"file.nc: record/extra: .*{told}"):
        write(record, tmp_path / "file.nc")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "value", [[], {}, [[1, 2], [3, 4]], [[1], [1, 2]], None, 1j, True, 2**70, b"bytes", [1, "a", None]]
)
def test_an_attribute_that_does_not_travel_is_named(tmp_path, record, value):
    record["record"]["elongation"].attrs["strange"] = value
    with pytest.raises(FileError, match="record/elongation, attribute strange: "):
        write(record, tmp_path / "file.nc")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "name", ["_FillValue", "scale_factor", "DIMENSION_LIST", "_NCProperties", "a/b", "", "..", "a\nb"]
)
def test_a_reserved_attribute_is_refused(tmp_path, record, name):
    record["record"]["elongation"].attrs[name] = 1.0
    with pytest.raises(FileError, match="record/elongation, attribute"):
        write(record, tmp_path / "file.nc")


def test_an_attribute_of_one_element_is_that_element(tmp_path, record):
    record.attrs |= {"one": np.array([2.5]), "text": ["a"], "small": np.int16(3), "whole": np.array([7])}
    write(record, tmp_path / "file.nc")
    back = read(tmp_path / "file.nc").attrs
    assert (back["one"], back["text"], back["small"]) == (2.5, "a", 3)
    assert back["small"].dtype == np.int16
    assert [type(back[name]) for name in ("one", "text", "whole")] == [float, str, int]
