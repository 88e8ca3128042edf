"""`joint` on records of an apparatus that is wrong: gravity within its sigma, and the fault named."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr
from scipy.interpolate import CubicSpline
from test_method import in_sigmas, record, row

from data_schemas.errors import RefusedError

pytestmark = pytest.mark.compiled


def changed(made: xr.DataTree, name: str, change: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> xr.DataTree:
    """A record with one of its variables changed: a function of time, s, and of the values."""
    time = made.dataset["time"].values
    stored = made["record"].dataset
    value = change(time, stored[name].values.copy())
    made["record"] = xr.DataTree(stored.assign({name: stored[name].copy(data=value)}))
    return made


def late(seconds: float) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    return lambda time, value: CubicSpline(time, value, axis=-1)(time - seconds)


def first(change: Callable[[np.ndarray, np.ndarray], np.ndarray], trace: int = 0) -> xr.DataTree:
    def of(time: np.ndarray, value: np.ndarray) -> np.ndarray:
        value[trace] = change(time, value[trace])
        return value

    return changed(record()[0], "elongation", of)


def heave(change: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> xr.DataTree:
    return changed(record()[0], "vertical_acceleration", change)


def clock() -> xr.DataTree:
    made = record()[0]
    root = made.to_dataset(inherit=False)
    time = root["time"].values
    stamped = root["time"].copy(data=time + 5e-3 * (time > 150.0))
    tree = {f"/{name}": made[name].to_dataset(inherit=False) for name in made.children}
    return xr.DataTree.from_dict({"/": root.assign_coords(time=stamped), **tree})


FAULTS: dict[str, tuple[Callable[[], xr.DataTree], str, float | None]] = {
    "zero of 3 mrad": (lambda: first(lambda time, value: value + 3e-3), "zero of trace 1", 3e-3),
    "zero that drifts": (lambda: first(lambda time, value: value + 4e-3 * time / 300.0), "drift of trace 1", 2e-3),
    "step of a zero": (lambda: first(lambda time, value: value + 1e-3 * (time > 100.02)), "step of trace 1", None),
    "step of the difference": (
        lambda: first(lambda time, value: value + 1e-3 * (time > 100.02), 1),
        "step of trace 2",
        None,
    ),
    "gain of 1 %": (lambda: first(lambda time, value: 1.01 * value), "", None),
    "delay of 10 ms": (lambda: first(late(0.01), 1), "delay of trace 2", 0.01),
    "bias of 20 mGal": (lambda: heave(lambda time, value: value + 2e-4), "", None),
    "heave of wrong sign": (lambda: heave(lambda time, value: -value), "scale of the heave", -2.0),
    "heave .3 s late": (lambda: heave(late(0.3)), "delay of the heave", 0.3),
    "clock's step of 5 ms": (clock, "", None),
    "steps of .3 mrad": (lambda: first(lambda time, value: 3e-4 * np.rint(value / 3e-4)), "", None),
    "clipped at 8 mrad": (lambda: first(lambda time, value: np.clip(value, -8e-3, 8e-3)), "", None),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_gravity_survives_a_fault_of_the_apparatus(fault: str) -> None:
    make, name, value = FAULTS[fault]
    found = row(make())
    gravity = record()[1]
    assert abs(in_sigmas(found, gravity)) < 3.5
    assert found["gravity_sigma_mgal"] < 20.0 * row(record()[0])["gravity_sigma_mgal"]
    assert name in found["choice_reason"]
    if value is not None:
        told = re.search(rf"{name}: (\S+) \+- ([\d.e-]+)", found["choice_reason"])
        assert told is not None
        assert abs(float(told[1]) - value) < 3.5 * float(told[2])


def test_no_fault_is_named_where_there_is_none() -> None:
    assert "apparatus-fault" not in row(record()[0])["flags"]


def test_what_two_traces_hold_alike_for_long_is_left_out_of_both() -> None:
    def copied(time: np.ndarray, value: np.ndarray) -> np.ndarray:
        value[1] = np.where((time > 60.0) & (time < 90.0), value[0], value[1])
        return value

    made, gravity = record()
    found = row(changed(made, "elongation", copied))
    assert abs(in_sigmas(found, gravity)) < 3.5
    assert found["gravity_sigma_mgal"] < 20.0 * row(record()[0])["gravity_sigma_mgal"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda time, value: np.stack([value[0], value[0]]), "hold the same values"),
        (lambda time, value: 5e-3 * np.rint(value / 5e-3), "too coarse"),
    ],
)
def test_traces_that_are_one_and_readings_too_coarse_are_refused(
    change: Callable[[np.ndarray, np.ndarray], np.ndarray], words: str
) -> None:
    with pytest.raises(RefusedError, match=words):
        row(changed(record()[0], "elongation", change))
