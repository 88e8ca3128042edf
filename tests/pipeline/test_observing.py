"""Records to observations: any traces that can give the difference do, exactly; what cannot is refused by name."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from made_records import changed, row, simulate

import synth
from data_schemas.errors import RecordError, RefusedError, UsageError
from data_schemas.scene import Scene
from pipeline import observe
from pipeline.observation import uniform_grid


def traces(*combinations: dict[str, float]) -> list[dict[str, object]]:
    return [{"name": f"t{k}", "combination": combination} for k, combination in enumerate(combinations)]


@pytest.fixture(scope="module")
def plain() -> tuple[xr.DataTree, xr.DataTree]:
    return simulate(duration=40.0)


WAYS = {
    "first and difference": [{"1": 1.0}, {"1": 1.0, "2": -1.0}],
    "both": [{"1": 1.0}, {"2": 1.0}],
    "both, other order": [{"2": 1.0}, {"1": 1.0}],
    "second and difference": [{"2": 1.0}, {"1": 1.0, "2": -1.0}],
    "sum and difference": [{"1": 1.0, "2": 1.0}, {"1": 1.0, "2": -1.0}],
    "scaled": [{"1": 2.0}, {"1": 0.5, "2": -0.5}],
    "more than needed": [{"1": 1.0}, {"2": 1.0}, {"1": 1.0, "2": -1.0}],
}


@pytest.mark.parametrize("way", WAYS)
def test_every_way_of_recording_gives_the_same_series(way: str, plain: tuple[xr.DataTree, xr.DataTree]) -> None:
    record, truth = simulate(duration=40.0, traces=traces(*WAYS[way]))
    seen = observe(record, "1-2")
    theta = truth["truth"]["theta"].values
    assert np.abs(seen.theta - theta[0]).max() < 1e-15
    assert np.abs(seen.difference - (theta[0] - theta[1])).max() < 1e-15
    assert (seen.first, seen.second) == ("1", "2")
    assert seen.frequency_reference == pytest.approx(observe(plain[0]).frequency_reference)


def test_noise_of_a_difference_that_is_formed_adds_up() -> None:
    record, _ = simulate(duration=40.0, noise=3e-5, traces=traces({"1": 1.0}, {"2": 1.0}))
    seen = observe(record)
    assert seen.sigma_theta == pytest.approx(3e-5)
    assert seen.sigma_difference == pytest.approx(3e-5 * np.sqrt(2.0))


def three(combinations: list[dict[str, float]]) -> tuple[xr.DataTree, xr.DataTree]:
    scene = {
        "record_id": "three",
        "duration": 30.0,
        "gravity": 9.8,
        "pendulums": [
            {"label": label, "period": period, "start": {"kind": "free", "amplitude": 0.01, "phase": phase}}
            for label, period, phase in (("a", 1.009, 0.1), ("b", 1.0095, 1.5), ("c", 1.0101, 3.0))
        ],
        "recording": {"sampling_rate": 10, "traces": traces(*combinations)},
    }
    return synth.simulate(Scene.model_validate(scene))


CHAIN = [{"a": 1.0}, {"a": 1.0, "b": -1.0}, {"b": 1.0, "c": -1.0}]


@pytest.mark.parametrize("first", "abc")
@pytest.mark.parametrize("second", "abc")
@pytest.mark.parametrize("combinations", [CHAIN, [{"a": 1.0}, {"b": 1.0}, {"c": 1.0}]])
def test_any_pair_of_three(first: str, second: str, combinations: list[dict[str, float]]) -> None:
    record, truth = three(combinations)
    if first == second:
        with pytest.raises(UsageError, match="a, b, c"):
            observe(record, f"{first}-{second}")
        return
    seen = observe(record, f"{first}-{second}")
    theta = dict(zip("abc", truth["truth"]["theta"].values, strict=True))
    assert np.abs(seen.theta - theta[first]).max() < 1e-14
    assert np.abs(seen.difference - (theta[first] - theta[second])).max() < 1e-14
    assert seen.frequency_reference == pytest.approx(2 * np.pi / np.array([PERIODS[first], PERIODS[second]]))


PERIODS = {"a": 1.009, "b": 1.0095, "c": 1.0101}


def test_the_default_pair_is_the_recorded_difference() -> None:
    record, _ = three([{"c": 1.0}, {"b": -1.0, "c": 1.0}, {"a": 1.0}])
    assert observe(record).first == "c"
    assert observe(record).second == "b"
    assert observe(three([{"b": 1.0}, {"c": 1.0}])[0], "b-c").first == "b"


@pytest.mark.parametrize(
    ("combinations", "pair", "named"),
    [
        ([{"a": 1.0, "b": -1.0}, {"b": 1.0, "c": -1.0}], None, "cannot give 'a'"),
        ([{"a": 1.0}, {"b": 1.0}], "a-c", "cannot give 'a-c'"),
        ([{"a": 1.0}, {"b": 1.0, "c": 1.0}], "b-c", "cannot give 'b'"),
    ],
)
def test_what_the_traces_cannot_give_is_refused(
    combinations: list[dict[str, float]], pair: str | None, named: str
) -> None:
    with pytest.raises(RecordError, match=named):
        observe(three(combinations)[0], pair)


@pytest.mark.parametrize("pair", ["1-3", "1", "", "1-1", "2-", "1_2"])
def test_a_pair_that_is_none_is_refused(pair: str, plain: tuple[xr.DataTree, xr.DataTree]) -> None:
    with pytest.raises(UsageError, match="A-B"):
        observe(plain[0], pair)


def test_missing_constants_are_named(plain: tuple[xr.DataTree, xr.DataTree]) -> None:
    record = plain[0]
    for name in ("period", "reference_gravity"):
        tree = record.copy(deep=True)
        tree["instrument"] = xr.DataTree(tree["instrument"].to_dataset(inherit=False).drop_vars(name))
        with pytest.raises(RecordError, match=f"instrument/{name}"):
            observe(tree)


def test_the_other_pair_gives_the_same_gravity() -> None:
    """1-2 and 2-1 are two differences of one record."""
    record, _ = simulate(duration=200.0, traces=traces({"1": 1.0}, {"2": 1.0}))
    for pair in ("1-2", "2-1"):
        assert (row(record, "projection", pair=pair)["gravity_m_s2"] - 9.8054321) * 1e5 == pytest.approx(0.0, abs=1e-5)


# grids ----------------------------------------------------------------------------------------------------------


def test_holes_become_missing_readings_on_the_grid() -> None:
    time = np.array([0.0, 0.1, 0.2, 0.5, 0.6])
    grid, step, series = uniform_grid(time, np.arange(10.0).reshape(2, 5))
    assert step == pytest.approx(0.1)
    assert grid == pytest.approx(np.arange(7) * 0.1)
    assert np.flatnonzero(np.isnan(series[0])).tolist() == [3, 4]
    assert series[1][[0, 1, 2, 5, 6]].tolist() == [5.0, 6.0, 7.0, 8.0, 9.0]


@pytest.mark.parametrize(("jitter", "uniform"), [(0.0, True), (2e-10, True), (1e-6, False), (0.01, False)])
def test_times_off_the_grid_are_refused(jitter: float, uniform: bool) -> None:
    random = np.random.default_rng(0)
    time = np.arange(500) * 0.04 + np.concatenate([[0.0], random.uniform(-jitter, jitter, 499)])
    series = np.ones((2, 500))
    if uniform:
        assert uniform_grid(time, series)[1] == pytest.approx(0.04)
        return
    with pytest.raises(RefusedError, match="uneven times; use --method joint"):
        uniform_grid(time, series)


def test_an_hour_of_a_ratio_that_is_no_decimal_lies_on_its_grid() -> None:
    time = np.arange(30_000) * (3.0 / 25.0) * (1.0 + 1e-13)
    keep = np.random.default_rng(1).random(30_000) > 0.2
    keep[:2] = keep[-1] = True
    grid, step, _ = uniform_grid(time[keep], np.ones((1, int(keep.sum()))))
    assert step == pytest.approx(0.12, rel=1e-10)
    assert grid.size == 30_000


def test_a_long_silence_makes_no_grid_of_millions() -> None:
    time = np.concatenate([np.arange(10) * 0.04, 1e6 + np.arange(10) * 0.04])
    with pytest.raises(RefusedError, match="uneven times"):
        uniform_grid(time, np.ones((1, 20)))


def test_stated_noise_by_sample_is_taken_in_the_mean(plain: tuple[xr.DataTree, xr.DataTree]) -> None:
    record = plain[0]
    count = record.sizes["time"] if "time" in record.sizes else record["time"].size
    sigma = np.full((2, count), 2e-5)
    sigma[0, ::2] = np.nan
    tree = changed(record, "record", "elongation_uncertainty", sigma, ("trace", "time"))
    assert observe(tree).sigma_difference == pytest.approx(2e-5)
    assert observe(tree).sigma_theta == pytest.approx(2e-5)
