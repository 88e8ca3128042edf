"""Times of a film that are wrong for seconds: no gravity that changes, no step of the clock is made of them."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from scipy.interpolate import CubicSpline
from test_apparatus import changed
from test_method import in_sigmas, record

from pipeline import process, summaries

pytestmark = pytest.mark.compiled
SIGMA, LASTS = 1e-4, 8.0  # s


def with_wander(seed: int) -> tuple[xr.DataTree, float]:
    """A film's record whose clock wanders as an Ornstein-Uhlenbeck process does, and states by how much."""
    made, gravity = record(recording={"sampling_rate": 12.5, "noise": 5e-6}, motion=[], duration=300.0)
    time = made.dataset["time"].values
    random = np.random.default_rng(seed)
    decay = np.exp(-np.median(np.diff(time)) / LASTS)
    wander = np.zeros(time.size)
    for k in range(1, time.size):
        wander[k] = decay * wander[k - 1] + SIGMA * np.sqrt(1.0 - decay**2) * random.normal()
    made = changed(made, "elongation", lambda at, value: CubicSpline(at, value, axis=-1)(at - wander))
    stored = made["record"].dataset.assign(time_uncertainty=("time", np.full(time.size, SIGMA), {"units": "s"}))
    made["record"] = xr.DataTree(stored)
    made["film"] = xr.DataTree(xr.Dataset())
    rate = SIGMA * np.sqrt(24.0 * LASTS / 300.0) / 300.0  # of a line through a process alike for twice so long
    made["instrument"] = xr.DataTree(made["instrument"].dataset.assign(chronometer_rate_uncertainty=86400.0 * rate))
    made["instrument"]["chronometer_rate_uncertainty"].attrs["units"] = "s day-1"
    return made, gravity


@pytest.mark.parametrize("seed", range(4))
def test_a_clock_that_wanders_changes_no_gravity(seed: int) -> None:
    made, gravity = with_wander(seed)
    found = summaries(process(made, method="joint"))[0]
    assert "gravity changes" not in found["choice_reason"].split("(close")[0]
    assert "step of the clock" not in found["choice_reason"].split("(close")[0]
    assert abs(in_sigmas(found, gravity)) < 3.5
