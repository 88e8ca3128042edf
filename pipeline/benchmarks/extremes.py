"""Records at the edge of what can be reduced, each with the gravity that a right answer must give."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from xarray import DataTree

from data_schemas.scene import Scene
from pipeline.benchmarks.scenes import GRAVITY, beats_through_zero, linear, own_frequency, swell, two_pendulums
from synth import simulate

NOISE = 1e-5  # rad: without it every sigma would be zero and no error within it


@dataclass(frozen=True)
class Extreme:
    """One record and what it says.

    Attributes
    ----------
    make : callable
        Gives the record.
    gravity : float or None
        What the record's own words and readings amount to, m s-2; None where they amount to nothing.
    """

    name: str
    make: Callable[[], DataTree]
    gravity: float | None = GRAVITY


def extremes() -> list[Extreme]:
    """Every extreme record of the suite."""
    return [
        Extreme("a through zero", lambda: _record(beats_through_zero(noise=NOISE))),
        Extreme("equal frequencies", lambda: _record(linear(0.0, noise=NOISE))),
        Extreme("relative difference 1e-12", lambda: _record(linear(1e-12, noise=NOISE))),
        Extreme("resonance detuned by 1e-12", lambda: _record(_at_resonance())),
        Extreme("Theta1/a = 10", lambda: _record(_lopsided())),
        Extreme("huge arc, linear", lambda: _record(_huge())),
        Extreme("huge arc, sine, stated", lambda: _real_pendulums("sine")),
        Extreme("huge arc, sine, unsaid", lambda: _real_pendulums(None)),
        Extreme("NaN for the first 5 min", lambda: _record(linear(noise=NOISE, missing=[(0.0, 300.0)]))),
        Extreme("all NaN, first pendulum", _without_the_first, None),
        Extreme("10 s long", lambda: _record(linear(noise=NOISE, duration=10.0))),
        Extreme("60 s long", lambda: _record(linear(noise=NOISE, duration=60.0))),
        Extreme("two samples a swing", lambda: _record(linear(1e-4, noise=NOISE, marks=True))),
        Extreme("less than two a swing", lambda: _record(linear(1e-4, noise=NOISE, sampling_rate=0.8))),
        Extreme("pure noise", _pure_noise, None),
        *(
            Extreme(f"nominal period {100 * wrong:g} % long", partial(_misnamed, wrong), _as_said(wrong))
            for wrong in (0.005, 0.05, 0.2)
        ),
    ]


def _record(scene: Scene) -> DataTree:
    return simulate(scene)[0]


def _as_said(wrong: float) -> float:
    """Gravity that a record with a wrong period amounts to: the period is what it is measured by."""
    return GRAVITY * (1.0 + wrong) ** 2


def _at_resonance() -> Scene:
    drive = {"kind": "near-resonant", "amplitude": 1e-6 * GRAVITY, "detuning": 1e-12, "phase": 1.0}
    return two_pendulums("at-resonance", 1e-4, motion=[swell(), drive], noise=NOISE)


def _lopsided() -> Scene:
    return two_pendulums("lopsided", 1e-5, amplitudes=(0.05, 0.045), phases=(0.4, 0.4), noise=NOISE)


def _huge() -> Scene:
    return two_pendulums("huge-arc", 1e-4, amplitudes=(0.8, 1.0), noise=NOISE)


def _real_pendulums(restoring: str | None) -> DataTree:
    """Pendulums of the sine law on a support at rest, 0.8 and 1 rad: Jacobi's elliptic functions."""
    from scipy.special import ellipj, ellipk

    record = _record(two_pendulums("huge-arc-sine", 1e-4, motion=[]))
    time = np.asarray(record["time"].values)
    angles = []
    for frequency, arc in zip((own_frequency() * (1.0 + 1e-4), own_frequency()), (0.8, 1.0), strict=True):
        modulus = np.sin(0.5 * arc) ** 2
        sn = ellipj(ellipk(modulus) - frequency * time, modulus)[0]
        angles.append(2.0 * np.arcsin(np.sqrt(modulus) * sn))
    chance = np.random.default_rng(3).normal(scale=NOISE, size=(2, time.size))
    values = np.stack([angles[0], angles[0] - angles[1]]) + chance
    record = _with(record, values)
    if restoring is None:
        del record["instrument"].attrs["restoring"]
    else:
        record["instrument"].attrs["restoring"] = restoring
    return record


def _without_the_first() -> DataTree:
    record = _record(linear(noise=NOISE))
    values = np.array(record["record/elongation"].values)
    values[0] = np.nan
    return _with(record, values)


def _pure_noise() -> DataTree:
    record = _record(linear(noise=NOISE))
    chance = np.random.default_rng(5)
    return _with(record, chance.normal(scale=0.01, size=record["record/elongation"].shape))


def _misnamed(wrong: float) -> DataTree:
    record = _record(linear(noise=NOISE)).copy(deep=True)
    record["instrument"]["period"] = record["instrument"]["period"] * (1.0 + wrong)
    return record


def _with(record: DataTree, values: np.ndarray) -> DataTree:
    record = record.copy(deep=True)
    traces = record["record"].to_dataset()
    record["record"] = DataTree(traces.assign(elongation=traces["elongation"].copy(data=values)))
    return record
