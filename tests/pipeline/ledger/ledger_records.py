"""Records with stated conditions for the tests of the ledger: short, linear, cheap enough for uncompiled kernels."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

import synth
from data_schemas.scene import Scene
from data_schemas.variables import VARIABLES, attributes
from pipeline import process, summaries

GRAVITY = 9.8054321
PERIOD = 1.0097648
SWELL = {"kind": "harmonics", "amplitude": [0.30, 0.22, 0.15], "period": [10.3, 7.1, 5.2], "phase": [0.2, 1.0, 4.0]}
BASES = {
    "base": np.array(["before", "after"]),
    "base_time": np.array([-86400.0, 2 * 86400.0]),
    "base_gravity": np.array([9.81, 9.81]),
}
EVERYTHING: dict[str, Any] = {
    "chronometer_rate": 1.0,
    "temperature": 298.15,
    "temperature_reference": 288.15,
    "temperature_coefficient": np.array([93e-7, 93.1e-7]),
    "air_density": 1.25,
    "air_density_reference": 1.2,
    "density_coefficient": np.array([771e-7, 770e-7]),
    "tilt_mean_square": 1e-5,
    "yaw_rate": 0.01,
    "transverse_acceleration_mean_square": 0.002,
    "support_stiffness": 1e6,
    "mass": np.array([1.0, 1.1]),
    "length": np.array([0.2533, 0.2534]),
    "rocking_rate_mean_square": 2e-5,
    "plane_angle": np.array([0.0, 1e-3]),
    "latitude": 45.0,
    "longitude": 10.0,
    "speed": 3.0,
    "course": 70.0,
    **BASES,
    "base_period": np.array([[PERIOD / 1.0001, PERIOD], [PERIOD / 1.0001 + 1e-7, PERIOD + 2e-7]]),
}
ENTRIES = {
    "chronometer": ("chronometer_rate",),
    "temperature": ("temperature", "temperature_reference", "temperature_coefficient"),
    "air_density": ("air_density", "air_density_reference", "density_coefficient"),
    "tilt": ("tilt_mean_square",),
    "yaw": ("yaw_rate",),
    "transverse_acceleration": ("transverse_acceleration_mean_square",),
    "rocking": ("rocking_rate_mean_square",),
    "planes": ("plane_angle",),
    "tide": ("latitude", "longitude"),
    "flexure": ("support_stiffness", "mass", "length"),
    "eotvos": ("latitude", "speed", "course"),
    "base_tie": ("base", "base_time", "base_gravity", "base_period"),
}
"""Entry of the ledger -> variables that it needs."""


def scene(conditions: dict[str, Any] | None = None, **changes: Any) -> Scene:
    """Two pendulums of 1e-4 relative difference; `first` and `second` are further keys of the pendulums."""
    own = [changes.pop(name, {}) for name in ("first", "second")]
    eps = changes.pop("eps", 1e-4)
    pendulums = [
        {"label": label, "period": period, "start": {"kind": "free", "amplitude": size, "phase": phase}} | more
        for label, period, size, phase, more in (
            ("1", PERIOD / (1.0 + eps), 0.012, 0.4, own[0]),
            ("2", PERIOD, 0.006, 2.2, own[1]),
        )
    ]
    given: dict[str, Any] = {
        "record_id": "ledger",
        "seed": 3,
        "duration": 200.0,
        "gravity": GRAVITY,
        "pendulums": pendulums,
        "motion": [SWELL],
        "conditions": conditions or {},
        "recording": {"sampling_rate": 10},
    }
    return Scene.model_validate(given | changes)


def with_stated(record: xr.DataTree, stated: dict[str, Any]) -> xr.DataTree:
    """A copy of a record whose instrument states more."""
    tree = record.copy(deep=True)
    data = tree["instrument"].to_dataset(inherit=False)
    for name, value in stated.items():
        dims = VARIABLES[f"instrument/{name}"].dims
        data[name] = (dims, np.asarray(value), attributes(f"instrument/{name}"))
    tree["instrument"] = xr.DataTree(data)
    tree["instrument"].attrs.update(record["instrument"].attrs)
    return tree


def row(record: xr.DataTree, method: str = "projection", **options: Any) -> dict[str, Any]:
    """Summary of one method."""
    return summaries(process(record, method=method, **options))[0]


def entry(row: dict[str, Any], name: str) -> dict[str, Any]:
    """One entry of a summary's ledger."""
    (found,) = [each for each in row["ledger"] if each["entry"] == name]
    return found


def error(made: Scene, method: str = "projection") -> float:
    """Error of gravity on a simulated scene, mGal."""
    return (row(synth.simulate(made)[0], method)["gravity_m_s2"] - made.gravity) * 1e5
