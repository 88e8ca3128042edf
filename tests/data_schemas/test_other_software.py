"""Files that xarray opens, changes and writes again are taken; damage to ours is not; older results are brought up."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
import xarray as xr

from data_schemas import adopted, check, read, validate, write
from data_schemas.errors import FileError, RecordError
from data_schemas.layouts import LAYOUTS, REWRITTEN

ENGINES = ("netcdf4", "h5netcdf")


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("kind", LAYOUTS)
def test_every_kind_survives_xarray(tmp_path, example, kind: str, engine: str) -> None:
    pytest.importorskip("netCDF4" if engine == "netcdf4" else "h5netcdf")
    first, second = tmp_path / "first.nc", tmp_path / "second.nc"
    write(example(kind), first)
    tree = xr.open_datatree(first, engine=engine)
    tree.load()
    tree.to_netcdf(second, engine=engine)
    tree.close()
    assert validate(second) == []
    again = read(second)
    assert REWRITTEN in again.attrs
    for node in example(kind).subtree:
        for name, variable in node.to_dataset(inherit=False).variables.items():
            found = again[node.path].to_dataset(inherit=False)[name]
            if variable.dtype.kind in "fiu":
                np.testing.assert_allclose(found.values, variable.values, rtol=1e-15, atol=1e-9)
            else:
                np.testing.assert_array_equal(found.values, variable.values)


def test_an_edit_is_taken_and_marked(tmp_path, record) -> None:
    first, second = tmp_path / "first.record.nc", tmp_path / "second.record.nc"
    write(record, first)
    tree = xr.open_datatree(first)
    tree.load()
    tree["record"]["elongation"][:] *= 2.0
    tree.to_netcdf(second)
    tree.close()
    doubled = read(second)
    np.testing.assert_array_equal(doubled["record"]["elongation"].values, 2.0 * record["record"]["elongation"].values)
    assert "did not fit" in doubled.attrs[REWRITTEN]


def test_damage_to_a_file_of_ours_is_refused(tmp_path, record) -> None:
    path = tmp_path / "ours.record.nc"
    write(record, path)
    with h5py.File(path, "r+") as file:
        file["record/elongation"][0, 3] += 1e-6
    with pytest.raises(FileError, match="damaged or edited"):
        read(path)


def test_a_tree_with_dates_becomes_one_with_seconds(tmp_path, record) -> None:
    path = tmp_path / "dates.record.nc"
    write(record, path)
    tree = xr.open_datatree(path)
    tree.load()
    assert tree["time"].dtype.kind == "M"
    taken = adopted(tree)
    assert check(taken, "record") == []
    np.testing.assert_allclose(taken["time"].values, record["time"].values, atol=1e-9)
    bare = tree.copy()
    bare = xr.DataTree.from_dict({"/": bare.to_dataset().assign_coords(time=("time", tree["time"].values)), **{
        f"/{name}": node.to_dataset(inherit=False) for name, node in tree.children.items()
    }})  # fmt: skip
    np.testing.assert_allclose(np.diff(adopted(bare)["time"].values), 0.5, atol=1e-9)


def test_times_in_other_units_become_seconds(tmp_path, record) -> None:
    path = tmp_path / "minutes.nc"
    least = record.copy(deep=True)
    minutes = least["time"].values / 60.0
    least.coords["time"] = ("time", minutes, {"units": "minutes since 2000-01-01", "calendar": "standard"})
    write(least, path)
    read_again = read(path)
    assert read_again["time"].attrs["units"] == "seconds since 2000-01-01"
    np.testing.assert_allclose(read_again["time"].values, record["time"].values, atol=1e-9)


def test_results_of_version_1_are_brought_up(tmp_path, example) -> None:
    path = tmp_path / "old.result.nc"
    new = example("result")
    groups = {
        f"/{name}": node.to_dataset(inherit=False).rename({"estimator": "method"})
        if name in ("gravity", "correction")
        else node.to_dataset(inherit=False)
        for name, node in new.children.items()
    }
    old = xr.DataTree.from_dict({"/": new.to_dataset(), **groups})
    old.attrs |= {**new.attrs, "schema_version": "1"}
    write(old, path)
    assert validate(path) == []
    assert "estimator" in read(path)["gravity"].dims


def test_a_dataset_of_traces_is_laid_out() -> None:
    time = np.arange(40) * 0.1
    traces = xr.Dataset(
        {"elongation": (("trace", "time"), np.ones((2, 40))), "period": ("pendulum", [1.01, 1.0101]),
         "reference_gravity": ((), 9.81)},
        coords={"time": time, "trace": ["1", "1-2"]}, attrs={"restoring": "sine", "record_id": "mine"},
    )  # fmt: skip
    record = adopted(traces)
    assert check(record, "record") == []
    assert record["record"]["combination"].values.tolist() == [[1.0, 0.0], [1.0, -1.0]]
    assert record["instrument"].attrs["restoring"] == "sine"
    assert record.attrs["record_id"] == "mine"
    with pytest.raises(RecordError, match="trace 'a-b-c' does not say it"):
        adopted(traces.assign_coords(trace=["1", "a-b-c"]))
    with pytest.raises(RecordError, match="dimensions trace and time"):
        adopted(traces.rename(trace="row"))
