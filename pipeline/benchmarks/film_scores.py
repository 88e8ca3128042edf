"""How good a reading of a film is, given its truth: places of the rows, crossings, marks, time; and its peers.

Peers are what others read lines with, on the same image: darkest pixel, centroid. They are given what the project's
reader is not: within which columns each trace stays.
"""

import importlib.util
import math
import os
import time
from collections.abc import Iterator
from functools import partial
from itertools import permutations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from xarray import DataTree

from data_schemas.variables import ELONGATION_FLAGS
from pipeline.arrays import Floats
from pipeline.benchmarks.tables import Row, rms, timed
from pipeline.film.digitise import open_film, read

WRONG = 1.0  # px off, normal to the line: five times the error that is promised
_APART = 3.0  # px between lines beyond which it is told which is which
_FLAT = 1.0  # slope
_DOUBT = sum(ELONGATION_FLAGS[name] for name in ("lost", "ambiguous", "single_direction", "outlier"))
_NOT_READ = ELONGATION_FLAGS["lost"] | ELONGATION_FLAGS["ambiguous"]

Flags = NDArray[np.bool_]
_STRIP = 1024
_BESIDE = 10  # px beyond the outermost places of a trace
_CHEAP = 0.001  # of a line's light, on blank film
_NOISES = 4.0  # sigmas of the ground above which a pixel counts


class Truth(NamedTuple):
    """What a reader of the film does not see, (traces, rows) px and s, and the marks, s."""

    column: Floats
    slope: Floats
    time: Floats
    seconds: Floats
    mark_time: Floats

    @classmethod
    def of(cls, tree: DataTree) -> "Truth":
        """Of the film-truth."""
        slices, marks = tree["slices"].dataset, tree["marks"].dataset
        mark = (marks["minute"].values == 0) & (marks["spurious"].values == 0)
        column, slope, exposed = (slices[name].values for name in ("column", "slope", "exposure_time"))
        return cls(column, slope, exposed, tree.dataset["time"].values, marks["mark_time"].values[mark])


def order(position: Floats, truth: Truth) -> list[int]:
    """Which reading follows each trace, most of the film: of traces that rest at one place, names cannot be told."""
    column = truth.column

    def distance(names: list[int]) -> float:
        error = np.abs(position[names] - column)
        return float(np.median(error[np.isfinite(error)])) if np.isfinite(error).any() else math.inf

    return min((list(names) for names in permutations(range(len(column)))), key=distance)


def places(position: Floats, flagged: Flags | None, truth: Truth) -> Row:
    """Errors of readings (traces, rows), NaN = none, normal to the line, px; flagged: those the reader doubts."""
    column, slope = truth.column, truth.slope
    lit = np.isfinite(column)
    error = (position - column) / np.hypot(1.0, slope)
    read = lit & np.isfinite(error)
    silent = read if flagged is None else read & ~flagged
    flat = read & (np.abs(slope) < _FLAT)
    crossed, swapped = crossings(position, column)
    wrong = share(silent & (np.abs(error) > WRONG), lit)
    accuracy = {"normal_px": rms(error[read]), "flat_px": rms(error[flat]), "accepted": share(read, lit)}
    more = {"wrong_unflagged": wrong, "amplitude_bias": bias(position, column, read)}
    return {**accuracy, **more, "crossings": crossed, "swaps": swapped}


def share(which: Flags, lit: Flags) -> float:
    """Of the rows that a trace was written on."""
    return float(np.mean(which[lit]))


def bias(position: Floats, column: Floats, read: Flags) -> float:
    """Largest relative error of a trace's amplitude: the slope of its readings over the truth, less 1."""
    pairs = zip(position, column, read, strict=True)
    some = [(seen[good], true[good]) for seen, true, good in pairs if good.sum() > 2]
    slopes = [np.polyfit(true - true.mean(), seen, 1)[0] - 1.0 for seen, true in some]
    return float(max(slopes, key=abs)) if slopes else math.nan


def crossings(position: Floats, column: Floats) -> tuple[int, int]:
    """How often neighbouring traces cross, and after how many crossings the reading follows the other trace."""
    crossed = swapped = 0
    for k in range(len(column) - 1):
        apart, seen = column[k] - column[k + 1], position[k] - position[k + 1]
        known = np.flatnonzero(np.isfinite(apart) & np.isfinite(seen))
        turns = np.flatnonzero(np.diff(np.signbit(apart[known]))) + 1
        crossed += turns.size
        for here in np.split(known, turns):
            clear = here[np.abs(apart[here]) > _APART]
            if turns.size and clear.size > 2:
                swapped += int(np.mean(np.signbit(seen[clear]) != np.signbit(apart[clear])) > 0.5)
    return crossed, swapped


