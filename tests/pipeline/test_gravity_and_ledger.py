"""From frequency to gravity: ledger, chronometer, sensitivities and the uncertainty of the constants."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from made_records import GRAVITY, changed, row, simulate

from data_schemas.errors import UsageError
from pipeline import METHODS, process

PLAIN = [m for m in METHODS if m not in ("auto", "joint")]


@pytest.fixture(scope="module")
def record() -> xr.DataTree:
    tree, _ = simulate(eps=1e-3, duration=200.0, noise=1e-5, chronometer_rate=3.0, free=((0.012, 0.4), (0.009, 2.2)))
    return tree


def scaled(tree: xr.DataTree, relative: tuple[float, float]) -> xr.DataTree:
    """The periods of the instrument changed by a relative amount."""
    period = tree["instrument"]["period"].values
    return changed(tree, "instrument", "period", period * (1.0 + np.array(relative)), ("pendulum",))


@pytest.mark.parametrize("method", PLAIN)
def test_ledger_adds_up_to_gravity_less_the_uncorrected_value(record: xr.DataTree, method: str) -> None:
    result = process(record, method=[method, "uncorrected"])
    table = result["gravity"].dataset
    applied = table["applied"].values[0].astype(bool)
    total = float(table["value"].values[0][applied].sum())
    plain = 9.81 * (float(table["difference_frequency"].values[0]) / (2 * np.pi / 1.0097648)) ** 2
    # rounding of gravity: 1e-15 of 10 m/s2 is 1e-9 mGal
    assert total == pytest.approx((float(table["gravity"].values[0]) - plain) * 1e5, abs=1e-8)
    assert (table["value"].values[0][~applied] == 0.0).all()
    assert all(str(reason) for reason in table["reason"].values.ravel())


def test_a_losing_chronometer_makes_true_periods_longer() -> None:
    """T_true = T (1 + r/86400): 1 s a day is 22.7 mGal, and gravity comes out lower."""
    tree, _ = simulate(duration=120.0, motion=[])
    values = [
        row(changed(tree, "instrument", "chronometer_rate", rate), "projection")["gravity_m_s2"] for rate in (0.0, 1.0)
    ]
    assert (values[1] - values[0]) * 1e5 == pytest.approx(-22.7, abs=0.05)
    assert values[1] / values[0] == pytest.approx((1.0 + 1.0 / 86400.0) ** -2, rel=1e-12)


@pytest.mark.parametrize("rate", [-40.0, 25.0])
def test_the_simulated_clock_is_undone(rate: float) -> None:
    tree, _ = simulate(duration=200.0, chronometer_rate=rate)
    found = row(tree, "projection")
    assert (found["gravity_m_s2"] - GRAVITY) * 1e5 == pytest.approx(0.0, abs=1e-3)
    assert found["corrections_mgal"]["chronometer"] == pytest.approx(-22.7 * rate, rel=2e-3)


def test_a_half_period_longer_by_1e_7_seconds_is_0_388_milligal() -> None:
    """The old tables' unit at T/2 = 0.505 s."""
    tree, _ = simulate(duration=120.0, motion=[])
    low, high = (row(scaled(tree, (change, change)), "uncorrected")["gravity_m_s2"] for change in (0.0, 1e-7 / 0.505))
    assert (high - low) * 1e5 == pytest.approx(0.388, abs=0.001)


def test_gravity_is_the_square_of_the_second_frequency(record: xr.DataTree) -> None:
    found = row(record, "projection")
    n2 = found["frequency_rad_s"]["2"]
    assert found["gravity_m_s2"] == pytest.approx(9.81 * (n2 * 1.0097648 / (2 * np.pi)) ** 2, rel=1e-14)
    assert found["frequency_rad_s"]["1"] / n2 == pytest.approx(1.001, rel=1e-12)


def test_sensitivity_to_the_difference_of_frequencies(record: xr.DataTree) -> None:
    """(n1 - n2)/n2 larger by 1e-7: T1 shorter by 1e-7, done."""
    change = 1e-6  # more would be seen for an error of the record, and corrected
    low, high = (row(scaled(record, (d, 0.0)), "projection")["gravity_m_s2"] for d in (change, -change))
    told = row(record, "projection")["sensitivity_mgal"]["frequency_difference_1e-7"]
    assert abs(told) > 0.02
    assert told == pytest.approx((high - low) * 1e5 / (2 * change) * 1e-7, rel=0.02)


def test_sensitivity_to_the_gain_of_the_first_trace(record: xr.DataTree) -> None:
    values = record["record"]["elongation"].values
    found = [
        row(changed(record, "record", "elongation", values * np.array([[gain], [1.0]])), "projection")["gravity_m_s2"]
        for gain in (0.999, 1.001)
    ]
    told = row(record, "projection")["sensitivity_mgal"]["gain_1_percent"]
    assert abs(told) > 0.5
    assert told == pytest.approx((found[1] - found[0]) * 1e5 / 0.002 * 0.01, rel=0.02)


def test_gain_uncertainty_enters_sigma(record: xr.DataTree) -> None:
    plain, wide = row(record, "projection"), row(record, "projection", gain_uncertainty=0.02)
    added = 2.0 * abs(plain["sensitivity_mgal"]["gain_1_percent"])
    assert wide["gravity_sigma_mgal"] == pytest.approx(np.hypot(plain["gravity_sigma_mgal"], added), rel=1e-6)
    for bad in (-0.1, float("nan")):
        with pytest.raises(UsageError, match="gain_uncertainty"):
            process(record, gain_uncertainty=bad)


@pytest.mark.parametrize("uncertainty", [(3e-7, 0.0), (0.0, 3e-7), (2e-7, 4e-7)])
def test_uncertainty_of_the_periods_against_monte_carlo(record: xr.DataTree, uncertainty: tuple[float, float]) -> None:
    """Periods drawn about the stated ones, relative; the response is linear, so one slope each makes the draw."""
    base = row(record, "projection")["gravity_m_s2"]
    step = 1e-6
    slopes = [
        (row(scaled(record, (step * (k == 0), step * (k == 1))), "projection")["gravity_m_s2"] - base) / step
        for k in (0, 1)
    ]
    random = np.random.default_rng(3)
    draws = random.normal(size=(20_000, 2)) * np.array(uncertainty) @ np.array(slopes)
    period = record["instrument"]["period"].values
    stated = changed(record, "instrument", "period_uncertainty", period * np.array(uncertainty), ("pendulum",))
    told = row(stated, "projection")["gravity_sigma_mgal"]
    noise = row(record, "projection")["gravity_sigma_mgal"]
    # 20 000 draws know a deviation to 0.5 %; the budget takes its sensitivity from 4 s blocks
    assert np.sqrt(told**2 - noise**2) == pytest.approx(draws.std() * 1e5, rel=0.03)


def test_unknown_methods_are_refused_with_the_nearest_name(record: xr.DataTree) -> None:
    with pytest.raises(UsageError, match="did you mean 'panteleev'"):
        process(record, method="pantelev")
    with pytest.raises(UsageError, match="choose from"):
        process(record, method="xyzzy")
