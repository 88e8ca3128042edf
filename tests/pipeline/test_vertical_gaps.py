"""Gaps of a recorded vertical acceleration: bridged to what the swell allows, and honest about the rest."""

from __future__ import annotations

import numpy as np
import pytest

import synth
from data_schemas.scene import Scene
from pipeline.processing import process
from pipeline.vertical import LONGEST, MOST_MISSING, bridged

STEP, N2 = 0.04, 6.2
TIME = np.arange(30_000) * STEP
HEAVE = 0.4 * np.cos(0.7 * TIME) + 0.2 * np.sin(1.1 * TIME + 1.0) + 0.05 * np.cos(1.9 * TIME)


def broken(lost: np.ndarray) -> np.ndarray:
    return np.where(lost, np.nan, HEAVE)


def mean_error(filled: np.ndarray) -> float:
    """mGal."""
    return 1e5 * abs(float(np.mean(filled - HEAVE)))


def test_a_whole_record_is_left_alone() -> None:
    filled, doubt = bridged(TIME, STEP, HEAVE, N2)
    assert filled is HEAVE
    assert doubt == 0.0


@pytest.mark.parametrize("step", [STEP, None])
def test_single_readings_cost_nothing(step: float | None) -> None:
    """A straight line through their neighbours would cost a twentieth of a milligal and more."""
    lost = np.random.default_rng(1).random(TIME.size) < 0.05
    lost[[0, -1]] = False
    filled, doubt = bridged(TIME, step, broken(lost), N2)
    assert filled is not None
    straight = HEAVE.copy()
    straight[lost] = np.interp(TIME[lost], TIME[~lost], HEAVE[~lost])
    assert mean_error(filled) < 0.02 * mean_error(straight)
    assert mean_error(filled) < max(3.0 * 1e5 * doubt, 1e-6)


@pytest.mark.parametrize("step", [STEP, None])
def test_a_second_each_minute_is_within_the_doubt(step: float | None) -> None:
    lost = (TIME % 60.0 > 30.0) & (TIME % 60.0 < 31.0)
    filled, doubt = bridged(TIME, step, broken(lost), N2)
    assert filled is not None
    assert mean_error(filled) < 3.0 * 1e5 * doubt
    assert mean_error(filled) < 0.5


@pytest.mark.parametrize(
    "lost",
    [
        (TIME > 100.0) & (TIME < 100.5 + LONGEST),
        np.arange(TIME.size) % round(0.9 / MOST_MISSING) == 0,
        np.ones(TIME.size, dtype=bool),
    ],
    ids=["too long", "too many", "all"],
)
def test_what_is_missing_too_much_was_not_recorded(lost: np.ndarray) -> None:
    assert bridged(TIME, STEP, broken(lost), N2) == (None, 0.0)


@pytest.mark.compiled
@pytest.mark.parametrize("gap", [0.0, 1.2])
def test_gravity_in_heave_whose_record_has_gaps(gap: float) -> None:
    """1.5 % of the rows dropped, or a second of the heave each minute: once .3 mGal and more off, 20 sigma."""
    sea = {
        "kind": "sea",
        "spectrum": "pierson-moskowitz",
        "significant_height": 4.0,
        "peak_period": 7.0,
        "depth": 10.0,
        "seed": 11,
    }
    kept = {"sampling_rate": 10, "noise": 1e-6, "vertical_acceleration": True}
    pendulums = [
        {"label": label, "period": period, "start": {"kind": "free", "amplitude": size, "phase": phase}}
        for label, period, size, phase in (("1", 1.0, 0.02, 0.3), ("2", 1.0001, 0.02, 2.5))
    ]
    drawn = Scene.model_validate(
        {
            "record_id": "gaps-of-heave",
            "seed": 5,
            "duration": 1200.0,
            "gravity": 9.8123,
            "reference_gravity": 9.81,
            "restoring": "sine",
            "pendulums": pendulums,
            "motion": [sea, sea | {"axis": "vertical"}],
            "recording": kept | ({} if gap else {"drop_fraction": 0.015}),
        }
    )
    record, _ = synth.simulate(drawn)
    if gap:
        time = record["time"].values
        lost = (time % 60.0 > 30.0) & (time % 60.0 < 30.0 + gap)
        record["record"]["vertical_acceleration"].values[lost] = np.nan
    told = process(record, method="shooting")["gravity"].dataset
    off = 1e5 * (float(told["gravity"].values[0]) - 9.8123)
    assert abs(off) < 4.0 * float(told["gravity_sigma"].values[0])
    assert abs(off) < 0.05
