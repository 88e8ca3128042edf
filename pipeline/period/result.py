"""The result of a record with a single trace: its period."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from data_schemas.contents import Contents
from data_schemas.variables import dataset
from pipeline.conditions import DAY, MGAL
from pipeline.observation import clock_of
from pipeline.period.cycles import find_cycles
from pipeline.period.fit import SCALE, fit_period
from pipeline.result import EXTRA, result_attributes

if TYPE_CHECKING:
    from xarray import DataTree

TREND = 1e-3  # relative drift of the reduced period that is flagged


def period_result(
    record: DataTree, contents: Contents, requested: Sequence[str], started: float, raised: Sequence[str] = ()
) -> DataTree:
    """Lay out the analysis of a record's only trace, with flags that are `raised` before; `RefusedError`: too short."""
    from xarray import Dataset, DataTree

    time = np.asarray(record.dataset["time"].values, dtype=np.float64)
    elongation = np.asarray(record["record"].dataset["elongation"].values[0], dtype=np.float64)
    instrument = record["instrument"].dataset if "instrument" in record.children else Dataset()
    linear = instrument.attrs.get("restoring") == "linear"
    stated = {name: each.values for name, each in instrument.data_vars.items()}
    scale = float(np.max(stated.get("scale_uncertainty", SCALE)))
    fit = fit_period(find_cycles(time - time[0], elongation), linear=linear, scale_uncertainty=scale)
    true = 1.0 + float(stated.get("chronometer_rate", 0.0)) / DAY
    rates = float(stated.get("chronometer_rate_uncertainty", 0.0)) / DAY, *clock_of(record).values()
    sigma = float(np.linalg.norm([fit["period_sigma"], *(fit["period"] * rate for rate in rates)])) * true
    found = {
        "amplitude-scale": fit.pop("scaled"),
        "correction-without-uncertainty": "length" in stated and "length_uncertainty" not in stated,
        "period-trend": fit["trend"] > TREND,
    }
    values = fit | {
        "period": fit["period"] * true,
        "period_sigma": sigma,
        "cycle_time": fit["cycle_time"] + time[0],
        **_gravity(fit["period"] * true, sigma, stated),
        **_steps(time, elongation),
        "elapsed": clock.perf_counter() - started,
        "flag": ["single-trace", *raised, *(name for name, raises in found.items() if raises)],
    }
    root = Dataset(coords={"time": ("time", time[[0, -1]], dict(record.dataset["time"].attrs))})
    tree = DataTree.from_dict({"/": root, "/period": dataset("period", values, {}, EXTRA["period"])})
    trace = str(record["record"].dataset["trace"].values[0])
    tree.attrs.update(result_attributes(contents, {"trace": trace, "methods": ["period"]}, started))
    tree.attrs["requested_method"] = ",".join(requested)
    tree.attrs["title"] = f"period of record {tree.attrs['record_id']}"
    return tree


def _gravity(period: float, sigma: float, stated: Mapping[Any, Any]) -> dict[str, float]:
    """g = l (2 pi/T)^2, where the instrument states the length of its only pendulum."""
    if "length" not in stated or np.size(stated["length"]) != 1:
        return {}
    length = float(np.ravel(stated["length"])[0])
    own = float(np.ravel(stated.get("length_uncertainty", 0.0))[0])
    value = length * (2.0 * np.pi / period) ** 2
    return {"gravity": value, "gravity_sigma": value / MGAL * float(np.hypot(own / length, 2.0 * sigma / period))}


def _steps(time: np.ndarray, elongation: np.ndarray) -> dict[str, float]:
    """Quantisation of angle and clock, as found: they explain the scatter of single cycles."""
    changes = np.abs(np.diff(elongation[np.isfinite(elongation)]))
    changes = changes[changes > 0.0]
    steps = np.diff(time)
    usual = steps[steps < 5.0 * np.median(steps)]
    least = float(changes.min()) if changes.size else 0.0
    return {"angle_step": least, "time_step_least": float(usual.min()), "time_step_most": float(usual.max())}
