"""Records of other programs: without checksum, chunks, long names, or dimension scales; packed; in other types."""

from __future__ import annotations

import h5netcdf
import h5py
import netCDF4
import numpy as np
import pytest
import xarray as xr

from data_schemas import read, validate
from data_schemas.errors import FileError

TIMES = np.arange(6) * 0.5
ELONGATION = np.array([[0.01, 0.02, 0.01, -0.01, -0.02, np.nan], [0.03, 0.01, -0.02, 0.01, 0.02, 0.01]])


def with_h5netcdf(path):
    """Contiguous arrays, units only where there is a unit."""
    with h5netcdf.File(path, "w") as file:
        file.attrs.update(schema="isochrony-record", schema_version="1", record_id="foreign")
        file.dimensions["time"] = 6
        time = file.create_variable("time", ("time",), data=TIMES)
        time.attrs["units"] = "seconds since 2000-01-01T00:00:00Z"
        record = file.create_group("record")
        record.dimensions.update(trace=2, pendulum=2)
        text = h5py.string_dtype()
        record.create_variable("trace", ("trace",), text)[...] = np.array(["1", "1-2"], dtype=object)
        record.create_variable("pendulum", ("pendulum",), text)[...] = np.array(["1", "2"], dtype=object)
        record.create_variable("combination", ("trace", "pendulum"), data=np.array([[1.0, 0.0], [1.0, -1.0]]))
        record.create_variable("elongation", ("trace", "time"), data=ELONGATION).attrs["units"] = "rad"
        instrument = file.create_group("instrument")
        instrument.dimensions["pendulum"] = 2
        instrument.create_variable("pendulum", ("pendulum",), text)[...] = np.array(["1", "2"], dtype=object)
        instrument.create_variable("period", ("pendulum",), data=np.array([1.01, 1.02])).attrs["units"] = "s"
        instrument.create_variable("reference_gravity", (), data=9.81).attrs["units"] = "m s-2"


def with_netcdf4(path):
    """The C library: an unlimited time, fill values, dimensions without coordinates in the film's group."""
    with netCDF4.Dataset(path, "w") as file:
        file.setncatts({"schema": "isochrony-record", "schema_version": "1", "record_id": "foreign"})
        file.createDimension("time", None)
        time = file.createVariable("time", "f8", ("time",))
        time[:] = TIMES
        time.units = "seconds since 2000-01-01T00:00:00Z"
        record = file.createGroup("record")
        for name, labels in (("trace", ["1", "1-2"]), ("pendulum", ["1", "2"])):
            record.createDimension(name, 2)
            record.createVariable(name, str, (name,))[:] = np.array(labels, dtype=object)
        record.createVariable("combination", "f8", ("trace", "pendulum"))[:] = [[1.0, 0.0], [1.0, -1.0]]
        elongation = record.createVariable("elongation", "f8", ("trace", "time"), fill_value=-99.0, zlib=True)
        elongation.units = "rad"
        elongation[:] = np.where(np.isnan(ELONGATION), -99.0, ELONGATION)
        instrument = file.createGroup("instrument")
        instrument.createDimension("pendulum", 2)
        instrument.createVariable("pendulum", str, ("pendulum",))[:] = np.array(["1", "2"], dtype=object)
        period = instrument.createVariable("period", "f8", ("pendulum",))
        period[:] = [1.01, 1.02]
        period.units = "s"
        gravity = instrument.createVariable("reference_gravity", "f8")
        gravity[...] = 9.81
        gravity.units = "m/s2"


def with_xarray(path):
    """xarray's own writer, defaults everywhere."""
    root = xr.Dataset(
        coords={"time": ("time", TIMES, {"units": "seconds since 2000-01-01T00:00:00Z"})},
        attrs={"schema": "isochrony-record", "schema_version": "1", "record_id": "foreign"},
    )
    labels = {"trace": ["1", "1-2"], "pendulum": ["1", "2"]}
    record = xr.Dataset(
        {
            "combination": (("trace", "pendulum"), [[1.0, 0.0], [1.0, -1.0]]),
            "elongation": (("trace", "time"), ELONGATION, {"units": "radians"}),
        },
        coords=labels,
    )
    instrument = xr.Dataset(
        {
            "period": ("pendulum", [1.01, 1.02], {"units": "s"}),
            "reference_gravity": ((), 9.81, {"units": "m s-2"}),
        },
        coords={"pendulum": labels["pendulum"]},
    )
    tree = xr.DataTree.from_dict({"/": root, "/record": record, "/instrument": instrument})
    tree.to_netcdf(path, engine="h5netcdf")


