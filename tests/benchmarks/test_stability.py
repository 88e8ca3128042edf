"""The judgement of cells: right, flagged, refused where listed, or found out."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pipeline.benchmarks import stability_records
from pipeline.benchmarks.scenes import GRAVITY
from pipeline.benchmarks.stability_records import FLOOR, INEXACT, NOISE, Extreme, extremes, judge, reduce
from pipeline.methods import PAIR_METHODS

EXTREME = Extreme("10 s long", lambda: pytest.fail("not made"), GRAVITY, ("projection",), "too short")


def row(error: float, sigma: float = 0.1, flags: tuple[str, ...] = (), status: str = "ok") -> dict[str, Any]:
    return {
        "status": status,
        "gravity_m_s2": GRAVITY + 1e-5 * error,
        "gravity_sigma_mgal": sigma,
        "flags": list(flags),
        "error": "why",
    }


def test_value_within_five_sigmas_is_right() -> None:
    assert judge(EXTREME, {"projection": row(0.49)})["pass"]
    assert judge(EXTREME, {"projection": row(0.5 + 2 * FLOOR)})["silently_wrong"] == "projection"


def test_flag_saves_a_wrong_value_from_silence() -> None:
    assert judge(EXTREME, {"projection": row(1000.0, flags=("residual-not-white",))})["pass"]


def test_methods_that_are_wrong_by_nature_are_not_silent() -> None:
    assert judge(EXTREME, {name: row(1000.0) for name in INEXACT})["pass"]


def test_gravity_from_nothing_is_wrong_whatever_the_flag() -> None:
    nothing = Extreme("pure noise", EXTREME.make, None)
    assert not judge(nothing, {"uncorrected": row(0.0)})["pass"]
    assert not judge(nothing, {"complex": row(0.0, flags=("short-record",))})["pass"]
    found = judge(nothing, {"complex": row(0.0, flags=("noise-above-stated",))})
    assert found["pass"]
    assert "m/s2" in found["complex"]


def test_refusal_must_be_listed() -> None:
    refused = {"projection": row(0.0, status="refused")}
    assert judge(EXTREME, refused)["pass"]
    found = judge(Extreme("equal frequencies", EXTREME.make), refused)
    assert not found["pass"]
    assert found["refused_unlisted"] == "projection"
    assert found["projection"] == "refused: why"


def test_what_may_refuse_has_a_reason() -> None:
    every = extremes()
    assert len({extreme.name for extreme in every}) == len(every)
    assert all(set(extreme.may_refuse) <= set(PAIR_METHODS) for extreme in every)
    assert all(bool(extreme.why) == bool(extreme.may_refuse) for extreme in every)


def test_records_are_what_their_names_say(short: float) -> None:
    made = {extreme.name: extreme for extreme in extremes()}
    blank = np.asarray(made["all NaN, first pendulum"].make()["record/elongation"].values)
    assert np.isnan(blank[0]).all()
    assert np.isfinite(blank[1]).all()
    assert made["10 s long"].make()["time"].size == 250
    wrong = made["nominal period 5 % long"]
    periods = np.asarray(wrong.make()["instrument/period"].values)
    assert periods == pytest.approx(1.05 * np.array([1.01 / (1 + 1e-4), 1.01]))
    assert wrong.gravity == pytest.approx(1.05**2 * GRAVITY)
    assert "restoring" not in made["huge arc, sine, unsaid"].make()["instrument"].attrs
    assert made["huge arc, sine, stated"].make()["instrument"].attrs["restoring"] == "sine"


def test_every_record_can_be_made(short: float) -> None:
    for extreme in extremes():
        values = np.asarray(extreme.make()["record/elongation"].values)
        # a minute is over before five are blank
        assert np.isnan(values).all() if extreme.name == "NaN for the first 5 min" else np.isfinite(values).any()
        assert not np.any(np.abs(values) > 4.0)


def test_real_pendulums_obey_the_sine_law(short: float) -> None:
    record = next(extreme for extreme in extremes() if extreme.name == "huge arc, sine, stated").make()
    theta = np.asarray(record["record/elongation"].values)[0]
    n = 2 * np.pi / 1.01 * (1 + 1e-4) * np.sqrt(GRAVITY / 9.81)
    curvature = (theta[2:] - 2 * theta[1:-1] + theta[:-2]) / 0.04**2
    # second differences: (n step)^2/12 = 0.5 % of n^2 theta, noise 2.4 sigma/step^2 = 0.015
    assert np.abs(curvature + n**2 * np.sin(theta[1:-1])).max() < 0.02 * n**2 * 0.8
    assert np.abs(theta).max() == pytest.approx(0.8, abs=10 * NOISE)


def test_a_record_declined_as_a_whole_is_declined_by_each_method() -> None:
    extreme = next(each for each in extremes() if each.name == "10 s long")
    found = reduce(extreme)
    assert set(found) == set(PAIR_METHODS)
    assert judge(extreme, found)["pass"]


def test_nothing_but_noise_gives_no_gravity(short: float) -> None:
    extreme = next(each for each in extremes() if each.name == "pure noise")
    found = reduce(extreme)
    assert judge(extreme, found)["silently_wrong"] == ""


@pytest.mark.compiled
def test_extreme_records_that_are_right(monkeypatch: pytest.MonkeyPatch) -> None:
    names = ("a through zero", "equal frequencies", "pure noise", "nominal period 0.5 % long", "60 s long")
    chosen = [extreme for extreme in extremes() if extreme.name in names]
    monkeypatch.setattr(stability_records, "extremes", lambda: chosen)
    rows = list(stability_records.rows())
    assert len(rows) == len(names)
    assert all(row["pass"] for row in rows), [row for row in rows if not row["pass"]]
