"""What every result holds of phases, corrections and residual: laws between them, and the simulator's truth."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from made_records import RESONANT, SWELL, changed, row, simulate

import data_schemas
from pipeline import process

REAL = {"damping": (1e-4, 1e-4), "motion": [SWELL, RESONANT], "noise": 1e-5}
METHODS = ["projection", "general", "panteleev", "vening-meinesz", "uncorrected"]


@pytest.fixture(scope="module")
def made():
    record, truth = simulate(**REAL)
    return process(record, method=METHODS, full=True), record, truth


def values(result: xr.DataTree, group: str, name: str) -> np.ndarray:
    return np.asarray(result[group].dataset[name].values)


def test_all_is_finite_and_conforms(made) -> None:
    result = made[0]
    assert data_schemas.check(result, "result") == []
    assert next(iter(result.children)) == "gravity"
    for name, variable in result["phases"].dataset.data_vars.items():
        assert np.isfinite(variable.values).all(), name


def test_stored_speeds_are_the_derivatives_of_stored_phases(made) -> None:
    result = made[0]
    time = np.asarray(result["time"].values)
    speeds = values(result, "correction", "phase_speed_correction")
    np.testing.assert_allclose(
        np.gradient(values(result, "correction", "phase_correction"), time, axis=1), speeds, rtol=0, atol=1e-12
    )
    parts = sum(values(result, "correction", name) for name in ("non_isochronism", "arc", "acceleration"))
    np.testing.assert_allclose(parts, speeds, rtol=0, atol=1e-12)
    measured = np.gradient(values(result, "phases", "phase"), time, axis=1)
    np.testing.assert_allclose(measured, values(result, "phases", "phase_speed"), rtol=0, atol=1e-12)
    corrected = values(result, "correction", "corrected_phase_speed")
    np.testing.assert_allclose(corrected, measured[2] + speeds, rtol=0, atol=1e-9)


@pytest.mark.parametrize("method", ["general", "panteleev", "uncorrected"])
def test_under_the_parabola_of_a_slope_the_corrected_speed_is_the_gravity(made, method: str) -> None:
    result = made[0]
    k = list(values(result, "correction", "estimator")).index(method)
    time = np.asarray(result["time"].values)
    parabola = 1.0 - (2.0 * (time - time.mean()) / (time[-1] - time[0])) ** 2
    # a parabola is the weight of a regression whose weights are equal; the method weighs by a^2
    mean = np.average(values(result, "correction", "corrected_gravity")[k], weights=parabola)
    sigma = float(values(result, "gravity", "gravity_sigma")[k])
    assert abs(mean - values(result, "gravity", "gravity")[k]) / 1e-5 < max(sigma, 0.01)


def test_the_fictitious_pendulum_is_that_of_the_true_motion() -> None:
    from scipy.interpolate import CubicSpline

    record, truth = simulate(eps=1e-3, motion=[SWELL])
    result = process(record, method=["projection"])
    time, known = np.asarray(result["time"].values), truth["truth"].dataset
    theta = CubicSpline(truth["time"].values, known["theta"].values, axis=1)
    own = known["frequency"].values[:, None]
    raw = theta(time) - 1j * theta(time, 1) / own
    fictitious = raw[0] - own[0] / own[1] * raw[1]
    np.testing.assert_allclose(values(result, "phases", "fictitious_amplitude"), np.abs(fictitious), rtol=1e-3)
    turned = np.exp(1j * values(result, "phases", "fictitious_phase"))
    assert np.abs(turned - fictitious / np.abs(fictitious)).max() < 1e-3
    # (9) on it, exact: z' = i n1 (z1 - z2); as practised the slow motion leaks in, which (27) has not
    speed = (1j * own[0] * (raw[0] - raw[1]) / fictitious).imag
    formula = values(result, "phases", "phase_speed_by_formula")
    np.testing.assert_allclose(formula[0], speed, atol=1e-4)
    assert np.std(formula[1] - formula[2]) > 0.01


def test_pendulums_and_their_difference_fit_together(made) -> None:
    result = made[0]
    amplitude, phase, slow, sigma, by_phase = (
        values(result, "phases", name) for name in ("amplitude", "phase", "slow", "amplitude_sigma", "phase_sigma")
    )
    first, second, difference = amplitude * np.exp(1j * phase)
    np.testing.assert_allclose(first - second, difference, atol=1e-15)
    np.testing.assert_allclose(slow[0] - slow[1], slow[2], atol=1e-15)
    sigma = np.broadcast_to(sigma.reshape(3, -1), amplitude.shape)
    np.testing.assert_allclose(by_phase * amplitude, sigma, rtol=1e-12)
    np.testing.assert_allclose(sigma[1], np.hypot(sigma[0], sigma[2]), rtol=1e-12)


def test_36_and_38_are_one_identity(made) -> None:
    """Fed with the same speeds of two pendulums they give the same of the difference; near the measured one."""
    formula = values(made[0], "phases", "phase_speed_by_formula")
    np.testing.assert_allclose(formula[3], formula[4], rtol=0, atol=1e-12)
    measured = values(made[0], "phases", "phase_speed")[2]
    assert np.abs(np.mean(formula[4] - measured)) < 2e-5


def test_the_amplitude_changes_as_27_says() -> None:
    result = process(simulate(**REAL | {"noise": 0.0})[0], method="projection")
    measured, by_27 = (values(result, "phases", name) for name in ("amplitude_rate", "amplitude_rate_by_27"))
    assert np.std(measured - by_27) < 0.05 * np.std(by_27)


def test_the_residual_is_the_reading_noise(made) -> None:
    result, record, _ = made
    group = result["difference"].dataset
    np.testing.assert_array_equal(group["record_time"].values, record["time"].values)
    residual = group["residual"].values
    fitted = np.isfinite(residual)  # windows of the harmonic do not reach the ends
    assert fitted.mean() > 0.9
    whole = group["model"].values + residual
    np.testing.assert_allclose(whole[fitted], group["elongation"].values[fitted], atol=1e-15)
    noise = np.nanstd(residual)
    assert noise == pytest.approx(1e-5, rel=0.15)
    frequency, power = (values(result, "spectrum", name) for name in ("frequency", "residual_spectrum"))
    assert np.trapezoid(power, frequency) == pytest.approx(noise**2, rel=0.1)


def test_the_difference_of_identical_pendulums_has_no_fictitious_one() -> None:
    found = row(simulate(eps=0.0)[0], "vening-meinesz")
    assert found["status"] == "refused"
    assert "same period" in found["error"]


def test_numbers_have_a_digest_of_their_own(made) -> None:
    result, record, _ = made
    again = process(record, method=METHODS, full=True)
    assert again.attrs["numbers_sha256"] == result.attrs["numbers_sha256"]
    noisier = changed(record, "record", "elongation", record["record"]["elongation"].values * (1.0 + 1e-9))
    assert process(noisier, method=METHODS, full=True).attrs["numbers_sha256"] != result.attrs["numbers_sha256"]


@pytest.mark.compiled
def test_the_joint_fit_gives_the_ship_and_the_pendulums() -> None:
    record, truth = simulate(**REAL)
    result = process(record, full=True)
    time = np.asarray(result["time"].values)
    for name in ("horizontal_acceleration",):
        known = np.interp(time, truth["time"].values, truth["truth"][name].values)
        assert np.std(values(result, "ship", name) - known) < 0.05 * np.std(known)
    theta = values(result, "pendulums", "theta")
    sampled = [np.interp(record["time"].values, truth["time"].values, each) for each in truth["truth"]["theta"].values]
    assert np.abs(theta - sampled).max() < 5e-5
    assert np.std(result["difference"]["residual"].values) == pytest.approx(1e-5, rel=0.1)
