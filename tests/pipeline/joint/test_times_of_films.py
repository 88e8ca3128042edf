"""Times of a film that are wrong for seconds: no gravity that changes, no step of the clock is made of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from scipy.interpolate import CubicSpline
from test_apparatus import changed
from test_method import in_sigmas, record

from pipeline import process, summaries
from pipeline.joint import choice
from pipeline.joint.fit import fitted
from pipeline.joint.gather import gather

pytestmark = pytest.mark.compiled
SIGMA, PERIOD = 1e-4, 70.0  # s


def with_wander(size: float) -> tuple[xr.DataTree, float]:
    """A film's record whose clock smoothly runs ahead and back, by so many of the sigma that it states."""
    made, gravity = record(recording={"sampling_rate": 12.5, "noise": 5e-6}, motion=[], duration=300.0)
    time = made.dataset["time"].values
    wander = size * SIGMA * np.sin(2.0 * np.pi * time / PERIOD)
    made = changed(made, "elongation", lambda at, value: CubicSpline(at, value, axis=-1)(at - wander))
    stored = made["record"].dataset.assign(time_uncertainty=("time", np.full(time.size, SIGMA), {"units": "s"}))
    made["record"] = xr.DataTree(stored)
    made["film"] = xr.DataTree(xr.Dataset())
    return made, gravity


@pytest.mark.parametrize("size", [1.5, 2.5])
def test_a_clock_that_wanders_changes_no_gravity(size: float) -> None:
    made, gravity = with_wander(size)
    found = summaries(process(made, method="joint"))[0]
    assert "gravity changes" not in found["choice_reason"].split("(close")[0]
    assert "step of the clock" not in found["choice_reason"].split("(close")[0]
    assert abs(in_sigmas(found, gravity)) < 3.5


@pytest.mark.parametrize(("doubt", "believed"), [(0.0, True), (1e-7, True), (SIGMA, False)])
def test_changes_that_the_clock_would_feign_are_not_tried(doubt: float, believed: bool) -> None:
    """A rate of 2 sigma over the correlation time, of 300 s at most, is .7e-6 for .1 ms, and counts twice."""
    made, _ = with_wander(0.1)
    fit = fitted(gather(made))[0]
    fit = replace(fit, model=replace(fit.model, problem=replace(fit.model.problem, time_doubt=doubt)))
    tried = [words for _, model, _ in choice._constants(fit) for words in model.words]
    assert ("gravity changes" in tried) is believed
