"""The recipe: a record of clocks in, what they do to each other out."""

from __future__ import annotations

import time as stopwatch
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from data_schemas.errors import RecordError, RefusedError
from pipeline.arrays import Floats, row_means_present

if TYPE_CHECKING:
    from xarray import DataTree

_LEAST_INSTANTS = 16


def synchrony(record: DataTree) -> DataTree:
    """Say how the pendulums of a record keep step.

    Parameters
    ----------
    record : DataTree
        Layout "isochrony-record", with two traces or more; it is not modified. Each clock one trace, or a clock and
        differences.

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
        Too short, too rarely read, or a pendulum that does not swing.
    """
    from data_schemas import check
    from pipeline.synchronism.allan import allan_deviation, available
    from pipeline.synchronism.phases import beam, phases
    from pipeline.synchronism.result import Found, Pair, laid_out
    from pipeline.synchronism.verdict import judge

    started = stopwatch.perf_counter()
    faults = check(record, "record")
    if faults:
        raise RecordError("; ".join(faults))
    labels, elongation = pendulums_of(record)
    recorded = np.asarray(record.dataset["time"].values, dtype=np.float64)
    time = recorded - recorded[0]
    _refuse_rare(record, float(np.median(np.diff(time))))
    seen = phases(time, elongation)
    pairs = []
    for one, two in combinations(range(len(labels)), 2):
        psi = seen.phase[one] - seen.phase[two]
        sigma = np.hypot(seen.sigma[one], seen.sigma[two])
        known = int(np.isfinite(psi).sum())
        if known < _LEAST_INSTANTS:
            said = f"{labels[one]} and {labels[two]} were read together in {known} swings"
            raise RefusedError(f"synchrony: {said}; a verdict needs {_LEAST_INSTANTS}")
        ratio = float(np.nanmedian(seen.amplitude[one] / seen.amplitude[two]))
        pairs.append(Pair(f"{labels[one]}-{labels[two]}", psi, sigma, judge(seen.time, psi, sigma), ratio))
    size = row_means_present(seen.amplitude[:, seen.time >= 0.5 * seen.time[-1]])
    dataset = record["record"].dataset
    accelerations = {
        name: np.asarray(dataset[name].values, dtype=np.float64)
        for name in ("vertical_acceleration", "horizontal_acceleration")
        if name in dataset
    }
    moved = beam(time, accelerations, float(seen.frequency.mean()), size, 0.5 * float(time[-1]))
    stability = allan_deviation(seen.time, seen.phase) if available() else None
    found = Found(labels, seen, pairs, moved, stability, float(recorded[0]))
    return laid_out(record, found, started)


def _refuse_rare(record: DataTree, spacing: float) -> None:
    """Readings further apart than half a swing show another, slower one: nothing in them tells."""
    shortest = float(np.min(record["instrument"].dataset["period"].values)) if "instrument" in record.children else 0.0
    if spacing > 0.5 * shortest > 0.0:
        said = f"readings {spacing:g} s apart are further than half a swing of {shortest:g} s"
        raise RefusedError(f"synchrony: {said}; record them more often")


def pendulums_of(record: DataTree) -> tuple[list[str], Floats]:
    """Labels and elongations (pendulums, time) of the pendulums that the traces tell apart, rad.

    Raises
    ------
    RecordError
        If these are fewer than two.
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
