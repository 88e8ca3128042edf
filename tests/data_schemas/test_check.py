"""Each thing that can be wrong with a file is found, named with its remedy, and found beside all others."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from data_schemas import check, validate, write
from data_schemas.layouts import LAYOUTS


@pytest.mark.parametrize("kind", LAYOUTS)
def test_a_complete_file_is_good(tmp_path, example, kind):
    assert check(example(kind), kind) == []
    write(example(kind), tmp_path / "file.nc")
    assert validate(tmp_path / "file.nc") == []


def test_the_least_record_is_good(record):
    assert check(record, "record") == []


@pytest.mark.parametrize(
    ("name", "told"), [("scene", []), ("film", ["attribute film: is missing at the root; add it"])]
)
def test_json_that_is_not_there_is_missing_and_no_more(example, name, told):
    tree = example("film-truth")
    del tree.attrs[name]
    assert check(tree, "film-truth") == told


def test_an_unknown_constant_is_named_with_the_nearest(record):
    stored = record["instrument"].to_dataset(inherit=False)
    record["instrument"] = xr.DataTree(stored.assign(zero_uncertanty=((), 1e-3, {"units": "rad", "long_name": "x"})))
    (fault,) = check(record, "record")
    assert fault == (
        "instrument/zero_uncertanty: is not known, the nearest is zero_uncertainty; use that name, or leave it out"
    )


def test_a_misprint_beside_the_readings_is_named_and_what_is_ones_own_is_not(record):
    stored = record["record"].to_dataset(inherit=False)
    wrong = (("time",), np.zeros(stored.sizes["time"]), {"units": "m s-2", "long_name": "x"})
    record["record"] = xr.DataTree(stored.assign(case_tlt=wrong, stopwatch=wrong))
    (fault,) = check(record, "record")
    assert fault == ("record/case_tlt: is not known, the nearest is case_tilt; use that name, or leave it out")


def _edit(group, change):
    def apply(tree):
        node = tree[group]
        node.dataset = change(node.to_dataset(inherit=False))

    return apply


def _values(name, index, value):
    group, _, short = name.rpartition("/")

    def change(data):
        values = np.array(data[short].values)
        values[index] = value
        return data.assign({short: (data[short].dims, values, data[short].attrs)})

    return _edit("/" + group, change)


def _time(values):
    def change(data):
        return data.assign_coords(time=("time", values, data["time"].attrs))

    return change


def _whole_time(values):
    """Another time for the whole record, its length too."""

    def apply(tree):
        root, short = tree.to_dataset(), len(values)
        along = {name: tree[name].to_dataset(inherit=False).isel(time=slice(short)) for name in ("record", "film")}
        for name in along:
            del tree[name]
        tree.dataset = _time(values)(root.drop_vars("time").assign_coords(time=("time", values, root["time"].attrs)))
        for name, cut in along.items():
            tree[name] = xr.DataTree(cut)

    return apply


def _attr(path, **attrs):
    return lambda tree: tree[path].attrs.update(attrs)


def _dtype(name, dtype):
    group, _, short = name.rpartition("/")

    def change(data):
        return data.assign({short: data[short].astype(dtype).assign_attrs(data[short].attrs)})

    return _edit("/" + group, change)


STEPS = np.arange(40) * 0.5
RECORD_FAULTS = {
    "no record": (lambda t: t.__delitem__("record"), "record: the group is missing"),
    "no variable": (
        _edit("record", lambda d: d.drop_vars("elongation")),
        "record/elongation: the variable is missing; add it with dimensions (trace, time) in rad",
    ),
    "no attribute": (lambda t: t.attrs.pop("record_id"), "attribute record_id: is missing at the root"),
    "schema": (_attr("/", schema="isochrony-result"), "attribute schema: is 'isochrony-result', not"),
    "schema is no text": (_attr("/", schema=np.array([1, 2])), "attribute schema: is array([1, 2]), not"),
    "version": (_attr("/", schema_version="2"), "attribute schema_version: is '2', not '1'; set it"),
    "version is a number": (_attr("/", schema_version=1), "attribute schema_version: is 1, not '1'"),
    "dimensions": (
        _edit("record", lambda d: d.assign(elongation=d["elongation"].T)),
        "record/elongation: has dimensions (time, trace); give it (trace, time)",
    ),
    "type": (_dtype("record/elongation", "f4"), "record/elongation: has type f4; store it as f8"),
    "type of labels": (
        _edit("instrument", lambda d: d.assign_coords(pendulum=[1, 2])),
        "instrument/pendulum: has type i8; store it as str",
    ),
    "units": (
        lambda t: t["record/elongation"].attrs.update(units="deg"),
        "record/elongation: has units 'deg'; convert it to 'rad'",
    ),
    "units are a number": (
        lambda t: t["instrument/period"].attrs.update(units=1),
        "instrument/period: has units 1; convert it to 's'",
    ),
    "no units": (
        lambda t: t["instrument/period"].attrs.pop("units"),
        "instrument/period: has no units; set its attribute units to 's'",
    ),
    "no time": (
        lambda t: setattr(t, "dataset", t.to_dataset().drop_vars("time")),
        "time: is missing at the root",
    ),
    "time with NaN": (_whole_time(np.where(STEPS == 3.0, np.nan, STEPS)), "time: holds NaN or infinite values"),
    "time with infinity": (_whole_time(np.where(STEPS == 19.5, np.inf, STEPS)), "time: holds NaN or infinite"),
    "time falls": (_whole_time(np.where(STEPS == 3.0, 2.0, STEPS)), "time: does not increase at sample 6 (2.5 s, then"),
    "time repeats": (_whole_time(np.where(STEPS == 3.0, 2.5, STEPS)), "time: does not increase at sample 6"),
    "one sample": (_whole_time(STEPS[:1]), "time: holds 1 sample; a record needs 2 or more"),
    "no sample": (_whole_time(STEPS[:0]), "time: holds 0 samples; a record needs 2 or more"),
    "infinite elongation": (
        _values("record/elongation", (0, 3), -np.inf),
        "record/elongation: holds infinite values; mark missing values as NaN",
    ),
    "infinite beside NaN": (
        lambda t: [_values("record/elongation", (0, i), v)(t) for i, v in ((3, np.inf), (4, np.nan))],
        "record/elongation: holds infinite values",
    ),
    "empty trace": (
        _values("record/elongation", 1, np.nan),
        "record/elongation: trace '1-2' is all NaN; leave the trace out",
    ),
    "NaN combination": (_values("record/combination", (0, 0), np.nan), "record/combination: holds NaN; give every"),
    "zero row": (
        _values("record/combination", 1, 0.0),
        "record/combination: the row of trace '1-2' is all zero; say which pendulums",
    ),
    "no difference": (
        _values("record/combination", 1, [1.0, 0.0]),
        "record/combination: no pair of pendulums can be told apart",
    ),
    "zero period": (_values("instrument/period", 0, 0.0), "instrument/period: holds 0; give values greater than zero"),
    "NaN period": (_values("instrument/period", 0, np.nan), "instrument/period: holds NaN; give every value, or"),
    "infinite period": (
        _values("instrument/period", 0, np.inf),
        "instrument/period: holds infinite values; give finite",
    ),
    "negative gravity": (
        _values("instrument/reference_gravity", (), -9.8),
        "instrument/reference_gravity: holds -9.8; give values greater than zero",
    ),
    "negative damping": (
        _values("instrument/damping_rate", 1, -1e-4),
        "instrument/damping_rate: holds -0.0001; give values zero or more",
    ),
    "no period": (
        _edit("instrument", lambda d: d.drop_vars("period")),
        "instrument/period: is missing; give the full period of each pendulum in s",
    ),
    "no instrument": (lambda t: t.__delitem__("instrument"), "instrument/reference_gravity: is missing"),
    "other labels": (
        _edit("instrument", lambda d: d.assign_coords(pendulum=["1", "II"])),
        "instrument/pendulum: lacks 2 of record/pendulum; use the same labels",
    ),
    "label twice": (
        _edit("record", lambda d: d.assign_coords(trace=["1", "1"])),
        "record/trace: a label appears twice; give each trace its own",
    ),
    "restoring": (_attr("instrument", restoring="cubic"), "instrument, attribute restoring: is 'cubic'; give 'sine'"),
    "flag masks": (
        lambda t: t["record/elongation_qc"].attrs.update(flag_masks=np.array([1, 2], dtype="u2")),
        "record/elongation_qc, attribute flag_masks: differs from the table; set it to 1 2 4 8",
    ),
    "complex": (
        _dtype("record/elongation", "c16"),
        "record/elongation: type complex128 cannot be stored; complex numbers do not travel",
    ),
}


@pytest.mark.parametrize(("spoil", "told"), RECORD_FAULTS.values(), ids=RECORD_FAULTS)
def test_a_fault_of_a_record_is_named(tmp_path, example, spoil, told):
    tree = example("record")
    spoil(tree)
    faults = check(tree, "record")
    assert any(fault.startswith(told) for fault in faults), faults
    assert all(";" in fault and fault.isprintable() for fault in faults)
    if "cannot be stored" not in told and "isochrony-result" not in told:  # else it is checked as a result
        path = tmp_path / "file.nc"
        write(tree, path)
        assert sorted(validate(path)) == sorted(f"{path}: {fault}" for fault in dict.fromkeys(faults))


def test_all_faults_are_told_at_once(example):
    tree = example("record")
    picks = ["no attribute", "units", "NaN period", "negative damping", "label twice", "time repeats", "restoring"]
    for pick in picks[::-1]:
        RECORD_FAULTS[pick][0](tree)
    faults = check(tree, "record")
    assert len(faults) == len(picks)
    for pick in picks:
        assert any(fault.startswith(RECORD_FAULTS[pick][1]) for fault in faults), pick


def test_a_single_trace_needs_no_instrument(record):
    single = record["record"].to_dataset(inherit=False).isel(trace=[0], pendulum=[0])
    tree = xr.DataTree.from_dict({"/": record.to_dataset(), "/record": single})
    assert check(tree, "record") == []


def test_three_pendulums_by_their_differences(record):
    """theta1, theta1-theta2, theta2-theta3 give every pendulum; the two differences alone give none."""
    weights = np.array([[1.0, 0.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, -1.0]])
    for rows, good in ((slice(None), True), (slice(1, None), False), (slice(2), True)):
        count = len(weights[rows])
        group = xr.Dataset(
            {
                "combination": (("trace", "pendulum"), weights[rows]),
                "elongation": (("trace", "time"), np.ones((count, 40)), {"units": "rad"}),
            },
            coords={"trace": [f"t{row}" for row in range(count)], "pendulum": ["1", "2", "3"]},
        )
        instrument = xr.Dataset(
            {
                "period": ("pendulum", [1.0, 1.1, 1.2], {"units": "s"}),
                "reference_gravity": ((), 9.8, {"units": "m s-2"}),
            },
            coords={"pendulum": ["3", "1", "2"]},
        )
        tree = xr.DataTree.from_dict({"/": record.to_dataset(), "/record": group, "/instrument": instrument})
        assert (check(tree, "record") == []) is good


RESULT_FAULTS = {
    "none": (
        lambda t: [t.__delitem__("gravity"), t.__delitem__("period"), t.__delitem__("synchrony")],
        "gravity or period or synchrony: the group is missing",
    ),
    "not JSON": (_attr("/", configuration="{"), "attribute configuration: is not JSON"),
    "no JSON text": (_attr("/", versions=3), "attribute versions: is not JSON"),
    "method twice": (
        _edit("gravity", lambda d: d.assign_coords(estimator=["a", "a"])),
        "gravity/estimator: a label appears twice",
    ),
    "extra without units": (
        _edit("gravity", lambda d: d.assign(extra=("estimator", [1.0, 2.0], {"long_name": "x"}))),
        "gravity/extra: is not in the table and has no units; add it",
    ),
    "extra without name": (
        _edit("gravity", lambda d: d.assign(extra=("estimator", [1.0, 2.0], {"units": "1"}))),
        "gravity/extra: is not in the table and has no long_name; add it",
    ),
    "negative sigma": (_values("gravity/gravity_sigma", 0, -1.0), "gravity/gravity_sigma: holds -1; give values zero"),
}


@pytest.mark.parametrize(("spoil", "told"), RESULT_FAULTS.values(), ids=RESULT_FAULTS)
def test_a_fault_of_a_result_is_named(example, spoil, told):
    tree = example("result")
    spoil(tree)
    faults = check(tree, "result")
    assert len(faults) == 1
    assert faults[0].startswith(told)


def test_a_result_may_refuse_a_method_and_add_variables(example):
    tree = example("result")
    _values("gravity/gravity", 0, np.nan)(tree)
    _edit("gravity", lambda d: d.assign(extra=("estimator", [1.0, 2.0], {"units": "1", "long_name": "x"})))(tree)
    assert check(tree, "result") == []


def test_a_truth_is_checked(example):
    tree = example("truth")
    _values("truth/gravity", (), 0.0)(tree)
    tree.attrs["scene"] = "none"
    assert [fault.partition(":")[0] for fault in check(tree, "truth")] == ["attribute scene", "truth/gravity"]


def test_a_file_of_no_known_kind(tmp_path):
    path = tmp_path / "file.nc"
    write(xr.DataTree(xr.Dataset({"a": ("x", [1.0])})), path)
    assert validate(path) == [
        f"{path}: attribute schema: is missing at the root and no group is known; set it to one of "
        "isochrony-record, isochrony-truth, isochrony-result, isochrony-film-truth, isochrony-summary"
    ]
    write(xr.DataTree(xr.Dataset(attrs={"schema": "x"})), path, overwrite=True)
    assert "attribute schema: is 'x' and no group is known" in validate(path)[0]


def test_a_file_that_does_not_say_its_kind_is_checked_by_its_groups(tmp_path, example):
    tree, path = example("truth"), tmp_path / "file.nc"
    del tree.attrs["schema"]
    tree["truth/theta"].attrs["units"] = "deg"
    write(tree, path)
    faults = validate(path)
    assert len(faults) == 2
    assert faults[0].startswith(f"{path}: attribute schema: is missing at the root; add it")
    assert faults[1].startswith(f"{path}: truth/theta: has units 'deg'")


def test_a_record_without_labels_is_told(record):
    full = record["record"].to_dataset(inherit=False)
    record["record"].dataset = full.isel(pendulum=slice(0, 0))
    assert any(
        "record/pendulum: holds no label; give at least one pendulum" in fault for fault in check(record, "record")
    )


def test_a_record_without_combination_is_told_once(record):
    record["record"].dataset = record["record"].to_dataset(inherit=False).drop_vars("combination")
    assert sum("combination" in fault for fault in check(record, "record")) == 1
