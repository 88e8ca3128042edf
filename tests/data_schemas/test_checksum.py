"""The checksum: the same for the same content, another for any other."""

from __future__ import annotations

import hashlib
import struct

import h5py
import netCDF4
import numpy as np
import pytest
import xarray as xr

from data_schemas import content_sha256, read, write
from data_schemas.contents import from_tree
from data_schemas.errors import FileError


def tiny() -> xr.DataTree:
    root = xr.Dataset({"time": ("time", [0.0, 0.5])}, attrs={"schema": "x", "many": ["a", "b"]})
    child = xr.Dataset({"label": ("label", ["µ"]), "n": ((), np.uint16(7), {"scale": 2.5})})
    return xr.DataTree.from_dict({"/": root, "/child": child})


def test_the_definition_by_hand():
    """The items of the module's definition, written out: no code of ours between the text and the digest."""
    items: list[bytes | str] = ["isochrony content 1", "group", ""]
    items += ["attribute", "many", "str", "2", "a", "b", "attribute", "schema", "str", "1", "x"]
    items += ["variable", "time", "1", "time", "2", "f8", struct.pack("<2d", 0.0, 0.5)]
    items += ["group", "child"]
    items += ["variable", "label", "1", "label", "1", "str", "µ"]
    items += ["variable", "n", "0", "u2", struct.pack("<H", 7)]
    items += ["attribute", "scale", "f8", "1", struct.pack("<d", 2.5)]
    total = hashlib.sha256()
    for item in items:
        data = item.encode() if isinstance(item, str) else item
        total.update(struct.pack("<Q", len(data)) + data)
    assert content_sha256(tiny()) == total.hexdigest()


def test_the_digest_never_changes():
    """A change here makes every file ever written unreadable."""
    assert content_sha256(tiny()) == "eee7ec503c5163a9438cd54b9e5ac8ad4ff946e5baf4e7e118101b39b270ff62"


def _child(tree, change):
    tree["child"].dataset = change(tree["child"].to_dataset(inherit=False))


CHANGES = {
    "value": lambda t: t["child"]["n"].values.__setitem__((), 8),
    "type": lambda t: _child(t, lambda child: child.assign(n=child["n"].astype(np.int16))),
    "name": lambda t: _child(t, lambda child: child.rename(n="m")),
    "variable": lambda t: _child(t, lambda child: child.assign(more=("along", [1.0]))),
    "dimension": lambda t: _child(t, lambda child: child.rename_dims(label="others").reset_index("label")),
    "attribute value": lambda t: t["child"]["n"].attrs.update(scale=2.25),
    "attribute type": lambda t: t["child"]["n"].attrs.update(scale=np.float32(2.5)),
    "attribute name": lambda t: t["child"]["n"].attrs.update(other=t["child"]["n"].attrs.pop("scale")),
    "list split": lambda t: t.attrs.update(many=["ab", ""]),
    "group": lambda t: t.__setitem__("other", xr.DataTree()),
    "sign of zero": lambda t: setattr(t, "dataset", t.to_dataset().assign_coords(time=[-0.0, 0.5])),
    "label": lambda t: _child(t, lambda child: child.assign_coords(label=["u"])),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES.keys())
def test_any_change_changes_it(change):
    tree = tiny()
    change(tree)
    assert content_sha256(tree) != content_sha256(tiny())


def test_order_and_storage_do_not_change_it():
    tree, wanted = tiny(), content_sha256(tiny())
    tree.attrs = dict(reversed(tree.attrs.items()))
    _child(tree, lambda child: xr.Dataset({name: child[name] for name in ("n", "label")}))
    assert content_sha256(tree) == wanted
    big = tiny()
    big.dataset = xr.Dataset({"time": ("time", np.array([0.0, 0.5], dtype=">f8"))}, attrs=big.attrs)
    assert content_sha256(big) == wanted
    assert from_tree(big)[""].variables["time"].values.dtype.isnative


def test_a_rewritten_file_keeps_it(tmp_path, record):
    """Another program may pack the same content otherwise (compressed, other chunks): the checksum still holds."""
    path = tmp_path / "file.nc"
    write(record, path)
    with h5py.File(path, "r+") as file:
        values = file["record/elongation"][()]
        attrs, scales = dict(file["record/elongation"].attrs), [file["record/trace"], file["time"]]
        del file["record/elongation"]
        again = file.create_dataset("record/elongation", data=values.astype(">f8"), chunks=(2, 7), compression=1)
        for dimension, scale in enumerate(scales):
            again.dims[dimension].attach_scale(scale)
        again.attrs["units"], again.attrs["long_name"] = attrs["units"], attrs["long_name"]
    assert read(path).identical(record)


def test_an_edited_file_is_refused(tmp_path, record):
    path = tmp_path / "file.nc"
    write(record, path)
    with netCDF4.Dataset(path, "a") as file:
        file["instrument"]["reference_gravity"][...] = 9.8
    with pytest.raises(FileError, match="content_sha256 does not match"):
        read(path)
    with netCDF4.Dataset(path, "a") as file:
        file.delncattr("content_sha256")
    assert read(path)["instrument/reference_gravity"] == 9.8


def test_an_attribute_of_that_name_deeper_down_counts(tmp_path, record):
    record["record"].attrs["content_sha256"] = "mine"
    write(record, tmp_path / "file.nc")
    assert read(tmp_path / "file.nc")["record"].attrs["content_sha256"] == "mine"
