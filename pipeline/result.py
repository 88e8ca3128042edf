"""The result of a record as a DataTree of the layout "isochrony-result"."""

from __future__ import annotations

import json
import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from data_schemas.checksum import numbers_sha256
from data_schemas.layouts import root_attributes
from data_schemas.variables import dataset
from pipeline import quantities
from pipeline.anomaly import anomalies
from pipeline.arrays import Floats
from pipeline.conditions import Constants
from pipeline.flag_words import told
from pipeline.ledger.book import corrections
from pipeline.ledger.entry import MGAL
from pipeline.observation import combine, weights_of
from pipeline.prepared import Prepared
from pipeline.provenance import provenance
from pipeline.reduction import Reduction

if TYPE_CHECKING:
    from xarray import Dataset, DataTree

    from pipeline.joint.reduction import Joint

_EXTRA = {
    "requested": ("1", "method that was asked for"),
    "resolved": ("1", "method that was used"),
    "status": ("1", "ok, or refused"),
    "error": ("1", "why the method refused"),
    "choice_reason": ("1", "what the joint fit found in the record"),
    "method_flags": ("1", "flags of the method, separated by blanks"),
    "samples_used": ("1", "samples of the difference that were used"),
    "reading_noise": ("rad", "white reading noise found in the difference, 1 sigma"),
    "damping_rate": ("s-1", "damping rate of the second pendulum, stated or found"),
    "difference_frequency": ("rad s-1", "mean phase speed of the difference, uncorrected"),
    "sensitivity_frequency_difference": ("mGal", "change of gravity if (n1-n2)/n2 were larger by 1e-7"),
    "sensitivity_gain": ("mGal", "change of gravity if the first trace's gain were larger by 1 %"),
    "elapsed": ("s", "time the method took"),
}


@dataclass(frozen=True)
class Parts:
    """What a result is made from."""

    record: DataTree
    prepared: Prepared  # that phases and corrections are drawn from
    own: Prepared | None  # that which methods of one difference looked at, where it is another one
    reductions: Sequence[Reduction]  # in the order they were asked for
    joint: Joint | None
    full: bool  # whether the pendulums' angles at the record's own times are laid out too
    bare: bool = False  # whether gravity alone is laid out


def build_result(parts: Parts, started: float) -> DataTree:
    """Lay out gravity, phases, corrections, course, residual and provenance."""
    from xarray import Dataset, DataTree

    record, reductions, seen = parts.record, parts.reductions, parts.prepared.observation
    components, names = [seen.first, seen.second, f"{seen.first}-{seen.second}"], _labels(reductions)
    gravity = _gravity(reductions, components, names, seen.constants, record)
    of_time = dict(record.dataset["time"].attrs)
    gravity["epoch"].attrs["units"] = of_time["units"]
    if parts.bare:
        groups = {"/": Dataset(coords={"time": ("time", gravity["epoch"].values[:1], of_time)}), "/gravity": gravity}
    else:
        groups = _of_time(parts, components, names, gravity)
    tree = DataTree(groups.pop("/"))
    tree.children = {path.strip("/"): DataTree(group) for path, group in groups.items()}  # `from_dict` copies twice
    tree.attrs.update(result_attributes(record, {"pair": components[2], "methods": names}, started))
    tree.attrs["numbers_sha256"] = numbers_sha256(tree)
    return tree


def _of_time(parts: Parts, components: list[str], names: list[str], gravity: Dataset) -> dict[str, Dataset]:
    """All groups, those that are series of time among them."""
    from xarray import Dataset

    record, prepared, reductions, joint = parts.record, parts.prepared, parts.reductions, parts.joint
    seen, of_time = prepared.observation, dict(record.dataset["time"].attrs)
    time = prepared.sliding.time + seen.start
    record_time = np.asarray(record.dataset["time"].values, dtype=np.float64)
    difference = _difference(parts, record_time)
    known = record_time[np.isfinite(difference["elongation"])] - seen.start
    of_phases = quantities.phases(prepared, reductions, known)
    corrected = quantities.correction(prepared, reductions, parts.own)
    groups: dict[str, Any] = {
        "/": Dataset(coords={"time": ("time", time, of_time)}),
        "/gravity": gravity,
        "/phases": dataset("phases", of_phases, {"component": components, "formula": quantities.FORMULAS}),
        "/correction": dataset("correction", corrected, {"estimator": names}),
    }
    if joint is not None:
        course, told = joint.course(time)
        groups["/course"] = dataset("course", course).assign_attrs(told)
        groups["/ship"] = dataset("ship", joint.ship(time))
    groups["/difference"] = dataset("difference", difference, {"record_time": record_time})
    groups["/spectrum"] = dataset("spectrum", *quantities.spectrum(record_time, difference["residual"]))
    if parts.full and joint is not None:
        angle = {"theta": joint.pendulums(record_time)}
        groups["/pendulums"] = dataset("pendulums", angle, {"pendulum": components[:2], "record_time": record_time})
    for where in ("/difference", "/pendulums"):
        if where in groups:
            groups[where]["record_time"].attrs["units"] = of_time["units"]
    return groups


