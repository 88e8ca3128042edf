"""A result of clocks as plain dictionaries, one for each pair: the JSON objects of the command line."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from xarray import DataTree

UNSURE = 0.95


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