def with_h5py(path):
    """Plain HDF5: no scales, big-endian, text of fixed length; the table gives the dimensions by position."""
    with h5py.File(path, "w") as file:
        file.attrs.update(schema="isochrony-record", schema_version="1", record_id="foreign")
        file["time"] = TIMES.astype(">f8")
        file["time"].attrs["units"] = "seconds since 2000-01-01"
        file["record/trace"] = np.array([b"1", b"1-2"])
        file["record/pendulum"] = np.array([b"1", b"2"])
        file["record/combination"] = np.array([[1.0, 0.0], [1.0, -1.0]])
        file["record/elongation"] = ELONGATION.astype(">f8")
        file["record/elongation"].attrs["units"] = np.bytes_("rad")
        file["instrument/pendulum"] = np.array([b"1", b"2"])
        file["instrument/period"] = np.array([1.01, 1.02])
        file["instrument/period"].attrs["units"] = "s"
        file["instrument/reference_gravity"] = 9.81
        file["instrument/reference_gravity"].attrs["units"] = "m s-2"


@pytest.mark.parametrize("make", [with_h5netcdf, with_netcdf4, with_xarray, with_h5py])
def test_a_foreign_record_is_read_and_good(tmp_path, make):
    path = tmp_path / "foreign.nc"
    make(path)
    assert validate(path) == []
    tree = read(path)
    assert tree["time"].values.tolist() == TIMES.tolist()
    assert tree["record/elongation"].dims == ("trace", "time")
    np.testing.assert_array_equal(tree["record/elongation"].values, ELONGATION)
    assert tree["record/elongation"].dtype == np.dtype("f8")
    assert tree["record/elongation"].dtype.isnative
    assert tree["record"].sel(trace="1-2")["combination"].values.tolist() == [1.0, -1.0]
    assert tree["instrument/reference_gravity"].item() == 9.81


def test_a_dimension_without_coordinate_keeps_its_name(tmp_path):
    for module, path in ((netCDF4.Dataset, tmp_path / "c.nc"), (h5netcdf.File, tmp_path / "h.nc")):
        with module(path, "w") as file:
            if module is netCDF4.Dataset:
                file.createDimension("mark", 3)
                file.createVariable("mark_time", "f8", ("mark",))[:] = [1.0, 2.0, 3.0]
            else:
                file.dimensions["mark"] = 3
                file.create_variable("mark_time", ("mark",), data=np.array([1.0, 2.0, 3.0]))
        tree = read(path)
        assert list(tree.variables) == ["mark_time"]
        assert tree["mark_time"].dims == ("mark",)


def test_a_variable_named_as_a_dimension_of_others(tmp_path):
    """netCDF-4 stores such a variable under a mangled name."""
    with netCDF4.Dataset(tmp_path / "c.nc", "w") as file:
        file.createDimension("a", 2)
        file.createDimension("b", 3)
        file.createVariable("a", "f8", ("b",))[:] = [1.0, 2.0, 3.0]
    tree = read(tmp_path / "c.nc")
    assert tree["a"].dims == ("b",)
    assert tree["a"].values.tolist() == [1.0, 2.0, 3.0]


def test_dimensions_that_disagree_are_told(tmp_path):
    """Without scales the table gives the names; two lengths of one name make no tree, but all faults are listed."""
    path = tmp_path / "foreign.nc"
    with_h5py(path)
    with h5py.File(path, "r+") as file:
        del file["record/elongation"], file["record/combination"]
        file["record/elongation"] = np.zeros((2, 5))
        file["record/elongation"].attrs["units"] = "rad"
        file["record/combination"] = np.zeros((3, 2))
    with pytest.raises(FileError, match=r"foreign.nc: record: .*; make dimensions of one name equal"):
        read(path)
    faults = "\n".join(validate(path))
    assert "record/elongation: has 5 values along time where others have 6; make" in faults
    assert "along trace where others have" in faults


def test_a_group_may_not_disagree_with_the_root(tmp_path):
    path = tmp_path / "foreign.nc"
    with netCDF4.Dataset(path, "w") as file:
        for group in (file, file.createGroup("record")):
            group.createDimension("time", 6 if group is file else 5)
            group.createVariable("time" if group is file else "values", "f8", ("time",))[:] = 1.0
    with pytest.raises(FileError, match=r"foreign.nc: .*; make dimensions equal in length to the root's"):
        read(path)


