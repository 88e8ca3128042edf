"""The recipe: a record of clocks in, what they do to each other out, as a DataTree of the layout "isochrony-result"."""

from __future__ import annotations

import math
import time as stopwatch
from collections.abc import Collection
from itertools import combinations
from typing import Any

import numpy as np
from xarray import Dataset, DataTree

from data_schemas import check
from data_schemas.errors import RecordError, RefusedError
from data_schemas.variables import dataset
from pipeline.arrays import Floats, row_means_present
from pipeline.flags import of_film
from pipeline.gravity import DAY
from pipeline.result import result_attributes
from pipeline.summary import without_gravity
from pipeline.synchronism.phases import Phases, phases
from pipeline.synchronism.verdict import REMEDY, allan_deviation, available, block_slope, judge

_LEAST_INSTANTS, _RATE_BLOCKS = 16, 16
_A_DAY = DAY / (2.0 * math.pi)  # swings a day in a rad s-1
_MULTIPLES = {"vertical": 2.0, "horizontal": 1.0}  # of the clocks' frequency, at which the support moves
UNSURE = 0.95
_SUMMED = {
    "confidence": "confidence", "angle_rad": "locked_angle", "angle_sigma_rad": "locked_angle_sigma",
    "lock_time_s": "lock_time", "slips": "slips", "rate_difference_per_day": "mean_rate_difference",
    "rate_difference_sigma_per_day": "mean_rate_difference_sigma", "amplitude_ratio": "amplitude_ratio",
}  # fmt: skip


def synchrony(record: DataTree, *, accept: Collection[str] = ()) -> DataTree:
    """Say how the pendulums of a record keep step.

    Parameters
    ----------
    record : DataTree
        Layout "isochrony-record", with two traces or more; it is not modified. Each clock one trace, or a clock and
        differences.
    accept : collection of str
        Flags of a film that make its time or scale doubtful and shall not block.

    Returns
    -------
    DataTree
        Layout "isochrony-result" with the group `synchrony`: phases, unwrapped differences, rates in swings a day,
        slips, verdict and confidence, lock time, amplitudes, Allan deviation (if allantools is installed), and the
        motion of the support where its acceleration was recorded. Times count as in the record.

    Raises
    ------
    RecordError
        The record breaks its layout, or does not show two pendulums apart.
    RefusedError
        Too short, too rarely read, a pendulum that does not swing, or a film's flag that blocks.
    """
    started = stopwatch.perf_counter()
    faults = check(record, "record")
    if faults:
        raise RecordError("; ".join(faults))
    raised = of_film(record, accept)
    labels, elongation = pendulums_of(record)
    recorded = np.asarray(record.dataset["time"].values, dtype=np.float64)
    time = recorded - recorded[0]
    _refuse_rare(record, float(np.median(np.diff(time))))
    seen = phases(time, elongation)
    moved, direction = _beam(record, time, seen)
    values = {"clock": _texts(labels), "phase": seen.phase, "amplitude": seen.amplitude, "frequency": seen.frequency}
    values |= {**_pairs(labels, seen, float(recorded[0])), **moved}
    averaging, deviation = allan_deviation(seen.time, seen.phase) if available() else (np.empty(0), None)
    values |= {"averaging_time": averaging, "allan_deviation": deviation} if averaging.size else {}
    group = dataset("synchrony", values, {}, {})
    group.attrs["allan_deviation_absent"] = "" if available() else REMEDY
    group.attrs["beam_direction"] = direction
    group.attrs["film_flags"] = ", ".join(raised)
    instants = ("time", seen.time + recorded[0], dict(record.dataset["time"].attrs))
    tree = DataTree.from_dict({"/": Dataset(coords={"time": instants}), "/synchrony": group})
    tree.attrs.update(result_attributes(record, {"analysis": "synchrony", "window_s": seen.window}, started))
    tree.attrs["title"] = f"synchrony of record {tree.attrs['record_id']}"
    tree.attrs["elapsed_s"] = stopwatch.perf_counter() - started
    return tree


