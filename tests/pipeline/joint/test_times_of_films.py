"""Times of a film that are wrong for seconds: no gravity that changes, no step of the clock is made of them."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from scipy.interpolate import CubicSpline
from test_apparatus import changed
from test_method import in_sigmas, record

from data_schemas.errors import RecordError
from pipeline import process, summaries
from pipeline.joint import kinds
from pipeline.joint.constants import is_mode
from pipeline.joint.film_errors import with_clock
from pipeline.joint.gather import gather
from pipeline.joint.start import first_fits

pytestmark = pytest.mark.compiled
SIGMA, PERIOD, LASTS = 1e-4, 70.0, 10.0  # s


def with_wander(size: float) -> tuple[xr.DataTree, float]:
    """A film's record whose clock smoothly runs ahead and back, by so many of the sigma that it states."""
    made, gravity = record(recording={"sampling_rate": 12.5, "noise": 5e-6}, motion=[], duration=300.0)
    time = made.dataset["time"].values
    wander = size * SIGMA * np.sin(2.0 * np.pi * time / PERIOD)
    made = changed(made, "elongation", lambda at, value: CubicSpline(at, value, axis=-1)(at - wander))
    stored = made["record"].dataset.assign(time_uncertainty=("time", np.full(time.size, SIGMA), {"units": "s"}))
    made["record"] = xr.DataTree(stored)
    noise = SIGMA * np.sqrt(LASTS)
    made["film"] = xr.DataTree(xr.Dataset(attrs={"time_noise": noise}))
    rate = 86400.0 * noise * np.sqrt(12.0 / np.ptp(time) ** 3)
    made["instrument"] = xr.DataTree(
        made["instrument"].dataset.assign(chronometer_rate_uncertainty=((), rate, {"units": "s day-1"}))
    )
    return made, gravity


@pytest.mark.parametrize("size", [1.5, 2.5])
def test_a_clock_that_wanders_changes_no_gravity(size: float) -> None:
    made, gravity = with_wander(size)
    found = summaries(process(made, method="joint"))[0]
    assert "gravity changes" not in found["choice_reason"].split("(close")[0]
    assert "step of the clock" not in found["choice_reason"].split("(close")[0]
    assert abs(in_sigmas(found, gravity)) < 3.5


def test_time_errors_are_weighed_by_what_is_stated_of_them() -> None:
    """The known wander is found, to its own uncertainty, and bears the record's spectral density."""
    made, _ = with_wander(1.5)
    problem = gather(made).problem
    fit = with_clock(first_fits(gather(made))[0])
    modes = [each for each in fit.solution.constants if is_mode(each)]
    times = np.linspace(0.0, problem.lattice.duration, 200)
    found = sum(each.value * np.cos(each.width * times) for each in modes)
    wander = 1.5 * SIGMA * np.sin(2.0 * np.pi * (times + problem.lattice.start) / PERIOD)
    design = np.stack([np.ones(times.size), np.cos(np.pi * times / times[-1])], axis=1)  # not the clock's own to tell
    rest = found - wander
    rest -= design @ np.linalg.lstsq(design, rest, rcond=None)[0]
    assert rest.std() < 0.1 * wander.std()


def test_what_is_left_of_a_step_of_the_paper_is_found() -> None:
    made, gravity = with_wander(0.0)
    at, left = 0.4 * np.ptp(made.dataset["time"].values), 2e-5
    made = changed(made, "elongation", lambda time, value: value + left * (time >= at))
    made["film"].attrs["paper_steps"] = np.array([at])
    gathered = gather(made)
    sizes = [each.value for each in first_fits(gathered)[0].solution.constants if each.kind == kinds.STEP]
    assert gathered.problem.paper_steps == pytest.approx((at - gathered.problem.lattice.start,))
    assert sizes == pytest.approx([left] * gathered.problem.traces, rel=0.1)
    assert abs(in_sigmas(summaries(process(made, method="joint"))[0], gravity)) < 3.5


def test_how_far_a_trace_lies_off_the_marks_is_a_length() -> None:
    """Lamps at some distance along a film are late by more where the paper runs slower."""
    made, gravity = with_wander(0.0)
    time = made.dataset["time"].values
    pace = 1.0 + 0.03 * (time - time.mean()) / np.ptp(time)
    late = np.array([[0.03], [-0.04]]) * pace

    def delayed(at: np.ndarray, value: np.ndarray) -> np.ndarray:
        return np.array([CubicSpline(at, each)(at - by) for each, by in zip(value, late, strict=True)])

    made = changed(made, "elongation", delayed)
    stated = {"delay_uncertainty": ((), 0.06, {"units": "s"})}
    made["instrument"] = xr.DataTree(made["instrument"].dataset.assign(stated))
    made["film"] = xr.DataTree(made["film"].dataset.assign(paper_speed=("time", 5.0 / pace, {"units": "mm s-1"})))
    found = summaries(process(made, method="joint"))[0]
    assert abs(in_sigmas(found, gravity)) < 3.5
    # how late all are, only the marks could tell
    assert found["gravity_sigma_mgal"] == pytest.approx(2.0 * 0.06 * 0.03 / np.ptp(time) * 9.81e5, rel=0.01)
    assert "delay of trace 2: -0.07 " in found["choice_reason"]


def test_noise_of_marks_that_is_not_stated_is_taken_to_last_seconds() -> None:
    made, _ = with_wander(0.0)
    stated = gather(made).problem.time_noise
    made["film"] = xr.DataTree(xr.Dataset())
    assert gather(made).problem.time_noise == pytest.approx(stated)


def test_without_stated_times_no_errors_are_sought() -> None:
    made, _ = with_wander(0.0)
    made["record"] = xr.DataTree(made["record"].dataset.drop_vars("time_uncertainty"))
    fit = first_fits(gather(made))[0]
    assert with_clock(fit) is fit


@pytest.mark.parametrize(("name", "value"), [("time_noise", "much"), ("time_noise", -1.0), ("paper_steps", [1.0] * 99)])
def test_film_attributes_that_cannot_be_meant_are_refused(name: str, value: object) -> None:
    made, _ = with_wander(0.0)
    made["film"].attrs[name] = value
    with pytest.raises(RecordError, match="time_noise and paper_steps"):
        gather(made)