def test_unknown_arrays_of_plain_hdf5_get_phony_dimensions(tmp_path):
    with h5py.File(tmp_path / "p.nc", "w") as file:
        file["one"], file["two"] = np.zeros((2, 3)), np.zeros(3)
    tree = read(tmp_path / "p.nc")
    assert tree["one"].dims == ("phony_dim_0", "phony_dim_1")
    assert tree["two"].dims == ("phony_dim_1",)


def test_packed_values_are_unpacked(tmp_path):
    path = tmp_path / "packed.nc"
    with_h5netcdf(path)
    with h5py.File(path, "r+") as file:
        file["record"].create_dataset("vertical_acceleration", data=np.array([0, 1, 2, -1, -99, 7], dtype="i2"))
        packed = file["record/vertical_acceleration"]
        packed.attrs.update(units="m s-2", scale_factor=0.5, add_offset=1.0, _FillValue=np.int16(-99))
        flags = file["record"].create_dataset("elongation_qc", data=np.zeros((2, 6), dtype="u2"))
        flags.attrs["_FillValue"] = np.uint16(0)
    assert validate(path) == []
    tree = read(path)
    np.testing.assert_array_equal(tree["record/vertical_acceleration"].values, [1.0, 1.5, 2.0, 0.5, np.nan, 4.5])
    assert tree["record/vertical_acceleration"].attrs == {"units": "m s-2"}
    assert tree["record/elongation_qc"].dtype == np.uint16  # flags stay flags whatever their fill value


def test_an_empty_attribute_is_read(tmp_path):
    path = tmp_path / "empty.nc"
    with_h5netcdf(path)
    with h5py.File(path, "r+") as file:
        file.attrs["comment"] = h5py.Empty("S1")
        file.attrs["numbers"] = h5py.Empty("f8")
        file.attrs["kind"] = np.array([1, 2], dtype=">i4")
    assert validate(path) == []
    attrs = read(path).attrs
    assert attrs["comment"] == ""
    assert attrs["numbers"].size == 0
    assert attrs["kind"].tolist() == [1, 2]


def test_text_with_a_scale_factor_is_text(tmp_path):
    with_h5netcdf(tmp_path / "file.nc")
    with h5py.File(tmp_path / "file.nc", "r+") as file:
        file["record/trace"].attrs["scale_factor"] = 2.0
    assert read(tmp_path / "file.nc")["record/trace"].values.tolist() == ["1", "1-2"]


def _list_of_another_shape(file, one):
    one.attrs.create("DIMENSION_LIST", np.zeros(3), shape=(3,))


def _two(first, second):
    both = np.empty(2, dtype=object)
    both[0], both[1] = first, second
    return both


def _list_of_numbers(file, one):
    listed = _two(np.array([1], "i4"), np.array([2], "i4"))
    one.attrs.create("DIMENSION_LIST", listed, dtype=h5py.vlen_dtype(np.dtype("i4")))


def _list_with_an_empty_place(file, one):
    listed = _two(np.array([file["record/trace"].ref], dtype=h5py.ref_dtype), np.array([], dtype=h5py.ref_dtype))
    one.attrs.create("DIMENSION_LIST", listed, dtype=h5py.vlen_dtype(h5py.ref_dtype))


@pytest.mark.parametrize("spoil", [_list_of_another_shape, _list_of_numbers, _list_with_an_empty_place])
def test_dimensions_that_are_not_told_rightly_are_known_by_position(tmp_path, spoil):
    with_h5netcdf(tmp_path / "file.nc")
    with h5py.File(tmp_path / "file.nc", "r+") as file:
        one = file["record/combination"]
        del one.attrs["DIMENSION_LIST"]
        spoil(file, one)
    assert read(tmp_path / "file.nc")["record/combination"].dims == ("trace", "pendulum")


def test_a_dimension_of_a_variable_of_another_rank_has_a_name_of_its_own(tmp_path):
    with_h5netcdf(tmp_path / "file.nc")
    with h5py.File(tmp_path / "file.nc", "r+") as file:
        del file["record/combination"]
        file["record/combination"] = np.ones(5)
    assert any("phony_dim" in fault or "combination" in fault for fault in validate(tmp_path / "file.nc"))
