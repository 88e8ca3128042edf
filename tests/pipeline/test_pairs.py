"""Three pendulums: two fictitious ones, weighed as their covariance says."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import xarray as xr

import synth
from data_schemas import check
from data_schemas.scene import Scene
from pipeline import process, summaries
from pipeline.pairs import join, joined, neighbours

GRAVITY = 9.8123
SINGLE = [{"name": label, "combination": {label: 1}} for label in "123"]


def record(seed: int = 3, noise: float = 1e-4, duration: float = 300.0, traces: Any = None) -> xr.DataTree:
    pendulums = [
        {"label": label, "period": period, "damping_rate": 1e-4, "start": {"kind": "free", "amplitude": a, "phase": f}}
        for label, period, a, f in (("1", 1.01, 0.010, 0.4), ("2", 1.0101, 0.012, 2.2), ("3", 1.01005, 0.011, 4.1))
    ]
    scene = {
        "record_id": "three",
        "seed": seed,
        "duration": duration,
        "gravity": GRAVITY,
        "pendulums": pendulums,
        "motion": [{"kind": "harmonics", "amplitude": [0.05], "period": [9.0]}],
        "recording": {"sampling_rate": 10, "noise": noise} | ({"traces": traces} if traces else {}),
    }
    return synth.simulate(Scene.model_validate(scene))[0]


def test_noise_free_pairs_agree_with_the_truth_and_each_other() -> None:
    result = process(record(noise=0.0), method=["projection", "panteleev"])
    assert check(result, "result") == []
    for row in summaries(result):
        found = row["joint"]
        assert list(found["pairs"]) == ["1-2", "2-3"]
        assert abs(found["gravity_m_s2"] - GRAVITY) < 1e-7  # 0.01 mGal
        assert sum(pair["weight"] for pair in found["pairs"].values()) == pytest.approx(1.0, abs=1e-12)
        assert row["gravity_m_s2"] == found["pairs"]["1-2"]["gravity_m_s2"]  # the row is the first difference's


def test_a_named_pair_or_two_pendulums_are_not_joined() -> None:
    three = record(noise=0.0, duration=60.0)
    assert "joint" not in process(three, method="projection", pair="2-3").children
    two = process(synth.simulate(synth_two())[0], method="projection")
    assert "joint" not in two.children
    assert neighbours(three) == ["1-2", "2-3"]


def synth_two() -> Scene:
    known = {"record_id": "two", "duration": 60.0, "gravity": GRAVITY, "recording": {"sampling_rate": 10}}
    start = {"kind": "free", "amplitude": 0.01, "phase": 1.0}
    pendulums = [{"label": "1", "period": 1.01, "start": start}, {"label": "2", "period": 1.02, "start": start}]
    return Scene.model_validate(known | {"pendulums": pendulums})


@pytest.mark.compiled
@pytest.mark.parametrize("traces", [None, SINGLE], ids=["differences", "single pendulums"])
def test_stated_error_and_consistency(traces: Any) -> None:
    """Of 60 records: RMSE over sigma is known to 9 %, so it lies within 30 % of one; so does the consistency's."""
    errors, consistency, gains = [], [], []
    for seed in range(60):
        found = summaries(process(record(seed, traces=traces), method="projection"))[0]["joint"]
        errors.append((found["gravity_m_s2"] - GRAVITY) * 1e5 / found["gravity_sigma_mgal"])
        consistency.append(found["consistency"])
        gains.append(found["gravity_sigma_mgal"] / min(p["gravity_sigma_mgal"] for p in found["pairs"].values()))
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(1.0, abs=0.3)
    assert np.sqrt(np.mean(np.square(consistency))) == pytest.approx(1.0, abs=0.3)
    assert max(gains) < 1.0  # better than the better pair


def test_a_refused_pair_has_no_weight_and_a_wrong_one_is_told() -> None:
    results = [process(record(noise=1e-5, duration=60.0), method="projection", pair=pair) for pair in ("1-2", "2-3")]
    fine = joined(results, np.eye(2))
    wrong = results[1].copy(deep=True)
    wrong["gravity"]["gravity"].values[:] += 1e-3  # 100 mGal
    assert joined([results[0], wrong], np.eye(2))["consistency"][0] > 10.0 * fine["consistency"][0]
    wrong["gravity"]["gravity"].values[:] = np.nan
    alone = joined([results[0], wrong], np.eye(2))
    assert alone["weight"][0].tolist() == [1.0, 0.0]
    assert np.isnan(alone["consistency"][0])
    both = joined([wrong, wrong], np.eye(2))
    assert np.isnan(both["gravity"][0])


def test_two_pendulums_are_not_to_be_joined() -> None:
    assert join(synth.simulate(synth_two())[0], lambda pair: pytest.fail("not asked")) is None
