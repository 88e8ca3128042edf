"""Simulated records for the tests of whole methods: short, and cheap enough for uncompiled kernels."""

from __future__ import annotations

from typing import Any

import xarray as xr

import synth
from data_schemas.scene import Scene
from pipeline import process, summaries

GRAVITY = 9.8054321
PERIOD = 1.0097648
SWELL = {"kind": "harmonics", "amplitude": [0.30, 0.22, 0.15], "period": [10.3, 7.1, 5.2], "phase": [0.2, 1.0, 4.0]}
RESONANT = {"kind": "near-resonant", "amplitude": 4e-4, "detuning": 0.026, "phase": 0.7}


def simulate(
    *,
    eps: float = 1e-4,
    duration: float = 240.0,
    seed: int = 1,
    motion: list[dict[str, Any]] | None = None,
    free: tuple[tuple[float, float], tuple[float, float]] = ((0.012, 0.4), (0.006, 2.2)),
    damping: tuple[float, float] = (0.0, 0.0),
    gravity: float = GRAVITY,
    **recording: Any,
) -> tuple[xr.DataTree, xr.DataTree]:
    """Record and truth; `eps` = (n1 - n2)/n2, `free` = amplitude and phase of each."""
    scene: dict[str, Any] = {
        "record_id": "made",
        "seed": seed,
        "duration": duration,
        "gravity": gravity,
        "pendulums": [
            {
                "label": label,
                "period": period,
                "damping_rate": rate,
                "start": {"kind": "free", "amplitude": start[0], "phase": start[1]},
            }
            for label, period, rate, start in zip(
                ("1", "2"), (PERIOD / (1.0 + eps), PERIOD), damping, free, strict=True
            )
        ],
        "motion": [SWELL] if motion is None else motion,
        "recording": recording if recording.get("marks") else {"sampling_rate": 10, **recording},
    }
    return synth.simulate(Scene.model_validate(scene))


def row(record: xr.DataTree, method: str, **options: Any) -> dict[str, Any]:
    """The JSON object of one method."""
    return summaries(process(record, method=method, **options))[0]


def error(record: xr.DataTree, method: str, gravity: float = GRAVITY) -> float:
    """Error of a method, mGal; NaN where it refuses."""
    return (row(record, method)["gravity_m_s2"] - gravity) * 1e5


def changed(record: xr.DataTree, group: str, name: str, values: Any, dims: tuple[str, ...] = ()) -> xr.DataTree:
    """A copy of a record with one variable replaced or added."""
    from data_schemas.variables import attributes

    tree = record.copy(deep=True)
    data = tree[group].to_dataset(inherit=False)
    data[name] = (dims or (data[name].dims if name in data else ()), values, attributes(f"{group}/{name}"))
    tree[group] = xr.DataTree(data)
    return tree