def _difference(parts: Parts, time: Floats) -> dict[str, Floats]:
    """The difference as it was read, as it is fitted, and what is left, at the record's own times."""
    stored, seen = parts.record["record"].dataset, parts.prepared.observation
    labels = [str(label) for label in stored["pendulum"].values]
    one, two = (np.eye(len(labels))[labels.index(label)] for label in (seen.first, seen.second))
    weights = weights_of(np.asarray(stored["combination"].values), one - two, f"{seen.first}-{seen.second}")
    read = combine(weights, np.asarray(stored["elongation"].values, dtype=np.float64))
    if parts.joint is None:
        model = quantities.model_of_harmonics(parts.prepared, time - seen.start)
        return {"elongation": read, "model": model, "residual": read - model}
    residual, swing = parts.joint.residual(weights, time), parts.joint.pendulums(time)
    return {
        "elongation": read,
        "model": np.where(np.isfinite(residual), read - residual, swing[0] - swing[1]),
        "residual": residual,
    }


def result_attributes(record: DataTree, configuration: Mapping[str, Any], started: float) -> dict[str, Any]:
    """Root attributes: identity, provenance, configuration and time taken."""
    record_id = str(record.attrs.get("record_id", ""))
    return {
        **root_attributes("result", record_id),
        "title": f"gravity of record {record_id}",
        "source": "isochrony process",
        "configuration": json.dumps(dict(configuration), sort_keys=True),
        **provenance(record),
        "elapsed_s": clock.perf_counter() - started,
    }


def _gravity(
    reductions: Sequence[Reduction], components: list[str], names: list[str], constants: Constants, record: DataTree
) -> Any:
    nan = float("nan")
    every = corrections()
    entries = [module.NAME for module in every]

    def column(pick: Any, missing: Any = nan) -> np.ndarray:
        return np.array([pick(r) if r.gravity else missing for r in reductions])

    def ledger(field: str, missing: Any) -> np.ndarray:
        return np.array(
            [[getattr(r.gravity.ledger[e], field) if r.gravity else missing for e in entries] for r in reductions]
        )

    pendulums = components[:2]
    raised = sorted({flag for r in reductions for flag in r.flags})
    variables: dict[str, Any] = {
        "gravity": column(lambda r: r.gravity.gravity),
        "gravity_sigma": column(lambda r: r.gravity.sigma),
        "epoch": np.full(len(names), float(record.dataset["time"].values[[0, -1]].mean())),
        "frequency": column(lambda r: r.gravity.frequency, (nan, nan)),
        "value": ledger("value", nan),
        "sigma": ledger("sigma", nan),
        "value_period": ledger("value", nan) * column(_period_for_milligal)[:, None],
        "applied": ledger("applied", False).astype(np.uint8),
        "reason": ledger("reason", "the method refused").astype(object),
        "input": ledger("input_names", "").astype(object),
        "formula": _text(module.FORMULA for module in every),
        "formula_source": _text(module.SOURCE for module in every),
        "noise_sigma": column(lambda r: r.gravity.noise),
        "uncorrected": column(lambda r: r.gravity.uncorrected),
        **anomalies(constants, column(lambda r: r.gravity.gravity)),
        "requested": _text(r.requested for r in reductions),
        "resolved": _text(r.method for r in reductions),
        "status": _text("ok" if r.gravity else "refused" for r in reductions),
        "error": _text(r.error for r in reductions),
        "choice_reason": _text(r.reason for r in reductions),
        "method_flags": _text(" ".join(r.flags) for r in reductions),
        "samples_used": column(lambda r: r.estimate.samples, 0).astype(np.int64),
        "reading_noise": column(lambda r: r.estimate.noise),
        "damping_rate": column(lambda r: r.estimate.damping_rate),
        "difference_frequency": column(lambda r: r.estimate.uncorrected),
        "sensitivity_frequency_difference": column(lambda r: r.gravity.per_ratio),
        "sensitivity_gain": column(lambda r: r.gravity.per_gain),
        "elapsed": np.array([r.elapsed for r in reductions]),
    }
    sources = sorted({name for r in reductions if r.gravity for name in r.gravity.budget})
    variables["share"] = np.array(
        [[r.gravity.budget.get(s, 0.0) if r.gravity else nan for s in sources] for r in reductions]
    )
    variables["advice"] = _text(r.gravity.advice if r.gravity else "" for r in reductions)
    coordinates: dict[str, Any] = {"estimator": names, "pendulum": pendulums, "entry": entries, "source": sources}
    if raised:
        variables |= {"flag": _text(raised), "flag_meaning": _text(told(name) for name in raised)}
    return dataset("gravity", variables, coordinates, _EXTRA, ("estimator",))


def _period_for_milligal(reduction: Reduction) -> float:
    """Change of the full period of the second pendulum, 1e-7 s, that a milligal stands for: dT = -T dg/2g."""
    value = reduction.gravity
    assert value is not None  # asked for methods that gave one
    return float(-np.pi / value.frequency[1] * MGAL / value.gravity * 1e7)


def _labels(reductions: Sequence[Reduction]) -> list[str]:
    """Name of each row: the method, or `auto` where it chose one that was asked for by name as well."""
    named = {reduction.method for reduction in reductions if reduction.requested != "auto"}
    return [r.requested if r.requested == "auto" and r.method in named else r.method for r in reductions]


def _text(values: Any) -> np.ndarray:
    return np.array(list(values), dtype=object)
