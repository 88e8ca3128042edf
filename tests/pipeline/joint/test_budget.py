"""What gravity's variance is made of, what the ledger says of the apparatus, and constants that the record states."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import xarray as xr

from data_schemas.variables import attributes
from pipeline import process
from pipeline.benchmarks.kinds import Case
from pipeline.benchmarks.records import Made, of_case
from pipeline.joint import budget, kinds
from pipeline.joint.fit import reduce
from pipeline.joint.gather import gather

pytestmark = pytest.mark.compiled
SHORT = Case(duration=300.0, noise=3e-5)


def made(seed: int = 5, **changes: Any) -> Made:
    return of_case(replace(SHORT, **changes), np.random.default_rng(seed), "budget")


def stating(tree: xr.DataTree, **values: Any) -> xr.DataTree:
    """A record whose instrument states more; a list of two belongs to traces but for periods and damping."""
    tree = tree.copy(deep=True)
    stored = tree["instrument"].to_dataset(inherit=False)
    for name, value in values.items():
        per = "pendulum" if name.startswith(("period", "damping")) else "trace"
        stored[name] = ((per,) if np.ndim(value) else (), np.asarray(value), attributes(f"instrument/{name}"))
        if np.ndim(value) and per == "trace":
            stored = stored.assign_coords(trace=tree["record/trace"].values)
    attrs = tree["instrument"].attrs
    tree["instrument"] = xr.DataTree(stored)
    tree["instrument"].attrs.update(attrs)
    return tree


def entry(result: xr.DataTree, name: str) -> float:
    return float(result["gravity"].dataset["value"].sel(entry=name)[0])


def sigma(result: xr.DataTree) -> float:
    return float(result["gravity/gravity_sigma"][0])


def test_shares_of_independent_sources_add_up() -> None:
    """The variance is of the first degree in all variances: what the ship brings is what the others leave."""
    fit = reduce(gather(made(kicks=(1e-6, 1e-6), states_scale=1e-3).tree)).fit
    found = budget.shares(fit, 0.0)
    assert sum(found.values()) == pytest.approx(1.0)
    row = budget.mean_row(fit.solution, 300.0)
    own = float(row @ fit.solution.covariance @ row)
    assumed = fit.model.assumed
    rougher = replace(assumed, ship=tuple(replace(each, rms=1.1 * each.rms) for each in assumed.ship))
    ship = budget._of_noise(fit, row, own, rougher) / own
    assert found["heave"] == pytest.approx(ship, abs=0.02)
    assert found["kicks"] > 0.5


def test_uncertain_periods_are_in_sigma_and_lead_the_budget() -> None:
    """Gravity follows the mean of two independent periods: 2 g dT/T/sqrt(2)."""
    record = made()
    plain, unsure = process(record.tree), process(stating(record.tree, period_uncertainty=[1e-6, 1e-6]))
    expected = 9.81e5 * 2.0 * 1e-6 / np.sqrt(2.0)
    assert np.sqrt(sigma(unsure) ** 2 - sigma(plain) ** 2) == pytest.approx(expected, rel=0.1)
    shares = unsure["gravity/share"].sel(source="ratio")
    assert float(shares[0]) > 0.9
    assert str(unsure["gravity/advice"].values[0]).startswith("to halve sigma, make the uncertainty of ratio 2")


def test_zero_that_is_found_stands_in_the_ledger() -> None:
    """-g b^2/2 is what a reduction errs by that takes a zero for the vertical (physics 1.4): 3 mrad, 4.41 mGal."""
    result = process(made(zero_first=3e-3).tree)
    assert entry(result, "zero") == pytest.approx(4.41, abs=0.02)
    total = float(result["gravity/value"][0].sum())
    assert total == pytest.approx(
        float(result["gravity/gravity"][0] - result["gravity/uncorrected"][0]) * 1e5, abs=1e-6
    )


def test_case_tilt_and_acceleration_share_brownes_term() -> None:
    """1 degree of tilt beside a sway of its own: g <p^2>/2 = 74.7 mGal less twice their product."""
    level, tilted = process(made().tree), process(made(tilt=1.0).tree)
    whole = entry(tilted, "case_tilt") + entry(tilted, "horizontal_acceleration")
    assert whole == pytest.approx(entry(level, "horizontal_acceleration"), abs=0.05)
    assert entry(tilted, "case_tilt") == pytest.approx(0.25 * 9.81e5 * np.radians(1.0) ** 2, rel=0.05)


def test_clock_step_that_is_found_stands_in_the_ledger() -> None:
    result = process(made(clock_step=0.01, noise=1e-5).tree)
    slow = 9.81e5 * 2.0 * 0.01 / 300.0 * 1.5  # of a slope by least squares, a step in the middle counts by half more
    assert abs(entry(result, "clock_steps")) == pytest.approx(slow, rel=0.15)


@pytest.mark.parametrize(
    ("kind", "stated", "index"),
    [
        (kinds.ZERO, {"zero": [1e-3, 2e-3], "zero_uncertainty": [1e-4, 2e-4]}, 1),
        (kinds.ZERO, {"zero": 2e-3, "zero_uncertainty": 2e-4}, 1),
        (kinds.GAIN, {"scale": 2e-3, "scale_uncertainty": 2e-4}, -1),
        (kinds.GAIN, {"scale": [0.0, 2e-3], "scale_uncertainty": [1e-4, 2e-4]}, 1),
        (kinds.DELAY, {"delay": [0.0, 2e-3], "delay_uncertainty": [1e-5, 2e-4]}, 1),
        (kinds.RATIO, {"period_uncertainty": [1e-6, 1e-4]}, 1),
        (kinds.DAMPING, {"damping_rate_uncertainty": [1e-6, 2e-4]}, 1),
    ],
)
def test_stated_constants_become_priors(kind: int, stated: dict[str, Any], index: int) -> None:
    fit = reduce(gather(stating(made().tree, **stated))).fit
    (found,) = [each for each in fit.model.constants if (each.kind, each.index) == (kind, index)]
    assert found.stated
    assert found.prior == pytest.approx(2e-4, rel=0.1)
    assert found.mean == (2e-3 if kind < kinds.CLOCK and kind not in (kinds.RATIO, kinds.DAMPING) else 0.0)


def test_uncertainty_of_a_scale_is_what_a_change_of_it_does() -> None:
    record = made(noise=1e-5)
    larger = record.tree.copy(deep=True)
    larger["record"] = larger["record"].assign(elongation=1.01 * larger["record/elongation"])
    plain, changed = process(record.tree), process(larger)
    unsure = process(stating(record.tree, scale_uncertainty=0.01))
    change = float(changed["gravity/gravity"][0] - plain["gravity/gravity"][0]) * 1e5
    # the arcs tell it a little
    assert np.sqrt(sigma(unsure) ** 2 - sigma(plain) ** 2) == pytest.approx(abs(change), rel=0.3)
