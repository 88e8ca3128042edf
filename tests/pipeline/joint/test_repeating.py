"""Errors that repeat with the swing: taken off the readings, without a move of gravity, and for nothing else."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from scipy.signal import hilbert
from test_apparatus import changed
from test_method import in_sigmas, record

from pipeline import process, summaries
from pipeline.joint import film_errors
from pipeline.joint.course import mean_row
from pipeline.joint.gather import gather
from pipeline.joint.start import first_fits
from pipeline.joint.unfollowed import doubt_by_repeating

pytestmark = pytest.mark.compiled
RATE = {"sampling_rate": 25, "noise": 5e-6}


def with_harmonics(made: xr.DataTree, size: float) -> xr.DataTree:
    """Errors of the second to the fourth harmonic of each trace's own phase."""

    def change(time: np.ndarray, value: np.ndarray) -> np.ndarray:
        turn = hilbert(value - value.mean(axis=1, keepdims=True), axis=1)
        phase = np.angle(turn)
        return value + size * (np.cos(2 * phase + 0.3) - np.cos(3 * phase) + 0.5 * np.sin(4 * phase))

    made = changed(made, "elongation", change)
    made["film"] = xr.DataTree(xr.Dataset())
    return made


def test_they_are_taken_off_and_leave_gravity() -> None:
    made, gravity = record(recording=RATE, motion=[], duration=900.0)
    found = summaries(process(with_harmonics(made, 6e-7), method="joint"))[0]
    plain = summaries(process(record(recording=RATE, motion=[], duration=900.0)[0], method="joint"))[0]
    assert "errors repeating with the swing" in found["choice_reason"]
    assert "motion at" not in found["choice_reason"]
    assert abs(in_sigmas(found, gravity)) < 3.5
    of_the_optics = 0.75 * np.sqrt(2.0) * 0.012 * 6e-7 * np.sqrt(1.125) * gravity / 1e-5
    assert found["gravity_sigma_mgal"] < 1.2 * np.hypot(plain["gravity_sigma_mgal"], of_the_optics)
    moved = abs(found["gravity_m_s2"] - plain["gravity_m_s2"]) / 1e-5
    assert moved < 0.3 * plain["gravity_sigma_mgal"]


def test_their_size_is_what_was_added() -> None:
    made, _ = record(recording=RATE, motion=[], duration=900.0)
    fit = film_errors.without_repeating(first_fits(gather(with_harmonics(made, 6e-7)))[0])
    expected = 6e-7 * np.sqrt(0.5 * (1.0 + 1.0 + 0.25))
    np.testing.assert_allclose(fit.model.problem.repeating, expected, rtol=0.1)


@pytest.mark.parametrize(
    ("recording", "size"),
    [(RATE, 0.0), ({"sampling_rate": 2, "noise": 5e-6}, 6e-7)],
    ids=["none", "sampled too seldom"],
)
def test_nothing_is_taken_off(recording: dict[str, float], size: float) -> None:
    made, _ = record(recording=recording, motion=[], duration=900.0)
    fit = first_fits(gather(with_harmonics(made, size)))[0]
    assert film_errors.without_repeating(fit) is fit


def test_a_third_harmonic_may_be_the_optics() -> None:
    """The doubt is what a cubic error of the same third harmonic makes of gravity, by the arc: A^2/8 and 3 c A^2/4."""
    made, _ = record(recording=RATE, motion=[], duration=900.0)
    fit = film_errors.without_repeating(first_fits(gather(with_harmonics(made, 6e-7)))[0])
    amplitude, third = 0.012, 6e-7
    arc = 2.0 * amplitude**2 / 8.0 * 3.0 * third / amplitude
    assert arc < film_errors.doubt_by_optics(fit) < 2.5 * arc


@pytest.mark.parametrize(("duration", "least", "most"), [(60.0, 2.0, 10.0), (900.0, 1e-3, 0.02)])
def test_at_marks_what_repeats_with_the_swing_is_in_sigma(duration: float, least: float, most: float) -> None:
    """Marks come nearly twice a swing: within a beat of 50 s the harmonics pass for the swing itself."""
    dense, gravity = record(recording={"sampling_rate": 20, "noise": 5e-6}, motion=[], duration=duration)
    made = with_harmonics(dense, 3e-6).isel(time=slice(None, None, 10))
    made["film"] = xr.DataTree(xr.Dataset())
    found = summaries(process(made, method="joint"))[0]
    assert abs(in_sigmas(found, gravity)) < 3.0
    fit = first_fits(gather(made))[0]
    row = mean_row(fit.solution, fit.model.problem.lattice.duration)
    doubt = doubt_by_repeating(fit, row) * gravity / 1e-5
    assert least < doubt < most
    assert doubt < found["gravity_sigma_mgal"]
