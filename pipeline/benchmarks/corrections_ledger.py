"""One record on which everything acts, and what is left of the error after each entry of its ledger in turn.

Swell, heave, vibration and arcs as simulated; a chronometer that loses; and what changes the period or gravity itself
is put into the scene with its sign from the physics and stated in the record, as an observer would state it: warmer and
thinner air than at the calibration, a tilted and turning plane of swing, a ship that makes way.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from xarray import DataTree

from data_schemas.scene import Scene
from data_schemas.variables import attributes
from pipeline.benchmarks.corrections_points import Point, scene
from pipeline.gravity import MGAL
from pipeline.processing import process
from synth import simulate

Row = dict[str, Any]
METHODS = ("panteleev", "general", "shooting")
"""Paper's formula, corrected formula, exact inversion."""
UNCORRECTED = "uncorrected"
_KNOT = 1852.0 / 3600.0  # m s-1


@dataclass(frozen=True)
class Circumstances:
    """What acts on the instrument beside the motion; SI units, as the record states it."""

    chronometer_rate: float = 1.5
    temperature: float = 296.15
    temperature_reference: float = 293.15
    temperature_coefficient: float = 93e-7  # brass
    air_density: float = 1.15
    air_density_reference: float = 1.20
    density_coefficient: float = 770e-7
    tilt_mean_square: float = (10.0 * math.pi / 10800.0) ** 2
    yaw_rate: float = math.radians(1.0)
    latitude: float = 45.0
    speed: float = 4.0 * _KNOT
    course: float = 90.0

    def period_change(self) -> float:
        """By how much the periods differ from those stated, at the calibration's temperature and in vacuum, s."""
        warm = self.temperature_coefficient * (self.temperature - self.temperature_reference)
        return warm + self.density_coefficient * self.air_density / self.air_density_reference

    def gravity_change(self, gravity: float, frequency: float) -> float:
        """By how much the gravity that the pendulums feel differs from that of the place, m s-2."""
        tilted = -gravity * self.tilt_mean_square / 2.0
        turning = -gravity * (self.yaw_rate / frequency) ** 2
        knots = self.speed / _KNOT
        east = math.cos(math.radians(self.latitude)) * math.sin(math.radians(self.course))
        under_way = -(7.503 * knots * east + 0.00415 * knots**2) * MGAL
        return tilted + turning + under_way


def troubled(length: float, circumstances: Circumstances) -> tuple[DataTree, float]:
    """A record on which everything acts, and the gravity of its place, m s-2."""
    calm = scene(Point(arc=0.02, first_arc=0.02, noise=1e-5, length=length))
    gravity = calm.gravity
    frequency = 2.0 * math.pi / calm.pendulums[1].period * math.sqrt(gravity / calm.reference_gravity)
    known = calm.model_dump()
    for pendulum in known["pendulums"]:
        pendulum["period"] += circumstances.period_change()
    known["gravity"] += circumstances.gravity_change(gravity, frequency)
    known["recording"]["chronometer_rate"] = circumstances.chronometer_rate
    record = simulate(Scene.model_validate(known))[0]
    stated: dict[str, Any] = {"period": ("pendulum", np.array([each.period for each in calm.pendulums]))}
    for name, value in vars(circumstances).items():
        each = name.endswith("_coefficient")
        stated[name] = ("pendulum", np.full(len(calm.pendulums), value)) if each else ((), value)
    table = record["instrument"].to_dataset()
    labelled = {name: (dims, values, attributes(f"instrument/{name}")) for name, (dims, values) in stated.items()}
    record["instrument"] = DataTree(table.assign(labelled))
    return record, gravity


def waterfall(result: DataTree, gravity: float) -> list[Row]:
    """One row an entry and method: what it adds, and what is left of the error after it.

    The first row of a method is its gravity before any correction; the entries follow in the ledger's own order,
    whichever they are. A method that refused has no rows.
    """
    table = result["gravity"].dataset
    entries = [str(name) for name in table["entry"].values]
    rows: list[Row] = []
    for k, method in enumerate(str(name) for name in table["method"].values):
        found = float(table["gravity"].values[k])
        if not math.isfinite(found):
            continue
        values = np.nan_to_num(np.asarray(table["value"].values[k], dtype=np.float64))
        sigma = float(table["gravity_sigma"].values[k])
        left = (found - gravity) / MGAL - float(values.sum())
        rows.append(_row(method, UNCORRECTED, 0.0, left, math.nan, True, ""))
        for entry, value, own, applied, reason in zip(
            entries,
            values,
            np.asarray(table["sigma"].values[k], dtype=np.float64),
            table["applied"].values[k],
            table["reason"].values[k],
            strict=True,
        ):
            left += float(value)
            rows.append(_row(method, entry, float(value), left, float(own), bool(applied), str(reason)))
        rows[-1]["total_sigma_mgal"] = sigma
    return rows


def _row(method: str, entry: str, value: float, left: float, sigma: float, applied: bool, reason: str) -> Row:
    return {
        "method": method,
        "entry": entry,
        "value_mgal": value,
        "residual_mgal": left,
        "sigma_mgal": sigma,
        "total_sigma_mgal": math.nan,
        "applied": applied,
        "reason": reason,
    }


def measured(length: float, methods: Sequence[str] = METHODS) -> list[Row]:
    """The waterfall of the record on which everything acts."""
    record, gravity = troubled(length, Circumstances())
    return waterfall(process(record, method=list(methods)), gravity)
