"""A result as a person asks for it: dictionaries, one for each method, and `result.isochrony` on xarray's tree."""

import html
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import xarray as xr
from xarray import DataTree

from pipeline.flag_words import told

if TYPE_CHECKING:
    from matplotlib.figure import Figure

UNSURE = 0.95  # of a verdict, below which it is flagged
_SUMMED = {
    "confidence": "confidence", "angle_rad": "locked_angle", "angle_sigma_rad": "locked_angle_sigma",
    "lock_time_s": "lock_time", "slips": "slips", "rate_difference_per_day": "mean_rate_difference",
    "rate_difference_sigma_per_day": "mean_rate_difference_sigma", "amplitude_ratio": "amplitude_ratio",
}  # fmt: skip
_NUMBERS = {
    "gravity_m_s2": "gravity", "gravity_sigma_mgal": "gravity_sigma", "elapsed_s": "elapsed",
    "difference_frequency_rad_s": "difference_frequency", "uncorrected_m_s2": "uncorrected",
    "noise_sigma_mgal": "noise_sigma", "free_air_anomaly_mgal": "free_air_anomaly",
    "bouguer_anomaly_mgal": "bouguer_anomaly",
}  # fmt: skip
_ENTRY: dict[str, tuple[str, Callable[[Any], Any]]] = {
    "entry": ("entry", str), "value_mgal": ("value", float), "sigma_mgal": ("sigma", float),
    "period_1e-7_s": ("value_period", float), "applied": ("applied", bool), "reason": ("reason", str),
    "input": ("input", lambda names: str(names).split()), "formula": ("formula", str),
    "formula_source": ("formula_source", str),
}  # fmt: skip
"""Keys of a method and of an entry of its ledger, by variables of /gravity."""
SHOWN = ("method", "gravity_m_s2", "gravity_sigma_mgal", "uncorrected_m_s2", "status")


def summaries(result: DataTree) -> list[dict[str, Any]]:
    """One dictionary for each method of a result, in the order they were asked for.

    Keys are those of the contract but for `input` and `output`, which only the caller knows.
    """
    if "synchrony" in result.children:
        return _of_synchrony(result)
    if "gravity" not in result.children:
        return _of_period(result)
    table = result["gravity"].dataset.variables
    pendulums, entries = ([str(label) for label in table[name].values] for name in ("pendulum", "entry"))
    methods = {str(name): each.values for name, each in table.items() if each.dims[:1] == ("estimator",)}
    shared = {name: table[name].values for name in ("entry", "formula", "formula_source")}
    sources = [str(name) for name in table["source"].values] if "source" in table else []
    rows = []
    for k in range(len(methods["estimator"])):
        row = {name: values[k] for name, values in methods.items()} | shared
        shares = sorted(zip(sources, map(float, row.get("share", ())), strict=False), key=lambda each: -each[1])
        rows.append(
            {
                "record_id": str(result.attrs["record_id"]),
                "status": str(row["status"]),
                "error": None if str(row["status"]) == "ok" else str(row["error"]),
                "requested_method": str(row["requested"]),
                "method": str(row["resolved"]),
                **{key: float(row[name]) for key, name in _NUMBERS.items() if name in row},
                "frequency_rad_s": dict(zip(pendulums, map(float, row["frequency"]), strict=True)),
                "corrections_mgal": dict(zip(entries, map(float, row["value"]), strict=True)),
                "ledger": [{key: of(row[name][j]) for key, (name, of) in _ENTRY.items()} for j in range(len(entries))],
                "sensitivity_mgal": {
                    "frequency_difference_1e-7": float(row["sensitivity_frequency_difference"]),
                    "gain_1_percent": float(row["sensitivity_gain"]),
                },
                "budget": {name: share for name, share in shares if share > 0.0},  # the largest first
                "advice": str(row.get("advice", "")),
                "flags": str(row["method_flags"]).split(),
                "choice_reason": str(row["choice_reason"]) or None,
                "samples_used": int(row["samples_used"]),
            }
        )
    return rows


def _without_gravity(result: DataTree, requested: str, method: str) -> dict[str, Any]:
    """What every summary begins with, of an analysis that gives no gravity."""
    said = {"record_id": str(result.attrs["record_id"]), "status": "ok", "error": None}
    said |= {"requested_method": requested, "method": method}
    none = dict.fromkeys(("gravity_m_s2", "gravity_sigma_mgal", "difference_frequency_rad_s"))
    return said | none | {"frequency_rad_s": {}, "corrections_mgal": {}, "sensitivity_mgal": {}}


