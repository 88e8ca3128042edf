"""Records made by hand, and their latent images."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr

from data_schemas.scene_recording import Film
from data_schemas.variables import attributes
from synth.film.layout import FilmPlan, plan_film
from synth.film.source import source_of
from synth.film.strips import Exposure

SMALL = {"paper_width": 25.0, "margin": 2.0, "lever": 500.0, "gap": 0.0}
"""A narrow film without marks: fast to make, also uncompiled."""


def record_of(*traces: Callable[[np.ndarray], np.ndarray], seconds: float = 3.0, rate: float = 50.0) -> xr.DataTree:
    """A record of elongations given as functions of time; it states nothing else."""
    time = np.arange(round(seconds * rate) + 1) / rate
    return record_from(time, np.array([trace(time) for trace in traces]))


def record_from(time: np.ndarray, elongation: np.ndarray) -> xr.DataTree:
    labels = [str(k + 1) for k in range(len(elongation))]
    data: dict[str, Any] = {
        "trace": (("trace",), np.array(labels), attributes("record/trace")),
        "pendulum": (("pendulum",), np.array(labels), attributes("record/pendulum")),
        "combination": (("trace", "pendulum"), np.eye(len(labels)), attributes("record/combination")),
        "elongation": (("trace", "time"), elongation, attributes("record/elongation")),
    }
    known = {
        "pendulum": (("pendulum",), np.array(labels), attributes("instrument/pendulum")),
        "period": (("pendulum",), np.full(len(labels), 1.01), attributes("instrument/period")),
        "reference_gravity": ((), 9.81, attributes("instrument/reference_gravity")),
    }
    groups = {
        "/": xr.Dataset({"time": ("time", time, attributes("time"))}),
        "/record": xr.Dataset(data),
        "/instrument": xr.Dataset(known),
    }
    tree = xr.DataTree.from_dict(groups)
    tree.attrs = {"schema": "isochrony-record", "schema_version": "1", "record_id": "hand"}
    return tree


def planned(film: Film, *traces: Callable[[np.ndarray], np.ndarray], seed: int = 3, **how: float) -> FilmPlan:
    return plan_film(source_of(record_of(*traces, **how)), film, seed)


def latent(plan: FilmPlan) -> np.ndarray:
    """The whole latent image: exposure of every pixel."""
    exposure = Exposure(plan)
    strips = -(-plan.geometry.rows // 1024)
    return np.concatenate([exposure.strip(number)[0] for number in range(strips)])


def crossings(plan: FilmPlan) -> list[np.ndarray]:
    """Time, elongation, column and slope of every row, (traces, rows) each."""
    exposure = Exposure(plan)
    found = [exposure.strip(number)[1] for number in range(-(-plan.geometry.rows // 1024))]
    names = ("time", "elongation", "column", "slope")
    return [np.concatenate([getattr(each, name) for each in found], axis=1) for name in names]


def swing(amplitude: float = 0.012, period: float = 1.0, phase: float = 0.3) -> Callable[[np.ndarray], np.ndarray]:
    return lambda time: amplitude * np.cos(2 * np.pi * time / period + phase)


def rest(time: np.ndarray) -> np.ndarray:
    return np.zeros(time.size)


def ramp(rate: float, start: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda time: start + rate * time
