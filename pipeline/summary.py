"""A result as plain dictionaries, one for each method: the JSON objects of the command line."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from xarray import Dataset, DataTree


def summaries(result: DataTree) -> list[dict[str, Any]]:
    """One dictionary for each method of a result, in the order they were asked for.

    Keys are those of the contract but for `input` and `output`, which only the caller knows.
    """
    if "synchrony" in result.children:
        from pipeline.synchronism.recipe import synchrony_summaries

        return synchrony_summaries(result)
    if "gravity" not in result.children:
        from pipeline.period.result import period_summaries

        return period_summaries(result)
    table = result["gravity"].dataset
    pendulums = [str(label) for label in table["pendulum"].values]
    entries = [str(entry) for entry in table["entry"].values]
    rows = []
    for k in range(table.sizes["estimator"]):
        row = table.isel(estimator=k)
        good = str(row["status"].values) == "ok"
        rows.append(
            {
                "record_id": str(result.attrs["record_id"]),
                "status": str(row["status"].values),
                "error": None if good else str(row["error"].values),
                "requested_method": str(row["requested"].values),
                "method": str(row["resolved"].values),
                "gravity_m_s2": float(row["gravity"]),
                "gravity_sigma_mgal": float(row["gravity_sigma"]),
                "frequency_rad_s": dict(zip(pendulums, map(float, row["frequency"].values), strict=True)),
                "difference_frequency_rad_s": float(row["difference_frequency"]),
                "corrections_mgal": dict(zip(entries, map(float, row["value"].values), strict=True)),
                "uncorrected_m_s2": float(row["uncorrected"]),
                "noise_sigma_mgal": float(row["noise_sigma"]),
                "ledger": ledger(row),
                **{f"{name}_mgal": float(row[name]) for name in ("free_air_anomaly", "bouguer_anomaly") if name in row},
                "sensitivity_mgal": {
                    "frequency_difference_1e-7": float(row["sensitivity_frequency_difference"]),
                    "gain_1_percent": float(row["sensitivity_gain"]),
                },
                "budget": _budget(row),
                "advice": str(row["advice"].values) if "advice" in row else "",
                "flags": str(row["method_flags"].values).split(),
                "choice_reason": str(row["choice_reason"].values) or None,
                "samples_used": int(row["samples_used"]),
                "elapsed_s": float(row["elapsed"]),
            }
        )
    return rows


def _budget(row: Dataset) -> dict[str, float]:
    """Shares of the variance of gravity by source, the largest first; results of older versions have none."""
    if "share" not in row:
        return {}
    shares = zip(map(str, row["source"].values), map(float, row["share"].values), strict=True)
    return dict(sorted(((name, share) for name, share in shares if share > 0.0), key=lambda each: -each[1]))


def without_gravity(result: DataTree, requested: str, method: str) -> dict[str, Any]:
    """What every summary begins with, of an analysis that gives no gravity."""
    return {
        "record_id": str(result.attrs["record_id"]),
        "status": "ok",
        "error": None,
        "requested_method": requested,
        "method": method,
        "gravity_m_s2": None,
        "gravity_sigma_mgal": None,
        "frequency_rad_s": {},
        "difference_frequency_rad_s": None,
        "corrections_mgal": {},
        "sensitivity_mgal": {},
    }


def ledger(row: Dataset) -> list[dict[str, Any]]:
    """Entries of one method, in the order in which they were added."""
    fields = {"value_mgal": "value", "sigma_mgal": "sigma", "period_1e-7_s": "value_period"}
    return [
        {
            "entry": str(row["entry"].values[k]),
            **{key: float(row[name].values[k]) for key, name in fields.items()},
            "applied": bool(row["applied"].values[k]),
            "reason": str(row["reason"].values[k]),
            "input": str(row["input"].values[k]).split(),
            "formula": str(row["formula"].values[k]),
            "formula_source": str(row["formula_source"].values[k]),
        }
        for k in range(row.sizes["entry"])
    ]
