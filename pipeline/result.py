"""The result of a record as a DataTree of the layout "isochrony-result": gravity, or the period of a single trace."""

import json
import time as clock
from collections.abc import Mapping, Sequence
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from xarray import Dataset, DataTree

from data_schemas.checksum import ATTRIBUTE, digest, numbers_sha256
from data_schemas.contents import Contents
from data_schemas.layouts import root_attributes
from data_schemas.variables import dataset
from pipeline import quantities
from pipeline.arrays import Floats
from pipeline.conditions import DAY, MGAL, Constants
from pipeline.flag_words import told
from pipeline.ledger.book import corrections
from pipeline.ledger.earth import anomalies
from pipeline.observation import clock_of, combine, weights_of
from pipeline.prepared import Prepared
from pipeline.provenance import command_line, versions
from pipeline.reduction import Reduction

if TYPE_CHECKING:
    from pipeline.joint.reduction import Joint

TREND = 1e-3  # relative drift of the reduced period that is flagged
_EXTRA = json.loads(Path(__file__).with_name("result_variables.json").read_text(encoding="utf-8"))
"""Units and meanings of what results have beside the table of variables, by group."""

_NUMBERS = {
    "gravity_sigma": "gravity.sigma", "noise_sigma": "gravity.noise", "uncorrected": "gravity.uncorrected",
    "sensitivity_frequency_difference": "gravity.per_ratio", "sensitivity_gain": "gravity.per_gain",
    "reading_noise": "estimate.noise", "damping_rate": "estimate.damping_rate",
    "difference_frequency": "estimate.uncorrected",
}  # fmt: skip
_TEXTS = {"requested": "requested", "resolved": "method", "error": "error", "choice_reason": "reason"}
"""Variables of /gravity, by where a reduction has them."""


def build_result(
    record: DataTree, contents: Contents, prepared: Prepared, own: Prepared | None, reductions: Sequence[Reduction],
    joint: "Joint | None", *, full: bool, bare: bool, started: float,
) -> DataTree:  # fmt: skip
    """Lay out gravity, phases, corrections, course, residual and provenance.

    `contents` are those of the record; phases and corrections are drawn from `prepared`; `own` is what methods of one
    difference looked at, where it is another one. `full`: the pendulums' angles at the record's own times are laid out
    too; `bare`: gravity alone is. `started` is by `time.perf_counter`.
    """
    seen, of_time = prepared.observation, dict(record.dataset.variables["time"].attrs)
    pendulums, names = [seen.first, seen.second], _labels(reductions)
    recorded = np.asarray(record.dataset.variables["time"].values, dtype=np.float64)
    gravity = _gravity(reductions, pendulums, names, seen.constants, float(recorded[[0, -1]].mean()))
    gravity.variables["epoch"].attrs["units"] = of_time["units"]
    groups: dict[str, Dataset] = {"gravity": gravity}
    time = gravity.variables["epoch"].values[:1]
    if not bare:
        time = prepared.sliding.time + seen.start
        read, model, residual = _difference(record, prepared, joint, recorded)
        known = recorded[np.isfinite(read)] - seen.start
        phases, components = quantities.phases(prepared, reductions, known), [*pendulums, "-".join(pendulums)]
        groups["phases"] = dataset("phases", phases, {"component": components, "formula": quantities.FORMULAS})
        groups["correction"] = dataset(
            "correction", quantities.correction(prepared, reductions, own), {"estimator": names}
        )
        if joint is not None:
            course, told = joint.course(time)
            groups["course"] = dataset("course", course).assign_attrs(told)
            groups["ship"] = dataset("ship", joint.ship(time))
        difference = {"elongation": read, "model": model, "residual": residual}
        groups["difference"] = dataset("difference", difference, {"record_time": recorded})
        groups["spectrum"] = dataset("spectrum", *quantities.spectrum(recorded, residual))
        if full and joint is not None:
            angles = {"theta": joint.pendulums(recorded)}
            groups["pendulums"] = dataset("pendulums", angles, {"pendulum": pendulums, "record_time": recorded})
        for name in groups.keys() & {"difference", "pendulums"}:
            groups[name].variables["record_time"].attrs["units"] = of_time["units"]
    tree = DataTree(Dataset(coords={"time": ("time", time, of_time)}))
    tree.children = {name: DataTree(group) for name, group in groups.items()}  # `from_dict` copies twice
    configuration = {"pair": "-".join(pendulums), "methods": names}
    tree.attrs.update(result_attributes(contents, configuration, started))
    tree.attrs["numbers_sha256"] = numbers_sha256(tree)
    return tree


def _difference(
    record: DataTree, prepared: Prepared, joint: "Joint | None", time: Floats
) -> tuple[Floats, Floats, Floats]:
    """The difference as it was read, as it is fitted, and what is left, at the record's own times."""
    stored, seen = record["record"].dataset.variables, prepared.observation
    labels = [str(label) for label in stored["pendulum"].values]
    one, two = (np.eye(len(labels))[labels.index(label)] for label in (seen.first, seen.second))
    weights = weights_of(np.asarray(stored["combination"].values), one - two, f"{seen.first}-{seen.second}")
    read = combine(weights, np.asarray(stored["elongation"].values, dtype=np.float64))
    if joint is None:
        model = quantities.model_of_harmonics(prepared, time - seen.start)
        return read, model, read - model
    residual, swing = joint.residual(weights, time), joint.pendulums(time)
    return read, np.where(np.isfinite(residual), read - residual, swing[0] - swing[1]), residual


