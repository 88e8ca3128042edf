"""Bars of the joint fit: what a record gives, and the rows that many give."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pipeline.benchmarks import bars_joint
from pipeline.benchmarks.bars_joint import BASE, Fit
from pipeline.benchmarks.honesty.records import of_case


@pytest.mark.compiled
def test_a_record_gives_error_sigma_and_band() -> None:
    random = np.random.default_rng(3)
    made = of_case(replace(BASE, duration=300.0, states_heave=False, swell=(0.015, 0.0)), random, "one")
    fit = bars_joint.fitted(made)
    assert abs(fit.error) < 4.0 * fit.sigma
    assert fit.seconds > 0.0
    assert fit.band < 4.0
    short = of_case(replace(BASE, duration=5.0), random, "short")
    assert bars_joint.fitted(short).error == np.inf


@pytest.mark.compiled
def test_cost_is_compared_with_a_chain_of_scipy(monkeypatch: pytest.MonkeyPatch) -> None:
    case = replace(BASE, duration=120.0, swell=(0.015, 0.0), states_heave=False)
    monkeypatch.setattr(bars_joint, "SPEEDS", {"short": (case, 1e6, 0.0)})
    one, whole, seconds = bars_joint._cost(1)
    assert (one["pass"], whole["pass"], seconds["pass"]) == (True, False, None)
    assert 0.0 < one["value"] < whole["value"]


@pytest.mark.compiled
@pytest.mark.usefixtures("short")
def test_scatter_is_compared_with_the_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bars_joint, "RATES", (10,))
    found = []
    for bound in (0.05, 0.1):
        monkeypatch.setattr(bars_joint, "BOUNDS", {"linear": (bound,), "real": (2.0 * bound,)})
        rows = list(bars_joint._efficiency(2))
        assert ["linear" in row["bar"] for row in rows] == [True, False]
        found.append([row["value"] for row in rows])
    assert np.all(np.isfinite(found))
    assert found[0] == pytest.approx(2.0 * np.array(found[1]))


def test_rows_name_what_does_not_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    def campaign(name: str, case: Any, count: int) -> list[Fit]:
        error = float("inf") if name == "one gap of 300 s" else 0.01
        return [Fit(error, 0.01, 1.0, 1.0)] * count

    monkeypatch.setattr(bars_joint, "campaign", campaign)
    monkeypatch.setattr(bars_joint, "_cost", lambda repeats: iter(()))
    rows = list(bars_joint.rows(quick=True))
    assert [row["bar"] for row in rows if not row["pass"]] == ["joint, one gap of 300 s: rms z of 8"]
    assert len({row["bar"] for row in rows}) == len(rows)
