"""Each defect of a recording alone, against the perfect record of the same scene."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from data_schemas import check
from data_schemas.scene import Scene
from synth import simulate

Maker = Callable[..., Scene]


def _elongation(scene: Scene) -> np.ndarray:
    record, _ = simulate(scene)
    assert check(record, "record") == []
    return record["record/elongation"].values


@pytest.fixture
def error(make_scene: Maker) -> Callable[..., np.ndarray]:
    """What a defect does to the readings."""

    def difference(**recording: Any) -> np.ndarray:
        return _elongation(make_scene(recording=recording)) - _elongation(make_scene())

    return difference


def test_perfect_traces_are_the_combination(make_scene: Maker) -> None:
    record, truth = simulate(make_scene())
    theta = truth["truth/theta"].values
    np.testing.assert_allclose(record["record/elongation"].values, [theta[0], theta[0] - theta[1]], rtol=0, atol=1e-18)
    assert "elongation_uncertainty" not in record["record"]
    assert "elongation_qc" not in record["record"]


def test_any_combination(make_scene: Maker) -> None:
    traces = [{"name": "mean", "combination": {"1": 0.5, "2": 0.5}}, {"name": "b", "combination": {"2": -2}}]
    record, truth = simulate(make_scene(recording={"traces": traces}))
    theta = truth["truth/theta"].values
    assert record["record/trace"].values.tolist() == ["mean", "b"]
    np.testing.assert_array_equal(record["record/combination"].values, [[0.5, 0.5], [0, -2]])
    np.testing.assert_allclose(record["record/elongation"].values, [theta.mean(0), -2 * theta[1]], rtol=0, atol=1e-17)


@pytest.mark.parametrize(("labels", "traces"), [("a", ["a"]), ("abc", ["a", "a-b", "b-c"])])
def test_default_traces_of_other_numbers_of_pendulums(make_scene: Maker, labels: str, traces: list[str]) -> None:
    start = {"kind": "free", "amplitude": 0.01}
    pendulums = [{"label": each, "period": 1 + 0.001 * k, "start": start} for k, each in enumerate(labels)]
    record, truth = simulate(make_scene(pendulums=pendulums))
    assert check(record, "record") == []
    assert check(truth, "truth") == []
    assert record["record/trace"].values.tolist() == traces


def test_white_noise(make_scene: Maker, error: Callable[..., np.ndarray]) -> None:
    noise = error(noise=2e-5)
    # 1000 readings: the deviation is known to 1/sqrt(2000) = 2.2 %, correlations to 3.2 %; four sigma
    np.testing.assert_allclose(noise.std(axis=1), 2e-5, rtol=0.09)
    assert abs(np.corrcoef(noise)[0, 1]) < 0.13
    assert abs(np.corrcoef(noise[0, 1:], noise[0, :-1])[0, 1]) < 0.13
    record, _ = simulate(make_scene(recording={"noise": 2e-5}))
    np.testing.assert_array_equal(record["record/elongation_uncertainty"].values, [2e-5, 2e-5])


@pytest.mark.parametrize(("stated", "noise"), [(True, 0.0), (False, 2e-5)])
def test_uncertainty_is_stated_on_demand(make_scene: Maker, stated: bool, noise: float) -> None:
    record, _ = simulate(make_scene(recording={"noise": noise, "record_uncertainty": stated}))
    assert ("elongation_uncertainty" in record["record"]) == stated


def test_quantisation(make_scene: Maker, error: Callable[..., np.ndarray]) -> None:
    step = 1e-4
    off = error(quantisation=step)
    assert np.max(np.abs(off)) <= step / 2 * (1 + 1e-9)
    assert off.std() == pytest.approx(step / np.sqrt(12), rel=0.1)
    readings = _elongation(make_scene(recording={"quantisation": step})) / step
    np.testing.assert_allclose(readings, np.rint(readings), rtol=0, atol=1e-9)


def test_outliers(error: Callable[..., np.ndarray]) -> None:
    off = error(outliers=7, outlier_amplitude=0.01)
    assert np.count_nonzero(off, axis=1).tolist() == [7, 7]
    np.testing.assert_allclose(np.abs(off[off != 0]), 0.01, rtol=1e-12)


def test_gaps_at_marks(make_scene: Maker, error: Callable[..., np.ndarray]) -> None:
    lost = np.isnan(error(mark_gap=1.5, gap_interval=10.0))
    expected = (np.arange(1000) * 0.04) % 10 < 1.5
    assert np.array_equal(lost, [expected, expected])
    record, _ = simulate(make_scene(recording={"mark_gap": 1.5, "gap_interval": 10.0}))
    flags = record["record/elongation_qc"].values
    assert np.all(flags[lost] == 9)  # gap and time_mark
    assert np.all(flags[~lost] == 0)


def test_the_reading_at_the_end_of_a_gap_stands(make_scene: Maker) -> None:
    recording = {"mark_gap": 2.0, "gap_interval": 8.0, "sampling_rate": 4}  # all exact in binary
    lost = np.isnan(_elongation(make_scene(recording=recording)))
    assert np.flatnonzero(lost[0]).tolist() == [k for k in range(160) if k % 32 < 8]


def test_missing_stretches(error: Callable[..., np.ndarray]) -> None:
    lost = np.isnan(error(missing=[[4.0, 6.0], {"start": 30.0, "stop": 99.0}]))
    seconds = np.arange(1000) * 0.04
    assert np.array_equal(lost[1], ((seconds >= 4) & (seconds < 6)) | (seconds >= 30))


def test_single_missing_readings(error: Callable[..., np.ndarray]) -> None:
    lost = np.isnan(error(missing_samples=50))
    assert lost.sum(axis=1).tolist() == [50, 50]
    assert not np.array_equal(lost[0], lost[1])


def test_chronometer(make_scene: Maker) -> None:
    """The record of a losing clock is the same motion, each reading a little later than the clock says."""
    slow, truth = simulate(make_scene(recording={"chronometer_rate": 8640.0 / 10}))
    true, _ = simulate(make_scene(duration=41.0, recording={"sampling_rate": 100}))
    seconds = np.arange(1000) * 0.04 * 1.01
    at_those = np.interp(seconds, true["time"].values, true["record/elongation"].values[0])
    # linear interpolation over 10 ms: (0.01 n)^2/8 of 20 mrad
    np.testing.assert_allclose(slow["record/elongation"].values[0], at_those, rtol=0, atol=2e-5)
    assert slow["instrument/chronometer_rate"].item() == 864.0
    assert slow["instrument/chronometer_rate"].attrs["units"] == "s day-1"
    assert truth["truth/mark_time"].values.tolist() == [0.0]


def test_what_the_record_says_of_the_instrument(make_scene: Maker) -> None:
    record, _ = simulate(make_scene())
    silent, _ = simulate(make_scene(recording={"write_damping": False, "write_restoring": False}))
    assert record["instrument"].attrs == {"restoring": "linear"}
    assert record["instrument/damping_rate"].values.tolist() == [0.0, 1e-3]
    assert record["instrument/period"].values.tolist() == [1.00966, 1.00976]
    assert silent["instrument"].attrs == {}
    assert "damping_rate" not in silent["instrument"]


def test_a_further_defect_changes_no_other(make_scene: Maker) -> None:
    """Chance is drawn by name: the noise stays when a sea, outliers or another trace are added."""
    sea = {"kind": "sea", "significant_height": 3.0, "peak_period": 10.0, "depth": 30.0}
    quiet, noisy = ({"noise": size, "outliers": 5, "outlier_amplitude": 0.1} for size in (0.0, 2e-5))
    alone = _elongation(make_scene(recording={"noise": 2e-5})) - _elongation(make_scene())
    beside = _elongation(make_scene(recording=noisy, motion=[sea])) - _elongation(
        make_scene(recording=quiet, motion=[sea])
    )
    np.testing.assert_allclose(beside, alone, rtol=0, atol=1e-16)
