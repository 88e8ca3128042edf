"""Records at the edge of what can be reduced, each with the gravity that a right answer must give, and who may decline.

A cell is right if its error lies within five of its sigmas or if it carries a flag that says what is wrong.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from xarray import DataTree

from data_schemas.errors import IsochronyError
from data_schemas.scene import Scene
from pipeline.benchmarks.progress import progress
from pipeline.benchmarks.scenes import (
    GRAVITY,
    beats_through_zero,
    linear,
    own_frequency,
    resonant,
    swell,
    two_pendulums,
)
from pipeline.gravity import MGAL
from pipeline.methods import PAIR_METHODS
from pipeline.processing import process
from pipeline.summary import summaries
from synth import simulate

NOISE = 1e-5  # rad: without it every sigma would be zero and no error within it


SIGMAS = 5.0
FLOOR = 1e-3  # mGal: numerical error that no sigma speaks of

INEXACT = {
    "uncorrected": "leaves the non-isochronism in: its error is what it shows",
    "vening-meinesz": "lets the slow motion leak in: its error is what it shows",
}
"""Methods whose value is off by more than sigma by their nature; judged only where nothing can be right."""

NOTHING_THERE = {"noise-above-stated", "residual-not-white"}
"""Flags one of which a value must carry where there is no gravity to be had."""

_ALL = PAIR_METHODS
_PHASE = ("uncorrected", "vening-meinesz", "panteleev", "general")
_SERIES = "series in the arc and linear identities do not hold at 1 rad"
_ELSEWHERE = "the swing is not where the record says"


@dataclass(frozen=True)
class Extreme:
    """One record and what it says.

    Attributes
    ----------
    make : callable
        Gives the record.
    gravity : float or None
        What the record's own words and readings amount to, m s-2; None where they amount to nothing.
    may_refuse : tuple of str
        Methods that may decline it; every other cell must give a value.
    why : str
        They may.
    """

    name: str
    make: Callable[[], DataTree]
    gravity: float | None = GRAVITY
    may_refuse: tuple[str, ...] = ()
    why: str = ""


def extremes() -> list[Extreme]:
    """Every extreme record of the suite."""
    zero, marks = "the phase of a vanishing amplitude means nothing", linear(1e-4, noise=NOISE, marks=True)
    return [
        Extreme("a through zero", lambda: _record(beats_through_zero(noise=NOISE)), GRAVITY, _PHASE, zero),
        Extreme("equal frequencies", lambda: _record(linear(0.0, noise=NOISE))),
        Extreme("relative difference 1e-12", lambda: _record(linear(1e-12, noise=NOISE))),
        Extreme("resonance detuned by 1e-12", partial(_pair, 1e-4, motion=[swell(), resonant(1e-6, 1e-12)])),
        Extreme("Theta1/a = 10", partial(_pair, 1e-5, amplitudes=(0.05, 0.045), phases=(0.4, 0.4))),
        Extreme("huge arc, linear", partial(_pair, 1e-4, amplitudes=(0.8, 1.0))),
        Extreme("huge arc, sine, stated", lambda: _real_pendulums("sine"), GRAVITY, _ALL, _SERIES),
        Extreme("huge arc, sine, unsaid", lambda: _real_pendulums(None), GRAVITY, _ALL, _SERIES),
        Extreme("NaN for the first 5 min", lambda: _record(linear(noise=NOISE, missing=[(0.0, 300.0)]))),
        Extreme(
            "all NaN, first pendulum", _without_the_first, None, _ALL, "without the first pendulum is no correction"
        ),
        Extreme(
            "10 s long", lambda: _record(linear(noise=NOISE, duration=10.0)), GRAVITY, _ALL,
            "ten swings hold no window in which the harmonic is separated from the swell",
        ),
        Extreme("60 s long", lambda: _record(linear(noise=NOISE, duration=60.0))),
        Extreme(
            "two samples a swing", lambda: _record(marks), GRAVITY, ("projection", "shooting"),
            "quadrature needs eight readings a swing",
        ),
        Extreme(
            "less than two a swing", lambda: _record(linear(1e-4, noise=NOISE, sampling_rate=0.8)), GRAVITY, _ALL,
            "below two readings a swing the harmonic is an image of itself",
        ),
        Extreme("pure noise", _pure_noise, None, _ALL, "there is no swing"),
        Extreme("nominal period 0.5 % long", partial(_misnamed, 0.005), _as_said(0.005)),
        Extreme("nominal period 5 % long", partial(_misnamed, 0.05), _as_said(0.05), _ALL, _ELSEWHERE),
        Extreme("nominal period 20 % long", partial(_misnamed, 0.2), _as_said(0.2), _ALL, _ELSEWHERE),
    ]  # fmt: skip


def _pair(relative_difference: float, **changes: Any) -> DataTree:
    return _record(two_pendulums("extreme", relative_difference, noise=NOISE, **changes))


def _record(scene: Scene) -> DataTree:
    return simulate(scene)[0]


def _as_said(wrong: float) -> float:
    """Gravity that a record with a wrong period amounts to: the period is what it is measured by."""
    return GRAVITY * (1.0 + wrong) ** 2


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


def rows() -> Iterator[dict[str, Any]]:
    """Yield one row a record, one cell a method."""
    for extreme in progress(extremes(), "extreme records"):
        yield judge(extreme, reduce(extreme))


def reduce(extreme: Extreme) -> dict[str, dict[str, Any]]:
    """Summary of every method on the record; a record that is declined as a whole is declined by each."""
    try:
        rows = summaries(process(extreme.make(), method=PAIR_METHODS))
    except IsochronyError as refusal:
        return {name: {"status": "refused", "error": str(refusal), "flags": []} for name in PAIR_METHODS}
    return {str(row["requested_method"]): row for row in rows}


def judge(extreme: Extreme, found: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """One row: cells, those that are wrong without a word, and those that declined though they must not."""
    silent = [name for name, row in found.items() if row["status"] == "ok" and not _right(name, row, extreme)]
    unlisted = [name for name, row in found.items() if row["status"] != "ok" and name not in extreme.may_refuse]
    cells = {name: _cell(row, extreme) for name, row in found.items()}
    return {
        "record": extreme.name,
        **cells,
        "silently_wrong": " ".join(silent),
        "refused_unlisted": " ".join(unlisted),
        "pass": not silent and not unlisted,
    }


def error(row: Mapping[str, Any], extreme: Extreme) -> float:
    """Error of gravity, mGal; NaN where the record amounts to no gravity at all."""
    if extreme.gravity is None:
        return math.nan
    return (float(row["gravity_m_s2"]) - extreme.gravity) / MGAL


def _right(name: str, row: Mapping[str, Any], extreme: Extreme) -> bool:
    if extreme.gravity is None:
        return not NOTHING_THERE.isdisjoint(row["flags"])
    if row["flags"]:
        return True
    return name in INEXACT or abs(error(row, extreme)) <= SIGMAS * float(row["gravity_sigma_mgal"]) + FLOOR


def _cell(row: Mapping[str, Any], extreme: Extreme) -> str:
    if row["status"] != "ok":
        return f"refused: {row['error']}"
    value = error(row, extreme)
    shown = f"{row['gravity_m_s2']:.6f} m/s2" if math.isnan(value) else f"{value:.3g}"
    flags = f" [{' '.join(row['flags'])}]" if row["flags"] else ""
    return f"{shown} +- {row['gravity_sigma_mgal']:.2g}{flags}"
