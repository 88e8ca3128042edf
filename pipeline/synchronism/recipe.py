"""The recipe: a record of clocks in, what they do to each other out, as a DataTree of the layout "isochrony-result".

Phase and amplitude of every pendulum come at common instants, one a swing, from weighted fits of a few swings each. In
a Hann window a reading is {1, x} x {cos, sin} at the pendulum's own frequency, on a constant. Missing readings are left
out, never filled; an instant with less than half of its window has no phase.
"""

import contextlib
import math
import time as stopwatch
from collections.abc import Collection
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from xarray import Dataset, DataTree

from data_schemas.checking import checked
from data_schemas.errors import RecordError, RefusedError
from data_schemas.variables import dataset
from pipeline.arrays import Floats, row_means_present, unwrapped
from pipeline.conditions import DAY
from pipeline.observation import combine, weights_of
from pipeline.reduction import of_film
from pipeline.result import result_attributes
from pipeline.synchronism.verdict import allan_deviation, block_slope, judge, slip_times

_LEAST_INSTANTS, _RATE_BLOCKS = 16, 16
_A_DAY = DAY / (2.0 * math.pi)  # swings a day in a rad s-1
SWINGS = 6.0  # Length of a window, in swings: what the phases of both do within it is averaged
LEAST_COVERAGE = 0.5
_LEAST_SWINGS = 12.0
_LEAST_READINGS = 12  # of a window
_TERMS = 5
_PADDING = 4
_MULTIPLES = {"vertical": 2.0, "horizontal": 1.0}  # of the clocks' frequency, at which the support moves


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
        slips, verdict and confidence, lock time, amplitudes, Allan deviation, and the motion of the support where its
        acceleration was recorded. Times count as in the record.

    Raises
    ------
    RecordError
        The record breaks its layout, or does not show two pendulums apart.
    RefusedError
        Too short, too rarely read, a pendulum that does not swing, or a film's flag that blocks.
    """
    started = stopwatch.perf_counter()
    contents = checked(record, "record")
    raised = of_film(record, accept)
    labels, elongation = pendulums_of(record)
    recorded = np.asarray(record.dataset["time"].values, dtype=np.float64)
    time = recorded - recorded[0]
    spacing = float(np.median(np.diff(time)))
    shortest = float(np.min(record["instrument"].dataset["period"].values)) if "instrument" in record.children else 0.0
    if spacing > 0.5 * shortest > 0.0:  # they show another, slower swing: nothing in them tells
        said = f"readings {spacing:g} s apart are further than half a swing of {shortest:g} s"
        raise RefusedError(f"synchrony: {said}; record them more often")
    seen = phases(time, elongation)
    moved, direction = _beam(record, time, seen)
    values = {"clock": labels, "phase": seen.phase, "amplitude": seen.amplitude, "frequency": seen.frequency}
    values |= {**_pairs(labels, seen, float(recorded[0])), **moved}
    averaging, deviation = allan_deviation(seen.time, seen.phase)
    values |= {"averaging_time": averaging, "allan_deviation": deviation} if averaging.size else {}
    group = dataset("synchrony", values, {}, {})
    group.attrs["beam_direction"] = direction
    group.attrs["film_flags"] = ", ".join(raised)
    instants = ("time", seen.time + recorded[0], dict(record.dataset["time"].attrs))
    tree = DataTree.from_dict({"/": Dataset(coords={"time": instants}), "/synchrony": group})
    tree.attrs.update(result_attributes(contents, {"analysis": "synchrony", "window_s": seen.window}, started))
    tree.attrs["title"] = f"synchrony of record {tree.attrs['record_id']}"
    return tree


def _pairs(labels: list[str], seen: "Phases", start: float) -> dict[str, Any]:
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
        here = slip_times(seen.time, psi)
        mean, mean_sigma = block_slope(seen.time, psi, _RATE_BLOCKS)  # holds for the steps of slips too
        slips += [(when + start, name) for when in here]
        rows.append(
            {
                "pair": name,
                "phase_difference": psi,
                "phase_difference_sigma": sigma,
                "rate_difference": np.gradient(psi, seen.time) * _A_DAY,
                "mean_rate_difference": mean * _A_DAY,
                "mean_rate_difference_sigma": mean_sigma * _A_DAY,
                **judge(seen.time, psi, sigma, here),
                "slips": float(len(here)),
                "amplitude_ratio": float(np.nanmedian(seen.amplitude[one] / seen.amplitude[two])),
            }
        )
    values: dict[str, Any] = {name: [row[name] for row in rows] for name in rows[0]}
    values = {name: each if isinstance(each[0], str) else np.stack(each) for name, each in values.items()}
    values["lock_time"] += start + seen.time[0]  # counted from the first instant
    if slips:
        values["slip_time"] = np.array([when for when, _ in slips])
        values["slip_pair"] = [name for _, name in slips]
    return values


def _beam(record: DataTree, time: Floats, seen: "Phases") -> tuple[dict[str, Any], str]:
    """Motion of the support in the second half, at a multiple of the clocks' frequency, and its direction."""
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


def pendulums_of(record: DataTree) -> tuple[list[str], Floats]:
    """Labels and elongations (pendulums, time) of pendulums that traces tell apart; `RecordError`: fewer than two."""
    traces = record["record"].dataset
    labels = [str(label) for label in traces["pendulum"].values]
    combination = np.asarray(traces["combination"].values, dtype=np.float64)
    elongation = np.asarray(traces["elongation"].values, dtype=np.float64)
    rows = dict[str, Floats]()
    for label, wanted in zip(labels, np.eye(len(labels)), strict=True):
        with contextlib.suppress(RecordError):
            rows[label] = combine(weights_of(combination, wanted, label), elongation)
    if len(rows) < 2:
        raise RecordError("synchrony: the record shows no two pendulums apart; give each clock a trace of its own")
    return list(rows), np.stack(list(rows.values()))