def _of_period(result: DataTree) -> list[dict[str, Any]]:
    """The one dictionary of a single trace; keys of the contract, gravity null."""
    table = result["period"].dataset
    given = {
        "gravity_m_s2": "gravity", "gravity_sigma_mgal": "gravity_sigma", "period_s": "period",
        "period_sigma_s": "period_sigma", "amplitude_scale": "amplitude_scale",
        "amplitude_scale_sigma": "amplitude_scale_sigma", "rest_position_rad": "rest_position",
    }  # fmt: skip
    values = {key: float(table[name]) for key, name in given.items() if name in table}
    flags = [str(flag) for flag in table["flag"].values] if "flag" in table else []
    more = {"friction": str(table["friction"].values), "flags": flags, "samples_used": int(table.sizes["cycle"])}
    none = _without_gravity(result, str(result.attrs.get("requested_method", "auto")), "period")
    return [none | values | more | {"elapsed_s": float(table["elapsed"])}]


def _of_synchrony(result: DataTree) -> list[dict[str, Any]]:
    """One dictionary a pair; keys of the contract, gravity null, and `synchrony` with what was found."""
    table = result["synchrony"].dataset
    clocks = [str(label) for label in table["clock"].values]
    rows, of_film_too = [], [flag for flag in table.attrs.get("film_flags", "").split(", ") if flag]
    for k, name in enumerate(str(pair) for pair in table["pair"].values):
        one = table.isel(pair=k)
        seen = {key: float(one[own]) for key, own in _SUMMED.items()}
        found: dict[str, Any] = {"pair": name, "verdict": str(one["verdict"].values)}
        found |= {key: None if math.isnan(value) else value for key, value in seen.items()}
        found["slips"] = int(one["slips"])
        found["beam_amplitude_m"] = float(table["beam_amplitude"]) if "beam_amplitude" in table else None
        more = {
            "frequency_rad_s": dict(zip(clocks, map(float, table["frequency"].values), strict=True)),
            "synchrony": found,
            "flags": ["unsure-verdict"] * (float(one["confidence"]) < UNSURE) + of_film_too,
            "samples_used": int(np.isfinite(one["phase_difference"].values).sum()),
            "elapsed_s": float(result.attrs["elapsed_s"]),
        }
        rows.append(_without_gravity(result, "synchrony", "synchrony") | more)
    return rows


@xr.register_datatree_accessor("isochrony")
class Isochrony:
    """Of a DataTree with the layout "isochrony-result"; it is there once `pipeline` was used, or this is imported.

    Examples
    --------
    >>> result = xr.DataTree(name="any")
    >>> type(result.isochrony).__name__
    'Isochrony'
    """

    def __init__(self, tree: xr.DataTree) -> None:
        self._tree = tree

    def summary(self) -> list[dict[str, Any]]:
        """One dictionary for each method: the JSON objects of the command line."""
        return summaries(self._tree)

    def table(self) -> pd.DataFrame:
        """One row for each method; further results can be put beneath it with `pandas.concat`."""
        return pd.DataFrame(self.summary()).set_index(["record_id", "method"])

    def plot(self, *, true_gravity: float | None = None) -> "Figure":
        """The picture of `isochrony plot`."""
        from pipeline.plots.result import result_figure

        return result_figure(self._tree, true_gravity=true_gravity)

    def _repr_html_(self) -> str:
        rows = self.summary()
        flags = dict.fromkeys(flag for row in rows for flag in row["flags"])
        words = "".join(f"<li><b>{html.escape(flag)}</b>: {html.escape(told(flag))}</li>" for flag in flags)
        best = next((row for row in reversed(rows) if row["gravity_m_s2"] is not None), None)
        lead = "no gravity"
        if best is not None:
            band = f"g = {best['gravity_m_s2']:.8f} ± {best['gravity_sigma_mgal'] * 1e-5:.8f} m/s²"
            lead = f"{band} by {html.escape(str(best['method']))}"
        name = html.escape(str(self._tree.attrs.get("record_id", "")))
        table = self.table().reset_index()[list(SHOWN)].to_html(index=False)
        return f"<p><b>{name}</b>: {lead}</p><ul>{words}</ul>{table}"
