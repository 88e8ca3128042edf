"""How a content is laid out on disk: chunks, dimensions, names."""

from __future__ import annotations

import io
import math

import h5py
import netCDF4
import numpy as np
import pytest

from data_schemas.contents import Contents, Entry, Group
from data_schemas.errors import FileError
from data_schemas.guard import Budget, survey
from data_schemas.writing import CHUNK, _modest, beside, chunk_shape, encoded


@pytest.mark.parametrize(
    "shape",
    [(1,), (CHUNK,), (CHUNK + 1,), (2, CHUNK // 2), (3, CHUNK // 2), (7, 5, 10**4), (2, 2 * CHUNK), (0, 4), (4, 0)],
)
def test_a_chunk_is_as_large_as_it_may_be(shape: tuple[int, ...]) -> None:
    """Whole in the last dimension first: one more anywhere would be too much, or more than there is."""
    chunk = chunk_shape(shape)
    assert all(1 <= part <= max(length, 1) for part, length in zip(chunk, shape, strict=True))
    assert math.prod(chunk) <= CHUNK
    later = 1
    for part, length in zip(reversed(chunk), reversed(shape), strict=True):
        assert part >= length or later * (part + 1) > CHUNK
        later *= part


def opened(contents: Contents) -> h5py.File:
    return h5py.File(io.BytesIO(encoded(contents)))


def one(name: str, *dims: str, length: int = 2) -> Contents:
    return {"": Group({}, {name: Entry(dims, np.zeros((length,) * len(dims)))})}


@pytest.mark.parametrize("name", ["", ".", "..", "a/b", "_nc4_a", "a\nb", "\x7f", "µ" * 127 + "ab"])
def test_names_that_no_file_can_have(name: str) -> None:
    for contents in (one(name, "x"), one("a", name), {"": Group({}, {"a": Entry((), np.zeros(()), {name: 1.0})})}):
        with pytest.raises(FileError, match="is no name for netCDF; rename it"):
            encoded(contents)
    assert "µ" * 127 + "a" in opened(one("µ" * 127 + "a", "x"))


def test_a_dimension_is_shared_where_its_length_is() -> None:
    """Each has a number of its own; of another length it is another one, also under the same name."""
    values = np.arange(3.0)
    file = opened(
        {
            "": Group({}, {"x": Entry(("x",), values), "a": Entry(("x", "y"), np.ones((3, 2)))}),
            "g": Group(
                {}, {"b": Entry(("x",), values), "c": Entry(("y",), np.ones(4)), "n": Entry(("z",), values[:0])}
            ),
            "g/h": Group({}, {"d": Entry(("y",), np.ones(4)), "y": Entry(("x",), values)}),
        }
    )
    scales = {}
    file.visititems(lambda name, item: scales.update({name: item.attrs.get("_Netcdf4Dimid")}))
    numbers = {name: number for name, number in scales.items() if number is not None}
    assert set(numbers) == {"x", "y", "g/y", "g/z"}
    assert sorted(numbers.values()) == [0, 1, 2, 3]
    for array, scale in {"a": "y", "g/b": "x", "g/c": "g/y", "g/h/d": "g/y", "g/h/_nc4_non_coord_y": "x"}.items():
        assert file[array].dims[file[array].ndim - 1][0] == file[scale], array
    assert file["y"].attrs["NAME"] == b"This is a netCDF dimension but not a netCDF variable.         2"
    assert file["g/z"].maxshape == (None,)
    assert file["g/y"].maxshape == (4,)
    assert (file["g/n"].chunks, file["g/n"].maxshape) == ((1,), (None,))
    assert file["a"].chunks == (3, 2)
    assert file["x"].attrs["CLASS"] == b"DIMENSION_SCALE"


def test_netcdf_sees_the_same_dimensions() -> None:
    contents: Contents = {
        "": Group({"b": 1, "a": 2}, {"y": Entry(("x",), np.ones(2)), "x": Entry(("x", "t"), np.ones((2, 0)))}),
        "g": Group({}, {"x": Entry(("y",), np.ones(5))}),
    }
    with netCDF4.Dataset("memory", memory=bytes(encoded(contents))) as file:
        assert {name: len(dim) for name, dim in file.dimensions.items()} == {"x": 2, "t": 0}
        assert file.dimensions["t"].isunlimited()
        assert not file.dimensions["x"].isunlimited()
        assert file["x"].dimensions == ("x", "t")
        assert len(file["g"].dimensions["y"]) == 5
        assert list(file.ncattrs()) == ["b", "a"]


def test_nothing_is_compressed_and_scalars_are_plain() -> None:
    file = opened({"": Group({}, {"n": Entry((), np.array(3.0)), "s": Entry(("x",), np.array(["a", "µ"]))})})
    assert file["n"].chunks is None
    assert file["n"][()] == 3.0
    assert file["s"].asstr()[()].tolist() == ["a", "µ"]
    assert file["s"].chunks is None


def test_temporary_names_are_hidden_and_never_the_same(tmp_path) -> None:
    names = [beside(tmp_path / "file.nc", "batch-").name for _ in range(3)]
    assert len(set(names)) == 3
    for name in names:
        assert name.startswith(".isochrony-batch-")
        assert name.endswith(".part")
        assert len(name) == len(".isochrony-batch-.part") + 16


def test_reserved_attributes_are_named() -> None:
    for name in ("_FillValue", "CLASS"):
        with pytest.raises(FileError, match=f"a, attribute {name}: is reserved by netCDF; remove it"):
            encoded({"": Group({}, {"a": Entry((), np.zeros(()), {name: 1.0})})})


def test_a_content_of_modest_size_always_passes_the_guard() -> None:
    """Each bound on its own: just below it the file is read back unsurveyed, so the guard must take it."""
    numbers = {f"a{index}": Entry(("x",), np.ones(2)) for index in range(199)}
    cases: list[Contents] = [
        {"": Group({}, numbers)},
        {"": Group({f"a{index}": "b" for index in range(127)}, {})},
        {"": Group({"a": np.ones(255), "b": "c" * (1 << 21)}, {})},
        {"": Group({}, {"a": Entry(tuple("uvwx"), np.ones((2, 1, 1, 2)))})},
        {"": Group({}, {"a": Entry(("x",), np.array(["ä" * 9] * 4095))})},
        {"a/b/c/d"[:length]: Group() for length in (0, 1, 3, 5, 7)},
        {"": Group(), **{f"g{index}": Group({}, {"a": Entry(("x",), np.ones(2))}) for index in range(30)}},
    ]
    for contents in cases:
        assert _modest(contents)
        image = encoded(contents)
        survey(opened(contents), image.nbytes, Budget())
    assert not _modest({"": Group({f"a{index}": 1 for index in range(128)}, {})})
