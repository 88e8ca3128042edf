"""`process` as a user calls it, on records that the methods of one difference do not take: gravity within its sigma."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import xarray as xr

import synth
from data_schemas.errors import RefusedError
from data_schemas.scene import Scene
from pipeline import process, summaries

GRAVITY = 9.8123
SEA = {"kind": "sea", "spectrum": "pierson-moskowitz", "significant_height": 4.0, "peak_period": 7.0, "depth": 10.0,
    "seed": 11}  # fmt: skip
SWELL = {"kind": "harmonics", "amplitude": [0.05], "period": [9.0]}


def made(count: int = 2, **changes: Any) -> xr.DataTree:
    """Two pendulums, or three, whose law and damping the record states."""
    starts = (("1", 1.01, 0.010, 0.4), ("2", 1.0101, 0.012, 2.2), ("3", 1.01005, 0.011, 4.1))[:count]
    scene = {
        "record_id": "by-default",
        "seed": 3,
        "duration": 300.0,
        "gravity": GRAVITY,
        "pendulums": [
            {"label": label, "period": period, "damping_rate": 1e-4, "start": start}
            for label, period, size, phase in starts
            for start in ({"kind": "free", "amplitude": size, "phase": phase},)
        ],
        "motion": [SWELL],
    }
    recording = {"sampling_rate": 10, "noise": 1e-5} | changes.pop("recording", {})
    return synth.simulate(Scene.model_validate(scene | {"recording": recording} | changes))[0]


def heaving(lost: float) -> xr.DataTree:
    """Real pendulums in a seaway; so many seconds of the recorded heave lost each minute, or rows dropped."""
    kept: dict[str, Any] = {"vertical_acceleration": True, "noise": 1e-6} | ({} if lost else {"drop_fraction": 0.015})
    record = made(restoring="sine", duration=600.0, motion=[SEA, SEA | {"axis": "vertical"}], recording=kept)
    if lost:
        time = record["time"].values
        record["record"]["vertical_acceleration"].values[(time % 60.0 > 30.0) & (time % 60.0 < 30.0 + lost)] = np.nan
    return record


SINGLE = [{"name": label, "combination": {label: 1}} for label in "123"]
RECORDS = {
    "rows dropped, heave recorded": (lambda: heaving(0.0), 0.5),
    "a second of the heave lost each minute": (lambda: heaving(1.2), 0.5),
    "three pendulums, differences": (lambda: made(3), 1.0),
    "three pendulums, each its trace": (lambda: made(3, recording={"traces": SINGLE}), 1.0),
    "uneven times, wild readings": (
        lambda: made(recording={"jitter": 0.01, "outliers": 20, "outlier_amplitude": 0.01}),
        1.0,
    ),
    "a minute of both traces lost": (
        lambda: made(recording={"missing": [{"start": 100.0, "stop": 160.0}]}),
        5.0,
    ),
}
"""Record and the largest sigma, mGal, that may be stated of it."""


@pytest.mark.compiled
@pytest.mark.parametrize("name", RECORDS)
def test_gravity_lies_within_its_sigma(name: str) -> None:
    record, most = RECORDS[name]
    (found,) = summaries(process(record()))
    assert found["method"] == "joint"
    assert abs(found["gravity_m_s2"] - GRAVITY) * 1e5 < 4.0 * found["gravity_sigma_mgal"]
    assert found["gravity_sigma_mgal"] < most


@pytest.mark.parametrize("method", ["projection", "shooting", "panteleev", "general"])
def test_what_they_do_not_take_they_refuse_and_name_the_joint_fit(method: str) -> None:
    record = made(recording={"jitter": 0.01}, duration=60.0)
    with pytest.raises(RefusedError, match=r"^time: .*; use --method joint$"):
        process(record, method=method)