def _pairs(labels: list[str], seen: Phases, start: float) -> dict[str, Any]:
    """Verdict, rates and slips of every two clocks; `start` is the time of the first reading, s."""
    rows: list[dict[str, Any]] = []
    slips: list[tuple[float, str]] = []
    for one, two in combinations(range(len(labels)), 2):
        name = f"{labels[one]}-{labels[two]}"
        psi = seen.phase[one] - seen.phase[two]
        sigma = np.hypot(seen.sigma[one], seen.sigma[two])
        known = int(np.isfinite(psi).sum())
        if known < _LEAST_INSTANTS:
            said = f"{labels[one]} and {labels[two]} were read together in {known} swings"
            raise RefusedError(f"synchrony: {said}; a verdict needs {_LEAST_INSTANTS}")
        verdict = judge(seen.time, psi, sigma)
        mean, mean_sigma = block_slope(seen.time, psi, _RATE_BLOCKS)  # holds for the steps of slips too
        slips += [(when + start, name) for when in verdict.slips]
        rows.append(
            {
                "pair": name,
                "phase_difference": psi,
                "phase_difference_sigma": sigma,
                "rate_difference": np.gradient(psi, seen.time) * _A_DAY,
                "mean_rate_difference": mean * _A_DAY,
                "mean_rate_difference_sigma": mean_sigma * _A_DAY,
                "verdict": verdict.state,
                "confidence": verdict.confidence,
                "locked_angle": verdict.angle,
                "locked_angle_sigma": verdict.angle_sigma,
                "lock_time": verdict.lock_time + start + float(seen.time[0]),  # counted from the first instant
                "slips": float(len(verdict.slips)),
                "amplitude_ratio": float(np.nanmedian(seen.amplitude[one] / seen.amplitude[two])),
            }
        )
    values: dict[str, Any] = {name: [row[name] for row in rows] for name in rows[0]}
    values = {name: _texts(each) if isinstance(each[0], str) else np.stack(each) for name, each in values.items()}
    if slips:
        values["slip_time"] = np.array([when for when, _ in slips])
        values["slip_pair"] = _texts([name for _, name in slips])
    return values


def _beam(record: DataTree, time: Floats, seen: Phases) -> tuple[dict[str, Any], str]:
    """Motion of the support in the second half at a multiple of the clocks' frequency, and its direction.

    The larger of what the recorded accelerations show; nothing where none was recorded.
    """
    traces, found = record["record"].dataset, [(-1.0, "")]
    for direction, multiple in _MULTIPLES.items():
        if (name := f"{direction}_acceleration") in traces:
            values = np.asarray(traces[name].values, dtype=np.float64)
            used = np.isfinite(values) & (time >= 0.5 * float(time[-1]))
            if used.sum() >= _LEAST_INSTANTS:
                turn, window = multiple * float(seen.frequency.mean()), np.hanning(int(used.sum()))
                carrier = np.exp(-1j * turn * time[used])
                felt = np.abs(2.0 * np.sum(window * (values[used] - values[used].mean()) * carrier) / window.sum())
                found.append((float(felt) / turn**2, direction))
    size, direction = max(found, key=lambda each: each[0])
    swings = row_means_present(seen.amplitude[:, seen.time >= 0.5 * seen.time[-1]])
    return ({"beam_amplitude": size, "beam_ratio": size / swings} if direction else {}), direction


def _refuse_rare(record: DataTree, spacing: float) -> None:
    """Readings further apart than half a swing show another, slower one: nothing in them tells."""
    shortest = float(np.min(record["instrument"].dataset["period"].values)) if "instrument" in record.children else 0.0
    if spacing > 0.5 * shortest > 0.0:
        said = f"readings {spacing:g} s apart are further than half a swing of {shortest:g} s"
        raise RefusedError(f"synchrony: {said}; record them more often")


def pendulums_of(record: DataTree) -> tuple[list[str], Floats]:
    """Labels and elongations (pendulums, time) of the pendulums that the traces tell apart, rad.

    `RecordError` if these are fewer than two.
    """
    traces = record["record"].dataset
    labels = [str(label) for label in traces["pendulum"].values]
    combination = np.asarray(traces["combination"].values, dtype=np.float64)
    elongation = np.asarray(traces["elongation"].values, dtype=np.float64)
    inverse = np.linalg.pinv(combination)
    apart = np.abs(inverse @ combination - np.eye(len(labels))).max(axis=1) < 1e-9
    if apart.sum() < 2:
        raise RecordError("synchrony: the record shows no two pendulums apart; give each clock a trace of its own")
    rows = []
    for weights in inverse[apart]:
        used = np.flatnonzero(np.abs(weights) > 1e-12)
        rows.append(np.tensordot(weights[used], elongation[used], axes=1))  # a trace that is not used may be missing
    return [label for label, known in zip(labels, apart, strict=True) if known], np.stack(rows)


def _texts(values: list[str]) -> Any:
    return np.array(values, dtype=object)


def synchrony_summaries(result: DataTree) -> list[dict[str, Any]]:
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
        rows.append(without_gravity(result, "synchrony", "synchrony") | more)
    return rows