def timing(seconds: Floats, truth: Truth, interval: float) -> tuple[float, float, float]:
    """Shift of the time axis by whole marks, its rms error besides, and its largest error besides, s."""
    error = seconds - truth.seconds
    inside = np.isfinite(error) & (truth.seconds >= truth.mark_time[0]) & (truth.seconds <= truth.mark_time[-1])
    if not inside.any():
        return math.nan, math.nan, math.nan
    shift = round(float(np.median(error[inside])) / interval) * interval
    return shift, rms(error[inside] - shift), float(np.max(np.abs(error[inside] - shift)))


def marks(index: NDArray[np.int64], row_of_trace: Floats, shift: float, interval: float, truth: Truth) -> float:
    """Error of the marks' rows on single traces, px rms."""
    errors = []
    for k, rows in enumerate(row_of_trace):
        lit = np.isfinite(truth.time[k])
        centre = np.flatnonzero(lit) + 0.5
        found = np.isfinite(rows)
        expected = np.interp(index[found] * interval - shift, truth.time[k, lit], centre, left=np.nan, right=np.nan)
        errors.append(rows[found] - expected)
    error = np.concatenate(errors)
    return rms(error[np.isfinite(error)])


def own_reading(path: str | os.PathLike[str], truth: Truth, interval: float) -> Row:
    """Scores of a film read as `digitise` does, and Mpx a CPU second; `IsochronyError` where it declines. A time axis
    without a minute's code is right up to a shift by whole marks; one that shifts on the way has slipped."""
    (found, _), spent = timed(partial(read, path))
    names = order(found.tracks.position, truth)
    qc, lit = found.tracks.qc[names], np.isfinite(truth.column)
    shift, error, worst = timing(found.axis.seconds, truth, interval)
    return places(found.tracks.position[names], (qc & _DOUBT) != 0, truth) | {
        "flagged": share((qc & _NOT_READ) != 0, lit),
        "single": share((qc & ELONGATION_FLAGS["single_direction"]) != 0, lit),
        "mark_px": marks(found.axis.index, found.axis.row_of_trace[names], shift, interval, truth),
        "time_ms": 1e3 * error,
        "slipped": float(not worst < 0.5 * interval),
        "mpx_s": found.scan.rows * found.scan.columns / 1e6 / spent,
    }


def peers(path: str | os.PathLike[str], truth: Truth) -> Iterator[tuple[str, Row]]:
    """Every peer's name, and scores of the columns it reads."""
    ends = [(int(np.nanmin(line)) - _BESIDE, int(np.nanmax(line)) + _BESIDE) for line in truth.column]
    scan, _ = open_film(path)
    windows = [slice(max(0, first), min(scan.columns, last)) for first, last in ends]
    rowwise = {"column argmax": lambda light: np.argmax(light, axis=1) + 0.5, "centroid": _centroid}
    for name in (*rowwise, *(["cheapest path"] if importlib.util.find_spec("skimage") else [])):
        started = time.process_time()
        position = np.full((len(windows), scan.rows), np.nan)
        strip = _STRIP if name in rowwise else scan.rows
        for first in range(0, scan.rows, strip):
            part = slice(first, min(first + strip, scan.rows))
            pixels = scan.read(part.start, part.stop).astype(np.float32)
            light = np.median(pixels, axis=1, keepdims=True) - pixels  # darker than the usual of its row
            for k, window in enumerate(windows):
                position[k, part] = window.start + rowwise.get(name, _cheapest_path)(light[:, window])
        speed = scan.rows * scan.columns / 1e6 / (time.process_time() - started)
        yield name, places(position[order(position, truth)], None, truth) | {"mpx_s": speed}


def _cheapest_path(light: Floats) -> Floats:
    """Columns of the cheapest way along the film, by scikit-image's `route_through_array`, which holds it whole."""
    from skimage import graph

    route: Any = graph.route_through_array
    # blank film is made so dear that the way does not cut a swing's corners
    cost = 1.0 / (np.clip(light, 0.0, None) / max(float(np.quantile(light, 0.999)), 1.0) + _CHEAP) ** 2
    ends = [(0, int(np.argmin(cost[0]))), (len(cost) - 1, int(np.argmin(cost[-1])))]
    row, column = np.array(route(cost, *ends)[0]).T
    return np.asarray(0.5 + np.bincount(row, column, len(cost)) / np.bincount(row, minlength=len(cost)))


def _centroid(light: Floats) -> Floats:
    """Of what is darker than the noise of the ground."""
    noise = 1.4826 * np.median(np.abs(light), axis=1, keepdims=True)
    weight = np.where(light > _NOISES * noise, light, np.float32(0.0))
    total = weight.sum(axis=1, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        centre: Floats = weight @ (np.arange(light.shape[1]) + 0.5) / total
    return centre
