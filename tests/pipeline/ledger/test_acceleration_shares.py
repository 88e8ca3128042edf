"""Browne's terms and the arcs: seen in simulation, removed, and entered in the ledger at their own size."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import xarray as xr
from ledger_records import entry, row, scene

import synth
from pipeline.ledger.entry import Entry, Shares, mean_over_record, shares
from pipeline.methods import method
from pipeline.observation import Observation, observe
from pipeline.prepared import prepare
from pipeline.reduction import gravity

X = {"kind": "harmonics", "amplitude": [0.1], "period": [10.0], "phase": [0.3]}
Z = X | {"axis": "vertical"}
SMALL = {"kind": "free", "amplitude": 1e-3, "phase": 0.4}
FAR = {"kind": "free", "amplitude": 1e-3, "phase": 2.2}


def made(motion: list[dict[str, Any]], duration: float = 1800.0, **changes: Any) -> Any:
    given: dict[str, Any] = {
        "restoring": "sine",
        "duration": duration,
        "recording": {"sampling_rate": 25, "vertical_acceleration": True},
    }
    return scene(motion=motion, **(given | changes))


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("motion", "seen", "name"),
    [([X], 25.48, "horizontal_acceleration"), ([Z], -12.78, "vertical_acceleration")],
    ids=["horizontal", "vertical"],
)
def test_browne(motion: list[dict[str, Any]], seen: float, name: str) -> None:
    """0.1 m/s2 at 10 s: +25.48 and -12.78 mGal (the slow limit -12.74)."""
    record, _ = synth.simulate(made(motion, first={"start": SMALL}, second={"start": FAR}))
    # a linear method sees the term, less the arcs of 1 mrad (0.1 mGal) and, of heave, what the ends cut off
    still = row(synth.simulate(made([], first={"start": SMALL}, second={"start": FAR}))[0], "projection")
    observed = (row(record, "projection")["gravity_m_s2"] - still["gravity_m_s2"]) * 1e5
    assert observed == pytest.approx(seen, abs=0.15)
    for way in ("shooting", "general"):
        found = row(record, way)
        assert (found["gravity_m_s2"] - 9.8054321) * 1e5 == pytest.approx(0.0, abs=0.02)
        assert entry(found, name)["value_mgal"] == pytest.approx(-seen, abs=0.03)
    assert not entry(row(record, "projection"), name)["applied"]


@pytest.mark.compiled
def test_parts_do_not_depend_on_each_other() -> None:
    """Arc, sway, heave together: each entry is what it is alone, and the non-isochronism as of linear pendulums."""
    record, _ = synth.simulate(made([X, Z]))
    found = {name: entry(row(record, "shooting"), name)["value_mgal"] for name in _ENTRIES}
    alone = {
        "finite_arc": entry(row(synth.simulate(made([]))[0], "shooting"), "finite_arc")["value_mgal"],
        "horizontal_acceleration": -25.48,
        "vertical_acceleration": 12.78,
        "non_isochronism": entry(row(synth.simulate(made([]))[0], "shooting"), "non_isochronism")["value_mgal"],
    }
    # swell moves the mean about which an arc swings (0.3 mGal), ends cut heave off (0.3 mGal), and both turn the phase
    # of the first pendulum against the difference, which the non-isochronism takes up
    for name, tolerance in (("finite_arc", 0.5), ("horizontal_acceleration", 0.05), ("vertical_acceleration", 0.05)):
        assert found[name] == pytest.approx(alone[name], abs=tolerance), name
    assert found["non_isochronism"] == pytest.approx(alone["non_isochronism"], abs=3.0)


_ENTRIES = ("non_isochronism", "finite_arc", "horizontal_acceleration", "vertical_acceleration")


@pytest.mark.compiled
def test_arcs_of_the_exact_method_are_those_of_the_formula() -> None:
    """`shooting` has no arc term of its own: its share is found by response, that of `general` by regression."""
    record, _ = synth.simulate(made([]))
    shooting, general = (entry(row(record, name), "finite_arc") for name in ("shooting", "general"))
    # the two weigh the time of the record a little differently, where the swing beats
    assert shooting["value_mgal"] == pytest.approx(general["value_mgal"], rel=0.02)
    # either pendulum alone: g A^2/8 with 12 and 6 mrad
    assert f"pendulum 1 alone {9.8054321e5 * 0.012**2 / 8:+.2f}" in shooting["reason"]
    assert f"pendulum 2 {9.8054321e5 * 0.006**2 / 8:+.2f}" in shooting["reason"]


@pytest.mark.compiled
def test_sensitivity_to_gain_counts_the_arcs() -> None:
    """The first trace larger by 2e-4: finite differences through `shooting`, arcs and sway included."""
    record, _ = synth.simulate(made([X], first={"start": SMALL | {"amplitude": 0.03}}))
    values = record["record"]["elongation"].values

    def at(gain: float) -> float:
        tree = record.copy(deep=True)
        tree["record"]["elongation"].values[:] = values * np.array([[gain], [1.0]])
        return float(row(tree, "shooting")["gravity_m_s2"])

    told = row(record, "shooting")["sensitivity_mgal"]["gain_1_percent"]
    change = (at(1.0001) - at(0.9999)) * 1e5 / 2e-4 * 0.01
    assert told == pytest.approx(change, rel=0.05)
    plain = row(record, "projection")["sensitivity_mgal"]["gain_1_percent"]
    assert abs(plain - change) > 0.2 * abs(change)


def test_shares_follow_from_the_recorded_motion() -> None:
    """Sway and heave of 0.1 and 0.2 m/s2 at 10.3 and 8.8 s: -<x''^2>/2g and <z''^2>/4g, arcs by (n/16) A^2."""
    record, _ = synth.simulate(scene(motion=[X | {"period": [10.3]}], duration=400.0, eps=1e-6))
    seen = observe(record)
    ready = prepare(replace(seen, vertical=0.2 * np.cos(2 * np.pi / 8.8 * seen.time)))
    estimate = replace(method("projection")(ready), acceleration_reduced=True)
    found = shares(estimate, ready)
    milligal = 2e5 * 9.8054321 / estimate.frequency
    assert found.horizontal * milligal == pytest.approx(-0.005 / (2 * 9.8054321) * 1e5, rel=0.01)
    assert found.vertical * milligal == pytest.approx(0.02 / (4 * 9.8054321) * 1e5, rel=0.01)
    np.testing.assert_allclose(found.squares, [0.012**2, 0.006**2], rtol=0.01)
    assert shares(method("projection")(ready), ready) == Shares()
    one, two = 0.012 * np.exp(0.4j), 0.006 * np.exp(2.2j)

    def arc(gain: float) -> float:
        """Of constant harmonics, the first pendulum's trace larger by a gain, the difference as it was read."""
        first, second = gain * one, gain * one - (one - two)
        answer = (abs(first) ** 2 * first - abs(second) ** 2 * second) / (one - two)
        return estimate.frequency / 16.0 * float(answer.real)

    assert found.arc == pytest.approx(arc(1.0), rel=0.01)
    assert found.by_gain == pytest.approx((arc(1.01) - arc(1.0)) / 0.01 + 2.0 * found.horizontal, rel=0.01)
    assert replace(estimate, finite_arc=3e-6).finite_arc == shares(replace(estimate, finite_arc=3e-6), ready).arc


def test_the_ledger_says_where_heave_comes_from() -> None:
    record, _ = synth.simulate(scene(duration=120.0))
    silent = observe(record)
    heaving = replace(silent, vertical=0.2 * np.cos(2 * np.pi / 8.8 * silent.time))

    def listed(seen: Observation) -> Entry:
        ready = prepare(seen)
        estimate = replace(method("projection")(ready), acceleration_reduced=True)
        return gravity(estimate, ready).ledger["vertical_acceleration"]

    assert (listed(heaving).applied, listed(heaving).reason) == (True, "record/vertical_acceleration")
    missing = listed(silent)
    assert (missing.applied, missing.reason) == (False, "no record/vertical_acceleration in the record")


def test_a_steady_course_is_its_own_mean() -> None:
    """Whatever the beat of the amplitudes: a constant shift of n2 is found as it is."""
    record: xr.DataTree = synth.simulate(scene())[0]
    ready = prepare(observe(record))
    time = record["time"].values
    assert mean_over_record(ready, time, np.full(time.size, 290.0)) == pytest.approx(290.0, abs=1e-9)
    drifting = mean_over_record(ready, time, 290.0 + time / time[-1])
    assert 290.0 < drifting < 291.0
