"""Part records put together are the record that was cut; what does not belong together is named."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from made_records import changed, simulate

from data_schemas import check
from data_schemas.errors import RecordError, UsageError
from pipeline.joining import join_records


@pytest.fixture(scope="module")
def record() -> xr.DataTree:
    made = simulate(noise=1e-5, duration=120.0)[0]
    uncertain = changed(made, "record", "time_uncertainty", np.linspace(0.0, 0.1, made.sizes["time"]), ("time",))
    return changed(uncertain, "instrument", "period_uncertainty", np.full(2, 1e-6), ("pendulum",))


def cut(record: xr.DataTree, begin: int, end: int) -> xr.DataTree:
    return record.isel(time=slice(begin, end))


def since(record: xr.DataTree, date: str, shift: float) -> xr.DataTree:
    """The same instants, counted from another date that is so many seconds earlier."""
    tree = record.copy(deep=True)
    time = tree.dataset["time"]
    tree.dataset = tree.to_dataset(inherit=False).assign_coords(
        time=("time", time.values + shift, {**time.attrs, "units": f"seconds since {date}"})
    )
    return tree


def same(one: xr.DataTree, other: xr.DataTree) -> None:
    for group in ("record", "instrument"):
        xr.testing.assert_identical(one[group].to_dataset(), other[group].to_dataset())


def test_parts_in_any_order_are_the_whole(record: xr.DataTree) -> None:
    joined = join_records([cut(record, 700, 1200), cut(record, 0, 300), cut(record, 300, 700)], ["c", "a", "b"])
    assert check(joined, "record") == []
    same(joined, record)
    assert joined.attrs["history"] == "joined by isochrony from a, b, c"


def test_each_part_may_count_from_its_own_date(record: xr.DataTree) -> None:
    early = since(cut(record, 0, 600), "2000-01-01T00:00:00Z", 0.0)
    late = since(cut(record, 600, 1200), "1999-12-31T23:59:00Z", 60.0)
    joined = join_records([late, early], ["b", "a"])
    np.testing.assert_allclose(joined["time"].values, record["time"].values, atol=1e-9)


def test_what_a_part_lacks_is_missing_there(record: xr.DataTree) -> None:
    heave = np.arange(record.sizes["time"], dtype=np.float64)
    full = changed(record, "record", "vertical_acceleration", heave, ("time",))
    joined = join_records([cut(full, 0, 600), cut(record, 600, 1200)], ["a", "b"])
    stored = joined["record"]["vertical_acceleration"].values
    np.testing.assert_array_equal(stored[:600], heave[:600])
    assert np.isnan(stored[600:]).all()


def test_flags_of_all_films_and_the_largest_uncertainty(record: xr.DataTree) -> None:
    one, two = (
        cut(record, 0, 600),
        changed(cut(record, 600, 1200), "instrument", "period_uncertainty", np.array([2e-6, 5e-7]), ("pendulum",)),
    )
    for tree, flags in ((one, "marks-false"), (two, "marks-false, film-cut")):
        tree["film"] = xr.DataTree(xr.Dataset({"source_file": ((), flags, {})}, attrs={"flags": flags}))
    joined = join_records([one, two], ["a", "b"])
    assert joined["film"].attrs["flags"] == "marks-false, film-cut"
    assert str(joined["film"]["source_file"].values) == "marks-false, marks-false, film-cut"
    np.testing.assert_array_equal(joined["instrument"]["period_uncertainty"].values, [2e-6, 1e-6])


def test_what_does_not_belong_together_is_named(record: xr.DataTree) -> None:
    one, two = cut(record, 0, 601), cut(record, 600, 1200)
    with pytest.raises(RecordError, match=r"^b: begins 0\.000 s before a ends; say when each began"):
        join_records([two, one], ["b", "a"])
    other = changed(cut(record, 700, 1200), "instrument", "reference_gravity", np.array(9.8))
    with pytest.raises(RecordError, match=r"^b: instrument/reference_gravity is not that of a; state the same in both"):
        join_records([one, other], ["a", "b"])
    law = cut(record, 700, 1200)
    law["instrument"].attrs["restoring"] = "sine"
    with pytest.raises(RecordError, match="the attributes of /instrument differ"):
        join_records([one, law], ["a", "b"])
    bare = cut(record, 700, 1200)
    del bare["instrument"]
    with pytest.raises(RecordError, match="some have no /instrument"):
        join_records([one, bare], ["a", "b"])
    with pytest.raises(UsageError, match="two part records or more"):
        join_records([one], ["a"])
