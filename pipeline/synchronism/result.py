"""What was found of clocks as a DataTree of the layout "isochrony-result"."""

from __future__ import annotations

import math
import time as stopwatch
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from data_schemas.variables import VARIABLES, attributes
from pipeline.arrays import Floats
from pipeline.result import result_attributes
from pipeline.synchronism import allan
from pipeline.synchronism.allan import REMEDY
from pipeline.synchronism.phases import Beam, Phases
from pipeline.synchronism.verdict import Verdict

if TYPE_CHECKING:
    from xarray import DataTree

UNSURE = 0.95


class Pair(NamedTuple):
    """Two clocks."""

    name: str
    psi: Floats
    sigma: Floats
    verdict: Verdict
    amplitude_ratio: float


class Found(NamedTuple):
    """All of a record."""

    labels: list[str]
    phases: Phases
    pairs: list[Pair]
    beam: Beam | None
    allan: tuple[Floats, Floats] | None
    """Averaging times and deviations; None without allantools."""
    start: float
    """Time of the first reading, s."""


def laid_out(record: DataTree, found: Found, started: float) -> DataTree:
    """Lay out phases, verdicts and stability."""
    from xarray import Dataset, DataTree

    seen, pairs = found.phases, found.pairs
    means = [allan.mean(seen.time, each.psi) for each in pairs]
    verdicts = [each.verdict for each in pairs]
    begun = found.start + float(seen.time[0])  # verdicts count from the first instant
    values: dict[str, Any] = {
        "clock": _texts(found.labels),
        "pair": _texts([each.name for each in pairs]),
        "phase": seen.phase,
        "amplitude": seen.amplitude,
        "frequency": seen.frequency,
        "phase_difference": np.stack([each.psi for each in pairs]),
        "phase_difference_sigma": np.stack([each.sigma for each in pairs]),
        "rate_difference": np.stack([allan.instantaneous(seen.time, each.psi) for each in pairs]),
        "mean_rate_difference": np.array([mean for mean, _ in means]),
        "mean_rate_difference_sigma": np.array([sigma for _, sigma in means]),
        "verdict": _texts([each.state for each in verdicts]),
        "confidence": np.array([each.confidence for each in verdicts]),
        "locked_angle": np.array([each.angle for each in verdicts]),
        "locked_angle_sigma": np.array([each.angle_sigma for each in verdicts]),
        "lock_time": np.array([each.lock_time + begun for each in verdicts]),
        "slips": np.array([float(len(each.slips)) for each in verdicts]),
        "amplitude_ratio": np.array([each.amplitude_ratio for each in pairs]),
    }
    slips = [(when + found.start, each.name) for each in pairs for when in each.verdict.slips]
    if slips:
        values["slip_time"] = np.array([when for when, _ in slips])
        values["slip_pair"] = _texts([name for _, name in slips])
    if found.beam is not None:
        values["beam_amplitude"], values["beam_ratio"] = found.beam.amplitude, found.beam.ratio
    if found.allan is not None and found.allan[0].size:
        values["averaging_time"], values["allan_deviation"] = found.allan
    variables = {
        name: (VARIABLES[f"synchrony/{name}"].dims, value, attributes(f"synchrony/{name}"))
        for name, value in values.items()
    }
    group = Dataset(variables)
    group.attrs["allan_deviation_absent"] = REMEDY if found.allan is None else ""
    group.attrs["beam_direction"] = "" if found.beam is None else found.beam.direction
    time = ("time", seen.time + found.start, dict(record.dataset["time"].attrs))
    tree = DataTree.from_dict({"/": Dataset(coords={"time": time}), "/synchrony": group})
    tree.attrs.update(result_attributes(record, {"analysis": "synchrony", "window_s": seen.window}, started))
    tree.attrs["title"] = f"synchrony of record {tree.attrs['record_id']}"
    tree.attrs["elapsed_s"] = stopwatch.perf_counter() - started
    return tree


def _texts(values: list[str]) -> Any:
    return np.array(values, dtype=object)


def synchrony_summaries(result: DataTree) -> list[dict[str, Any]]:
    """One dictionary a pair; keys of the contract, gravity null, and `synchrony` with what was found."""
    table = result["synchrony"].dataset
    clocks = [str(label) for label in table["clock"].values]
    rows = []
    for k, name in enumerate(str(pair) for pair in table["pair"].values):
        one = table.isel(pair=k)
        rows.append(
            {
                "record_id": str(result.attrs["record_id"]),
                "status": "ok",
                "error": None,
                "requested_method": "synchrony",
                "method": "synchrony",
                "gravity_m_s2": None,
                "gravity_sigma_mgal": None,
                "frequency_rad_s": dict(zip(clocks, map(float, table["frequency"].values), strict=True)),
                "difference_frequency_rad_s": None,
                "corrections_mgal": {},
                "sensitivity_mgal": {},
                "synchrony": {
                    "pair": name,
                    "verdict": str(one["verdict"].values),
                    "confidence": float(one["confidence"]),
                    "angle_rad": _known(float(one["locked_angle"])),
                    "angle_sigma_rad": _known(float(one["locked_angle_sigma"])),
                    "lock_time_s": _known(float(one["lock_time"])),
                    "slips": int(one["slips"]),
                    "rate_difference_per_day": float(one["mean_rate_difference"]),
                    "rate_difference_sigma_per_day": float(one["mean_rate_difference_sigma"]),
                    "amplitude_ratio": float(one["amplitude_ratio"]),
                    "beam_amplitude_m": float(table["beam_amplitude"]) if "beam_amplitude" in table else None,
                },
                "flags": ["unsure-verdict"] if float(one["confidence"]) < UNSURE else [],
                "samples_used": int(np.isfinite(one["phase_difference"].values).sum()),
                "elapsed_s": float(result.attrs["elapsed_s"]),
            }
        )
    return rows


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value
