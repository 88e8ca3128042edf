"""The result of a record as a DataTree of the layout "isochrony-result"."""

from __future__ import annotations

import json
import time as clock
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from data_schemas.variables import VARIABLES, attributes
from pipeline.anomaly import anomalies
from pipeline.conditions import Constants
from pipeline.ledger.book import CORRECTIONS
from pipeline.ledger.entry import MGAL
from pipeline.prepared import Prepared
from pipeline.provenance import provenance
from pipeline.reduction import Reduction

if TYPE_CHECKING:
    from xarray import Dataset, DataTree

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


def build_result(record: DataTree, prepared: Prepared, reductions: Sequence[Reduction], started: float) -> DataTree:
    """Lay out phases, corrections, gravity and provenance."""
    from xarray import Dataset, DataTree

    envelope, seen = prepared.sliding, prepared.observation
    components = [seen.first, seen.second, f"{seen.first}-{seen.second}"]
    harmonics, speeds, slow = (
        np.stack([first, first - difference, difference])
        for first, difference in (
            (envelope.first, envelope.difference),
            (envelope.first_speed, envelope.difference_speed),
            envelope.slow,
        )
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        phase_speed = envelope.carrier + (speeds / harmonics).imag
    phase = unwrapped(harmonics) + envelope.carrier * envelope.time
    time_attributes = dict(record.dataset["time"].attrs)
    methods = _labels(reductions)
    measured = {
        "amplitude": np.abs(harmonics),
        "phase": phase,
        "phase_speed": phase_speed,
        "slow": slow,
        "phase_qc": np.isnan(phase).astype(np.uint16),
    }
    correction = {
        name: np.stack([_series(reduction, field, envelope.time.size) for reduction in reductions])
        for name, field in (("phase_speed_correction", "speed_correction"), ("phase_correction", "phase_correction"))
    }
    gravity = _gravity(reductions, components, methods, seen.constants)
    tree = DataTree.from_dict(
        {
            "/": Dataset(coords={"time": ("time", envelope.time + seen.start, time_attributes)}),
            "/phases": dataset("phases", measured, {"component": components}, {}),
            "/correction": dataset("correction", correction, {"method": methods}, {}),
            "/gravity": gravity,
        }
    )
    tree.attrs.update(result_attributes(record, {"pair": components[2], "methods": methods}, started))
    return tree


def result_attributes(record: DataTree, configuration: Mapping[str, Any], started: float) -> dict[str, Any]:
    """Root attributes: identity, provenance, configuration and time taken."""
    record_id = str(record.attrs.get("record_id", ""))
    return {
        "Conventions": "CF-1.11",
        "schema": "isochrony-result",
        "schema_version": "1",
        "record_id": record_id,
        "title": f"gravity of record {record_id}",
        "source": "isochrony process",
        "configuration": json.dumps(dict(configuration), sort_keys=True),
        **provenance(record),
        "elapsed_s": clock.perf_counter() - started,
    }


def unwrapped(harmonics: np.ndarray) -> np.ndarray:
    """Unwrapped phases, row by row, NaN where missing."""
    phase = np.full(harmonics.shape, np.nan)
    for row, harmonic in enumerate(harmonics):
        present = np.isfinite(harmonic)
        phase[row, present] = np.unwrap(np.angle(harmonic[present]))
    return phase


def _gravity(reductions: Sequence[Reduction], components: list[str], methods: list[str], constants: Constants) -> Any:
    nan = float("nan")
    entries = [module.NAME for module in CORRECTIONS]

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
        "frequency": column(lambda r: r.gravity.frequency, (nan, nan)),
        "value": ledger("value", nan),
        "sigma": ledger("sigma", nan),
        "value_period": ledger("value", nan) * column(_period_for_milligal)[:, None],
        "applied": ledger("applied", False).astype(np.uint8),
        "reason": ledger("reason", "the method refused").astype(object),
        "input": ledger("input_names", "").astype(object),
        "formula": _text(module.FORMULA for module in CORRECTIONS),
        "formula_source": _text(module.SOURCE for module in CORRECTIONS),
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
    coordinates: dict[str, Any] = {"method": methods, "pendulum": pendulums, "entry": entries, "source": sources}
    if raised:
        variables["flag"] = _text(raised)
    return dataset("gravity", variables, coordinates, _EXTRA, ("method",))


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


def _series(reduction: Reduction, field: str, length: int) -> np.ndarray:
    values = getattr(reduction.estimate, field) if reduction.estimate else None
    # stored as what is added, like every correction of a result
    return np.full(length, np.nan) if values is None else -np.asarray(values)


def dataset(
    group: str,
    values: Mapping[str, Any],
    coordinates: Mapping[str, Sequence[str]],
    extra: Mapping[str, tuple[str, str]],
    dims: tuple[str, ...] = (),
) -> Dataset:
    """A group of a result: dimensions, units and meaning of its values from the table of variables.

    `extra` has units and meanings of values that the table does not know, all with the dimensions `dims`.
    """
    from xarray import Dataset

    def entry(name: str, value: Any) -> tuple[tuple[str, ...], Any, dict[str, Any]]:
        if name in extra:
            units, long_name = extra[name]
            return dims, value, {"units": units, "long_name": long_name}
        return VARIABLES[f"{group}/{name}"].dims, value, attributes(f"{group}/{name}")

    return Dataset(
        {name: entry(name, value) for name, value in values.items()},
        coords={name: entry(name, _text(value)) for name, value in coordinates.items()},
    )