class Phases(NamedTuple):
    """Of every pendulum; phi(t) = frequency t + what drifts, theta = amplitude cos phi."""

    time: Floats  # (instants,) evenly spaced, s from the record's first reading
    phase: Floats  # (pendulums, instants) rad, unwrapped; NaN where too little was read
    amplitude: Floats  # (pendulums, instants) rad
    sigma: Floats  # (pendulums, instants) rad: one sigma of the phase, from what the fit leaves
    frequency: Floats  # (pendulums,) mean, rad s-1
    window: float  # s


def phases(time: Floats, elongation: Floats) -> Phases:
    """Follow the phases of pendulums by elongations (pendulums, n), rad, NaN = missing, at times (n,), s, from 0 on.

    `RefusedError` if one does not swing, for too few swings or readings.

    Examples
    --------
    >>> t = np.arange(2000) * 0.05
    >>> found = phases(t, np.stack([0.1 * np.cos(6.0 * t), 0.2 * np.sin(6.1 * t)]))
    >>> np.round(found.frequency, 6), np.round(found.amplitude[:, 0], 6)
    (array([6. , 6.1]), array([0.1, 0.2]))
    """
    start = np.array([_frequency(time, row) for row in elongation])
    period = 2.0 * np.pi / float(start.min())
    duration, spacing = float(time[-1]), float(np.median(np.diff(time)))
    if duration < _LEAST_SWINGS * period:
        raise RefusedError(f"synchrony: {duration / period:.1f} swings are too few; record {_LEAST_SWINGS:g} or more")
    window = max(SWINGS * period, _LEAST_READINGS * spacing)
    if window > 0.5 * duration:
        raise RefusedError(f"synchrony: readings {spacing:g} s apart are too few for {duration:g} s; record more often")
    centres = np.arange(0.5 * window, duration - 0.5 * window + 0.25 * period, period)
    rows = [_followed(time, row, centres, window, each) for row, each in zip(elongation, start, strict=True)]
    turned = np.stack([row[0] for row in rows])
    known = np.isfinite(turned)
    if known.sum(axis=1).min() < 2:
        raise RefusedError("synchrony: a pendulum was hardly read; leave its trace out")
    mean = np.array([np.polyfit(centres[at], each[at], 1)[0] for at, each in zip(known, turned, strict=True)])
    return Phases(centres, turned, np.stack([row[1] for row in rows]), np.stack([row[2] for row in rows]), mean, window)


def _frequency(time: Floats, values: Floats) -> float:
    """Largest peak of the spectrum, rad/s, to a tenth of a line."""
    present = np.isfinite(values)
    if present.sum() < _LEAST_READINGS or not np.ptp(values[present]) > 0.0:
        raise RefusedError("synchrony: a pendulum does not swing, or was hardly read; leave its trace out")
    step = float(np.median(np.diff(time)))
    grid = np.arange(round(float(time[-1]) / step) + 1) * step
    even = np.interp(grid, time[present], values[present])
    size = np.abs(np.fft.rfft((even - even.mean()) * np.hanning(even.size), _PADDING * even.size))
    top = int(np.clip(np.argmax(size), 1, size.size - 2))
    before, here, after = np.log(np.maximum(size[top - 1 : top + 2], 1e-300))
    bend = before - 2.0 * here + after
    shift = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return float(2.0 * np.pi * (top + shift) / (_PADDING * even.size * step))


def _followed(
    time: Floats, values: Floats, centres: Floats, window: float, frequency: float
) -> tuple[Floats, Floats, Floats]:
    """Unwrapped phase, amplitude and sigma of the phase at the centres."""
    harmonic, sigma = np.full(centres.size, np.nan, dtype=np.complex128), np.full(centres.size, np.nan)
    spacing, present = float(np.median(np.diff(time))), np.isfinite(values)
    time, values = time[present], values[present]
    low, high = np.searchsorted(time, centres - 0.5 * window), np.searchsorted(time, centres + 0.5 * window, "right")
    for k, centre in enumerate(centres):
        tau, seen = time[low[k] : high[k]] - centre, values[low[k] : high[k]]
        weight = np.cos(np.pi * tau / window) ** 2
        if tau.size <= 2 * _TERMS or weight.sum() < LEAST_COVERAGE * 0.5 * window / spacing:
            continue
        cosine, sine = np.cos(frequency * tau), np.sin(frequency * tau)
        basis = np.stack([cosine, sine, tau * cosine, tau * sine, np.ones_like(tau)])
        weighted = basis * weight
        inverse = np.linalg.inv(weighted @ basis.T)
        parts = inverse @ (weighted @ seen)
        left = seen - parts @ basis
        variance = float(weight @ (left * left)) / float(weight.sum()) * seen.size / (seen.size - _TERMS)
        spread = inverse @ (weighted @ weighted.T) @ inverse
        harmonic[k] = complex(parts[0], -parts[1])
        sigma[k] = np.sqrt(0.5 * variance * (spread[0, 0] + spread[1, 1]))  # of one of its two parts
    size, carrier = np.abs(harmonic), frequency * centres
    with np.errstate(invalid="ignore", divide="ignore"):
        sigma = sigma / size
    # across a gap the nearest turn is taken
    return unwrapped((harmonic * np.exp(-1j * carrier))[None])[0] + carrier, size, sigma
