"""Base stations before and after: drift, misclosure, and what a wandering drift may have done in between."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from ledger_records import BASES, GRAVITY, PERIOD, entry, error, row, scene, with_stated

import synth
from pipeline.conditions import tie

DAY = 86400.0


def stations(times: list[float], periods: list[float], **more: Any) -> dict[str, Any]:
    """Occupations of one station; pendulum 1 as pendulum 2 but 1e-4 faster."""
    both = np.array(periods)[:, None] * np.array([1.0 / 1.0001, 1.0])
    return {"base_time": np.array(times), "base_gravity": np.full(len(times), 9.81), "base_period": both} | more


def test_between_two_occupations_the_period_is_on_their_line() -> None:
    found = tie(stations([-4 * DAY, 6 * DAY], [1.0, 1.0 + 1e-6]), 0.0, 9.81)
    assert found is not None
    assert found.fraction == pytest.approx(0.4)
    np.testing.assert_allclose(found.period, [(1.0 + 4e-7) / 1.0001, 1.0 + 4e-7], rtol=1e-15)
    # dg/g = 2 dT/T
    assert found.misclosure == pytest.approx(2 * 9.81e5 * 1e-6, rel=1e-6)


def test_of_several_occupations_the_neighbours_count() -> None:
    times, periods = [-20 * DAY, -DAY, DAY, 30 * DAY], [2.0, 1.0, 1.0 + 2e-7, 3.0]
    found = tie(stations(times, periods), 0.0, 9.81)
    assert found is not None
    assert found.period[1] == pytest.approx(1.0 + 1e-7, rel=1e-14)
    shuffled = [times[k] for k in (2, 0, 3, 1)], [periods[k] for k in (2, 0, 3, 1)]
    again = tie(stations(*shuffled), 0.0, 9.81)
    assert again is not None
    np.testing.assert_array_equal(again.period, found.period)


@pytest.mark.parametrize("times", [[-3 * DAY, -DAY], [DAY, 3 * DAY]])
def test_with_bases_on_one_side_the_nearest_holds(times: list[float]) -> None:
    found = tie(stations(times, [1.0, 1.5]), 0.0, 9.81)
    assert found is not None
    assert found.period[1] == (1.5 if times[0] < 0 else 1.0)
    assert np.isnan(found.misclosure)
    assert not found.stated


def test_stations_of_other_gravity_are_brought_to_the_reference() -> None:
    """The same pendulum at a station of more gravity swings faster; the tie must not see it."""
    gravity = np.array([9.79, 9.83])
    periods = 1.0 * np.sqrt(9.81 / gravity)
    found = tie(stations([-DAY, DAY], list(periods), base_gravity=gravity), 0.0, 9.81)
    assert found is not None
    assert found.period[1] == pytest.approx(1.0, rel=1e-14)
    assert found.misclosure == pytest.approx(0.0, abs=1e-9)


def test_a_wandering_drift_departs_from_the_line_as_told() -> None:
    """Random walks from one base to the other: rms departure at f over rms misclosure is sqrt(f (1 - f))."""
    random = np.random.default_rng(8)
    walks = np.cumsum(random.normal(size=(4000, 100)), axis=1)
    for step in (20, 50, 90):
        fraction = step / 100.0
        off = walks[:, step - 1] - fraction * walks[:, -1]
        expected = np.sqrt(np.mean(walks[:, -1] ** 2) * fraction * (1.0 - fraction))
        # 4000 walks know a deviation to 1.1 %
        assert np.sqrt(np.mean(off**2)) == pytest.approx(expected, rel=0.05)
    found = tie(stations([-2 * DAY, 8 * DAY], [1.0, 1.0 + 1e-6]), 0.0, 9.81)
    assert found is not None
    assert found.relative_uncertainty[1] == pytest.approx(1e-6 * np.sqrt(0.2 * 0.8), rel=1e-5)


def test_uncertainties_of_the_occupations_against_monte_carlo() -> None:
    """Without drift: periods of 2 and 5e-8 s, a third of the way."""
    sigma = np.array([[2e-8, 2e-8], [5e-8, 5e-8]])
    found = tie(stations([-DAY, 2 * DAY], [1.0, 1.0], base_period_uncertainty=sigma), 0.0, 9.81)
    assert found is not None
    random = np.random.default_rng(2)
    periods = 1.0 + random.normal(size=(20_000, 2)) * sigma[:, 1]
    spread = np.std(periods @ [2 / 3, 1 / 3])
    # 20 000 draws know a deviation to 0.5 %
    assert found.relative_uncertainty[1] == pytest.approx(spread, rel=0.02)
    assert found.misclosure_uncertainty == pytest.approx(2 * 9.81e5 * np.hypot(2e-8, 5e-8), rel=1e-6)


def test_one_station_errs_alike_before_and_after_two_do_not() -> None:
    sigma = {"base_gravity_uncertainty": np.array([3e-7, 3e-7])}
    same = tie(stations([-DAY, DAY], [1.0, 1.0], **sigma), 0.0, 9.81)
    other = tie(stations([-DAY, DAY], [1.0, 1.0], **sigma, base_gravity=np.array([9.81, 9.82])), 0.0, 9.81)
    assert same is not None
    assert other is not None
    assert same.gravity_uncertainty == pytest.approx(3e-7)
    assert other.gravity_uncertainty == pytest.approx(3e-7 / np.sqrt(2))


def test_a_drift_that_a_scene_makes_is_undone() -> None:
    """Pendulums that drift unlike since a base ten days ago: n1/n2 too comes from the tie."""
    bases = [
        {"label": "before", "time": -10 * DAY, "gravity": 9.8062},
        {"label": "after", "time": 15 * DAY, "gravity": 9.8062},
    ]
    drift = {"first": {"drift": 4e-7}, "second": {"drift": 3e-7}}
    made = scene({"bases": bases}, duration=400.0, **drift)
    # what is left is the drift within the record, which a scene takes at its middle
    assert error(made) == pytest.approx(0.0, abs=1e-3)
    late = scene({"bases": [{"label": "before", "time": 20 * DAY, "gravity": 9.8062}]}, **drift)
    # held from a base twenty days off: 20 x 3e-7 s wrong, and n1/n2 with it
    assert abs(error(late)) > 10.0


def test_a_tie_takes_the_place_of_the_stated_period() -> None:
    """A wrong instrument/period does not matter where there are bases; nor does its uncertainty."""
    record, _ = synth.simulate(scene(duration=120.0))
    period = record["instrument"]["period"].values
    tied = with_stated(record, BASES | {"base_period": np.stack([period, period])})
    wrong = with_stated(tied, {"period": period * (1.0 + np.array([3e-5, 2e-5])), "period_uncertainty": period * 1e-4})
    right = row(tied)
    found = row(wrong)
    assert (found["gravity_m_s2"] - right["gravity_m_s2"]) * 1e5 == pytest.approx(0.0, abs=1e-5)
    assert found["gravity_sigma_mgal"] == pytest.approx(right["gravity_sigma_mgal"], abs=1e-6)
    assert entry(found, "base_tie")["value_mgal"] == pytest.approx(-2 * GRAVITY * 2e-5 * 1e5, rel=1e-3)


def test_without_bases_the_period_counts_with_its_own_uncertainty() -> None:
    record, _ = synth.simulate(scene(duration=120.0))
    listed = entry(row(with_stated(record, {"period_uncertainty": [0.0, PERIOD * 1e-7]})), "base_tie")
    assert not listed["applied"]
    # the uncertainty of T2 alone: 2 g 1e-7, and through n1/n2 as much as the sensitivity says
    per_ratio = row(record)["sensitivity_mgal"]["frequency_difference_1e-7"]
    assert listed["sigma_mgal"] == pytest.approx(abs(2 * GRAVITY * 1e-7 * 1e5 + per_ratio), rel=1e-3)


def test_the_misclosure_is_told() -> None:
    record, _ = synth.simulate(scene(duration=120.0))
    period = record["instrument"]["period"].values
    stated = BASES | {
        "base_period": np.stack([period, period + 1e-6]),
        "base_period_uncertainty": np.full((2, 2), 1e-7),
    }
    reason = entry(row(with_stated(record, stated)), "base_tie")["reason"]
    assert "misclosure +1.943 +- 0.275 mGal, record at 33 % of the way" in reason
    one = {name: value[:1] for name, value in stated.items()}
    assert "one side of the record only" in entry(row(with_stated(record, one)), "base_tie")["reason"]
