"""The suite `honesty`: its integrator against another one, records by seed, every kind's layout, sums and picture."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import data_schemas
from data_schemas.errors import UsageError
from pipeline.benchmarks import honesty as suite
from pipeline.benchmarks import plain
from pipeline.benchmarks.kinds import KINDS, MIXABLE, STRENGTHS, varies
from pipeline.benchmarks.records import record
from pipeline.cli.main import main

compiled = pytest.mark.compiled
SPAN = 60.0  # s


def support() -> plain.Support:
    draw = np.random.default_rng(3)
    rate = np.append(draw.uniform(0.3, 3.0, 8), 2.0 * np.pi * 3.0)
    real, imaginary = 0.03 * draw.normal(size=(2, 2, rate.size)).swapaxes(0, 1)
    law = np.array([9.81, 1e-6, 20.0, 1e-4, 0.05, 0.3])
    return plain.Support(rate, *(real + 1j * imaginary), np.array([[10.0, 40.0, 0.08]]), law)


def pendulums(**terms: Any) -> plain.Pendulums:
    lengths, zeros = np.array([0.25, 0.2501]), np.zeros(2)
    return plain.Pendulums(lengths, np.array([1e-4, 2e-4]), zeros, zeros, False)._replace(**terms)


def by_scipy(times: plain.Floats, start: plain.Floats, own: plain.Pendulums, moved: plain.Support) -> plain.Floats:
    """The same equations, written a second time."""
    (begin, end, pulse), (mean, slope, middle, wave, rate, phase) = moved.pulses[0], moved.gravity
    across, along = moved.across, moved.along

    def slopes(time: float, state: plain.Floats) -> plain.Floats:
        turning = np.exp(1j * moved.rate * time)
        x = (across @ turning).real + 0.5 * pulse * (np.tanh((time - begin) / 5.0) - np.tanh((time - end) / 5.0))
        g = mean + slope * (time - middle) + wave * np.sin(rate * time + phase) + (along @ turning).real
        angle, speed = state[:2], state[2:]
        drag = 2.0 * own.damping * speed + own.quadratic * np.abs(speed) * speed
        drag = drag + own.friction * speed / np.hypot(speed, 0.01)
        pull = g * angle + x if own.linear else g * np.sin(angle) + x * np.cos(angle)
        return np.concatenate([speed, -drag - pull / own.length])

    found = solve_ivp(slopes, (0.0, times[-1]), start.T.ravel(), "DOP853", times, rtol=1e-13, atol=1e-15, max_step=0.02)
    return np.asarray(found.y[:2])


@compiled
@pytest.mark.parametrize(
    "terms",
    [{}, {"linear": True}, {"quadratic": np.array([3e-3, 0.0])}, {"friction": np.array([3e-5, 1e-5])}],
    ids=["sine", "linear", "quadratic", "knife-edge"],
)
def test_integrator_agrees_with_dop853(terms: dict[str, Any]) -> None:
    own, moved = pendulums(**terms), support()
    if own.linear:
        moved = moved._replace(along=np.zeros_like(moved.along))
    times = np.sort(np.append(np.arange(0.0, SPAN, 0.25), [7.0312, 33.3]))
    start = np.array([[0.05, 0.0], [0.0, -0.25]])
    angles, state = plain.integrate(times, start, own, moved, np.zeros((2, times.size)))
    # |v| v has a kink twice a swing, which either integrator steps over
    assert np.abs(angles - by_scipy(times, start, own, moved)).max() < (5e-10 if own.quadratic.any() else 1e-10)
    assert state[:, 0] == pytest.approx(angles[:, -1], abs=0.0)


def test_forced_start_leaves_no_free_swing() -> None:
    moved = support()._replace(pulses=np.empty((0, 3)), gravity=np.array([9.81, 0.0, 0.0, 0.0, 0.0, 0.0]))
    moved = moved._replace(rate=np.array([0.7]), across=np.array([0.01 + 0.02j]), along=np.zeros(1, dtype=complex))
    own = pendulums(linear=True)
    times = np.array([0.0, 2.0 * np.pi / 0.7])
    angles, _ = plain.integrate(times, plain.forced(own, moved), own, moved, np.zeros((2, 2)))
    assert angles[:, 1] == pytest.approx(angles[:, 0], abs=1e-11)


def test_sea_has_the_rms_asked_for() -> None:
    motion = plain.sea(np.random.default_rng(1), 10.0, 0.02, 0.05)
    times = np.arange(0.0, 20_000.0, 0.5)
    for amplitude, wanted in ((motion.across, 0.02), (motion.along, 0.05)):
        # hours of a random sea still scatter by a per cent or so
        assert plain.at(times, motion.rate, amplitude).std() == pytest.approx(wanted, rel=0.05)


def test_records_are_reproducible_by_seed() -> None:
    first, again, other = (record("mixture", "middle", seed, duration=3.0) for seed in (4, 4, 5))
    assert first.tree.identical(again.tree)
    assert first.gravity == again.gravity
    assert not first.tree.identical(other.tree)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_makes_a_valid_record(kind: str) -> None:
    assert KINDS[kind]["source"]
    for strength in STRENGTHS:
        assert data_schemas.check(record(kind, strength, 0, duration=3.0).tree, "record") == []


def test_kinds_are_many_and_differ_by_strength() -> None:
    assert len(KINDS) >= 40
    assert all(len(set(map(str, value))) == 3 for kind in KINDS.values() for value in kind.values() if varies(value))
    assert set(MIXABLE) < set(KINDS)


def row(z: float, strength: str = "weak", refused: str = "", flags: str = "") -> dict[str, Any]:
    found = {"method": "auto", "kind": "swell", "strength": strength, "seed": 0, "resolved": "x", "error_mgal": z}
    return found | {"sigma_mgal": 1.0, "z": z, "band_z": 0.5 * z, "flags": flags, "refused": refused, "seconds": 0.5}


ROWS = [
    *(row(1.0), row(-4.5, flags="a b"), row(0.0, flags="b"), row(math.nan, refused="too short")),
    *(row(6.0, "strong"), row(math.nan, "strong", "crashed: x")),
]


def test_rows_are_summed_by_kind_and_strength() -> None:
    weak, strong = suite.by_kind(ROWS)
    assert (weak["records"], weak["refused"], weak["worst_z"], weak["flags"]) == (4, 1, 4.5, "a b")
    assert weak["error_rms_mgal"] == pytest.approx(math.sqrt(21.25 / 3.0))
    assert weak["within_95"] == pytest.approx(2.0 / 3.0)
    assert weak["band_rms_z"] == pytest.approx(0.5 * weak["rms_z"])
    assert strong["refused"] == 1
    sums = {line["strength"]: line for line in suite.by_strength(ROWS)}
    assert (sums["all"]["beyond_4_sigma"], sums["all"]["beyond_5_sigma"]) == (2, 1)
    assert (sums["strong"]["records"], sums["strong"]["refused"]) == (2, 1)
    assert math.isnan(sums["middle"]["rms_z"])


def test_promises_fail_where_sigma_does_not_hold() -> None:
    assert [bar["pass"] for bar in suite.bars(ROWS)] == [False] * 5
    assert [bar["pass"] for bar in suite.bars([row(1.0), row(3.9, "strong")])] == [True] * 5


def test_a_value_without_sigma_is_infinitely_far() -> None:
    assert suite.in_sigmas(-0.9e-3, 1e-9) == 0.0
    assert suite.in_sigmas(-0.3, 0.1) == pytest.approx(-3.0)
    assert suite.in_sigmas(0.3, math.nan) == suite.in_sigmas(math.nan, 0.1) == math.inf


@compiled
def test_run_resumes_and_draws(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.setattr(suite, "DURATION", 60.0)
    chosen: dict[str, Any] = {"quick": True, "folder": tmp_path, "only": "swell at 25 Hz", "seeds": 1}
    rows = list(suite.run(**chosen))
    with (tmp_path / "honesty-records.csv").open(newline="") as stream:
        records = list(csv.DictReader(stream))
    assert len(records) == 3
    assert all(line["refused"] or float(line["sigma_mgal"]) > 0.0 for line in records)
    assert {path.name for path in tmp_path.iterdir()} == {"points", "honesty-records.csv", "honesty-auto.png"}
    monkeypatch.setattr(suite, "record", None)
    assert repr(list(suite.run(**chosen))) == repr(rows)


def test_unknown_kinds_and_misplaced_options_are_named() -> None:
    with pytest.raises(UsageError, match="--kind"):
        list(suite.run(quick=True, folder=None, only="nonsense"))
    assert main(["benchmark", "paper", "--seeds", "3"]) == 2


def test_crashes_and_refusals_are_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    made = record("swell", "weak", 0, duration=2.0)
    refused = suite.reduced(made, "shooting")
    assert refused["refused"]
    assert not refused["refused"].startswith("crashed")
    assert math.isnan(refused["z"])

    def broken(*_: Any, **__: Any) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr("pipeline.processing.process", broken)
    assert suite.reduced(made, "auto")["refused"] == "crashed: ZeroDivisionError()"
