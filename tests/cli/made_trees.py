"""Small hand-made records and results whose pictures are known in advance."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from data_schemas.variables import VARIABLES, attributes

FREQUENCY = np.array([6.2216, 6.2210])
GRAVITY = 9.8054321
METHODS = ["uncorrected", "vening-meinesz", "panteleev", "general", "complex", "projection"]
ERRORS = np.array([-41.0, 8.3, 0.004, 15.8, 0.002, 0.0004])  # mGal
SIGMAS = np.array([0.05, 0.06, 0.05, 0.05, 0.05, 0.05])  # mGal


def dataset(group: str, variables: dict[str, Any], **labels: Any) -> xr.Dataset:
    def entry(name: str, value: Any) -> tuple[tuple[str, ...], Any, dict[str, Any]]:
        key = f"{group}/{name}"
        return VARIABLES[key].dims, value, attributes(key)

    return xr.Dataset(
        {name: entry(name, value) for name, value in variables.items()},
        coords={name: entry(name, np.array(values)) for name, values in labels.items()},
    )


def root(time: np.ndarray, kind: str, **more: Any) -> xr.Dataset:
    head = {
        "Conventions": "CF-1.11",
        "schema": f"isochrony-{kind}",
        "schema_version": "2" if kind == "result" else "1",
        "record_id": "hand-made",
    }
    return xr.Dataset(coords={"time": ("time", time, attributes("time"))}, attrs=head | more)


def made_record(count: int = 1500, step: float = 0.04, gap: int = 0) -> xr.DataTree:
    time = np.arange(count) * step
    # free swings on the forced solution of a swell: an exact solution for two undamped linear pendulums
    swing = 0.01 * np.cos(FREQUENCY[:, None] * time + np.array([[0.0], [2.0]]))
    swing += (0.05 / (1.0 - (0.6 / FREQUENCY) ** 2))[:, None] * np.sin(0.6 * time)
    elongation = np.stack([swing[0], swing[0] - swing[1]])
    elongation[:, count // 3 : count // 3 + gap] = np.nan
    traces = dataset(
        "record",
        {"combination": np.array([[1.0, 0.0], [1.0, -1.0]]), "elongation": elongation},
        trace=["1", "1-2"],
        pendulum=["1", "2"],
    )
    instrument = dataset(
        "instrument",
        {"period": 2.0 * np.pi / FREQUENCY * np.sqrt(GRAVITY / 9.81), "reference_gravity": 9.81},
        pendulum=["1", "2"],
    )
    return xr.DataTree.from_dict({"/": root(time, "record"), "/record": traces, "/instrument": instrument})


def made_result(count: int = 1500, step: float = 1.2) -> xr.DataTree:
    time = np.arange(count) * step
    beat = 0.05 * time
    amplitude = np.stack([0.01 + 0.002 * np.cos(beat), 0.009 + 0.002 * np.cos(beat), 0.014 * np.exp(-3e-4 * time)])
    leak = 3e-4 * np.cos(beat)
    speed = np.stack([FREQUENCY[0] + 0.02 * np.sin(beat), FREQUENCY[1] + 0.02 * np.sin(beat), FREQUENCY[1] + leak])
    phases = dataset(
        "phases",
        {"amplitude": amplitude, "phase": np.cumsum(speed, axis=1) * step, "phase_speed": speed},
        component=["1", "2", "1-2"],
    )
    correction = np.full((len(METHODS), count), np.nan)
    correction[[1, 2, 4, 5]] = -leak + 2e-6 * np.sin(0.3 * time)
    corrected = GRAVITY * ((speed[2] + correction) / FREQUENCY[1]) ** 2
    residual = 1e-5 * np.random.default_rng(8).normal(size=count)
    gravity = dataset(
        "gravity",
        {
            "gravity": GRAVITY + 1e-5 * ERRORS,
            "gravity_sigma": SIGMAS,
            "frequency": np.tile(FREQUENCY, (len(METHODS), 1)),
        },
        estimator=METHODS,
        pendulum=["1", "2"],
    )
    corrections = {"phase_speed_correction": correction, "corrected_gravity": corrected}
    read = {"residual": residual, "model": 0.01 * np.cos(time), "elongation": 0.01 * np.cos(time) + residual}
    frequency = np.linspace(0.0, 0.4, 65)
    return xr.DataTree.from_dict(
        {
            "/": root(time, "result", input_sha256="0" * 64, configuration="{}", versions="{}"),
            "/phases": phases,
            "/correction": dataset("correction", corrections, estimator=METHODS),
            "/gravity": gravity,
            "/difference": dataset("difference", read, record_time=time),
            "/spectrum": dataset("spectrum", {"residual_spectrum": np.full(65, 1e-11)}, frequency=frequency),
        }
    )


def made_period_result() -> xr.DataTree:
    from pipeline.period.cycles import arc_factor

    random = np.random.default_rng(3)
    amplitude = 1.6 * np.exp(-np.linspace(0.0, 3.5, 130))
    clean = 1.029 * arc_factor(amplitude) * (1.0 + 3e-4 * amplitude)
    table = dataset(
        "period",
        {
            "period": 1.029,
            "period_sigma": 3e-5,
            "cycle_time": np.cumsum(clean),
            "amplitude": amplitude,
            "cycle_period": clean + 8e-4 * random.normal(size=amplitude.size),
            "cycle_period_smoothed": clean,
            "cycle_period_infinitesimal": clean / arc_factor(amplitude),
        },
    )
    head = root(np.arange(0.0, 140.0, 0.01), "result", input_sha256="0" * 64, configuration="{}", versions="{}")
    return xr.DataTree.from_dict({"/": head, "/period": table})
