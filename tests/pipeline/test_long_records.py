"""Long records: portions and scratch files change no number, and memory does not grow with the record."""

from __future__ import annotations

import tracemalloc
from typing import Any

import numpy as np
import pytest
import xarray as xr
from made_records import simulate

from data_schemas import scratch
from pipeline import METHODS, process
from pipeline.methods.projection import linear_fit
from pipeline.observation import observe
from pipeline.prepared import prepare

RECORDS: dict[str, dict[str, Any]] = {
    "whole": {},
    "uneven lengths": {"duration": 217.3, "noise": 1e-5},
    "damping not stated": {"noise": 1e-5, "write_damping": False, "damping": (2e-5, 2e-5)},
    "two pendulums": {
        "noise": 1e-5,
        "traces": [{"name": "a", "combination": {"1": 1}}, {"name": "b", "combination": {"2": 1}}],
    },
    "late": {"noise": 1e-5, "missing": [[0.0, 1.3]]},
}
SMALL_ARC: dict[str, Any] = {"free": ((1e-4, 0.4), (5e-5, 2.2)), "motion": [], "noise": 1e-6}
"""Swings for which linear and real pendulums are the same."""


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half a minute is a portion, and more is long."""
    monkeypatch.setattr(scratch, "PORTION", 300)
    monkeypatch.setattr(scratch, "LONG", 300)


def numbers(result: xr.DataTree) -> dict[str, np.ndarray]:
    """Every number of a result but the times it took."""
    found = {
        f"{node.path}/{name}": np.asarray(values)
        for node in result.subtree
        for name, values in node.to_dataset(inherit=False).variables.items()
        if values.dtype.kind in "fiu" and name != "elapsed"
    }
    return found


SAME_GRAVITY, SAME_REST = 1e-11, 1e-9
"""Relative. Portions change the order of a sum, and so its last bit; the processor decides by how much. Measured:
1.1e-12 in the reading noise, 1e-9 in all but gravity where damping is fitted. A sample lost or counted twice where
portions meet changes a sum over the record by 1e-5 or more."""


def assert_the_same_by_portions(record: xr.DataTree, method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The numbers by portions as short as they are now, and by the usual ones."""
    small = numbers(process(record, method=method))
    monkeypatch.setattr(scratch, "PORTION", 1 << 16)
    monkeypatch.setattr(scratch, "LONG", 1 << 18)
    whole = numbers(process(record, method=method))
    assert small.keys() == whole.keys()
    for key, values in whole.items():
        tolerance = SAME_GRAVITY if key == "/gravity/gravity" else SAME_REST
        assert small[key] == pytest.approx(values, rel=tolerance, abs=1e-18, nan_ok=True), key


@pytest.mark.parametrize("name", RECORDS)
def test_portions_change_no_number(name: str, short: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sums over blocks are the same wherever portions begin."""
    record, _ = simulate(**RECORDS[name])
    assert_the_same_by_portions(record, "projection", monkeypatch)


@pytest.mark.compiled
@pytest.mark.parametrize("name", ["whole", "damping not stated"])
def test_portions_change_no_number_of_the_nonlinear_identity(
    name: str, short: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    record, _ = simulate(**RECORDS[name] | SMALL_ARC)
    record["instrument"].attrs["restoring"] = "sine"
    assert_the_same_by_portions(record, "shooting", monkeypatch)


@pytest.mark.compiled
@pytest.mark.parametrize("restoring", ["linear", "sine"])
def test_where_arrays_lie_changes_no_bit(restoring: str, short: None, monkeypatch: pytest.MonkeyPatch) -> None:
    record, _ = simulate(noise=1e-5, duration=330.0)
    record["instrument"].attrs["restoring"] = restoring
    every = [name for name in METHODS if name not in ("auto", "joint")]
    in_files = numbers(process(record, method=every))
    monkeypatch.setattr(scratch, "LONG", 1 << 18)
    in_memory = numbers(process(record, method=every))
    assert in_files.keys() == in_memory.keys()
    for key, values in in_memory.items():
        assert np.array_equal(in_files[key], values, equal_nan=True), key


def test_a_long_record_lies_in_scratch_files_and_stays_as_it_was(short: None) -> None:
    record, _ = simulate(**RECORDS["whole"])
    before = record["record"]["elongation"].values.copy()
    prepared = prepare(observe(record))
    fit = linear_fit(prepared)
    for series in (prepared.observation.time, fit.residual):
        assert scratch.mapping(series) is not None
    assert np.array_equal(record["record"]["elongation"].values, before, equal_nan=True)


def growth(method: str, hours: tuple[float, float], **recording: Any) -> float:
    """Bytes that stay in memory of each further sample at 25 Hz."""

    def peak(hours: float) -> tuple[int, int]:
        options = {key: value for key, value in recording.items() if key != "restoring"}
        record, _ = simulate(**{"duration": 3600.0 * hours, "sampling_rate": 25, "noise": 1e-5} | options)
        record["instrument"].attrs["restoring"] = recording.get("restoring", "linear")
        process(record, method=method)  # libraries and kernels are loaded
        tracemalloc.start()
        try:
            process(record, method=method)
            return tracemalloc.get_traced_memory()[1], record["time"].size
        finally:
            tracemalloc.stop()

    (small, few), (large, many) = peak(hours[0]), peak(hours[1])
    return (large - small) / (many - few)


@pytest.mark.compiled
def test_memory_does_not_grow_with_the_record() -> None:
    """Of each further sample less than two numbers stay in memory, most of it phases: it was thirty before."""
    assert growth("projection", (4.0, 8.0)) < 16.0


@pytest.mark.compiled
def test_memory_does_not_grow_with_the_nonlinear_identity(monkeypatch: pytest.MonkeyPatch) -> None:
    """It was 307 bytes a sample; the ledger's slow motion stays, 30."""
    monkeypatch.setattr(scratch, "PORTION", 1 << 12)
    monkeypatch.setattr(scratch, "LONG", 1 << 12)
    assert growth("shooting", (0.25, 0.5), restoring="sine", **SMALL_ARC) < 40.0