def result_attributes(record: Contents, configuration: Mapping[str, Any], started: float) -> dict[str, Any]:
    """Root attributes: identity, provenance, configuration and time taken."""
    attrs = record[""].attrs
    record_id = str(attrs.get("record_id", ""))
    return {
        **root_attributes("result", record_id),
        "title": f"gravity of record {record_id}",
        "source": "isochrony process",
        "configuration": json.dumps(dict(configuration), sort_keys=True),
        "input_sha256": str(attrs.get(ATTRIBUTE) or digest(record)),
        "versions": versions(),
        "command": command_line(),
        "history": "made by isochrony process",
        "elapsed_s": clock.perf_counter() - started,
    }


def _gravity(
    reductions: Sequence[Reduction], pendulums: list[str], names: list[str], constants: Constants, epoch: float
) -> Dataset:
    nan, every = float("nan"), corrections()
    entries = [module.NAME for module in every]

    def column(pick: Any, missing: Any = nan) -> np.ndarray:
        return np.array([pick(r) if r.gravity else missing for r in reductions])

    def ledger(field: str, missing: Any) -> np.ndarray:
        return column(lambda r: [getattr(r.gravity.ledger[e], field) for e in entries], [missing] * len(entries))

    sources = sorted({name for r in reductions if r.gravity for name in r.gravity.budget})
    raised = sorted({flag for r in reductions for flag in r.flags})
    gravity, value = column(lambda r: r.gravity.gravity), ledger("value", nan)
    # change of the second pendulum's full period, 1e-7 s, that a milligal stands for: dT = -T dg/2g
    per_milligal = column(lambda r: -np.pi / r.gravity.frequency[1] * MGAL / r.gravity.gravity * 1e7)
    variables: dict[str, Any] = {
        "gravity": gravity,
        "epoch": np.full(len(names), epoch),
        "frequency": column(lambda r: r.gravity.frequency, (nan, nan)),
        "value": value,
        "sigma": ledger("sigma", nan),
        "value_period": value * per_milligal[:, None],
        "applied": ledger("applied", False).astype(np.uint8),
        "reason": ledger("reason", "the method refused").astype(object),
        "input": ledger("inputs", "").astype(object),
        "formula": [module.FORMULA for module in every],
        "formula_source": [module.SOURCE for module in every],
        **anomalies(constants, gravity),
        "status": ["ok" if r.gravity else "refused" for r in reductions],
        "method_flags": [" ".join(r.flags) for r in reductions],
        "samples_used": column(lambda r: r.estimate.samples, 0).astype(np.int64),
        "elapsed": np.array([r.elapsed for r in reductions]),
        **{name: column(attrgetter(place)) for name, place in _NUMBERS.items()},
        **{name: [getattr(r, field) for r in reductions] for name, field in _TEXTS.items()},
        "share": column(lambda r: [r.gravity.budget.get(s, 0.0) for s in sources], [nan] * len(sources)),
        "advice": [r.gravity.advice if r.gravity else "" for r in reductions],
    }
    if raised:
        variables |= {"flag": raised, "flag_meaning": [told(name) for name in raised]}
    coordinates: dict[str, Any] = {"estimator": names, "pendulum": pendulums, "entry": entries, "source": sources}
    return dataset("gravity", variables, coordinates, _EXTRA["gravity"], ("estimator",))


def _labels(reductions: Sequence[Reduction]) -> list[str]:
    """Name of each row: the method, or `auto` where it chose one that was asked for by name as well."""
    named = {reduction.method for reduction in reductions if reduction.requested != "auto"}
    return [r.requested if r.requested == "auto" and r.method in named else r.method for r in reductions]


def period_result(
    record: DataTree, contents: Contents, requested: Sequence[str], started: float, raised: Sequence[str] = ()
) -> DataTree:
    """Lay out the analysis of a record's only trace, with flags that are `raised` before; `RefusedError`: too short."""
    from pipeline.period.cycles import find_cycles
    from pipeline.period.fit import SCALE, fit_period

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
        **_by_length(fit["period"] * true, sigma, stated),
        **_steps(time, elongation),
        "elapsed": clock.perf_counter() - started,
        "flag": ["single-trace", *raised, *(name for name, raises in found.items() if raises)],
    }
    root = Dataset(coords={"time": ("time", time[[0, -1]], dict(record.dataset["time"].attrs))})
    tree = DataTree.from_dict({"/": root, "/period": dataset("period", values, {}, _EXTRA["period"])})
    trace = str(record["record"].dataset["trace"].values[0])
    tree.attrs.update(result_attributes(contents, {"trace": trace, "methods": ["period"]}, started))
    tree.attrs["requested_method"] = ",".join(requested)
    tree.attrs["title"] = f"period of record {tree.attrs['record_id']}"
    return tree


def _by_length(period: float, sigma: float, stated: Mapping[Any, Any]) -> dict[str, float]:
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
