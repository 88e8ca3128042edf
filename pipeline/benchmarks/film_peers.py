"""What others read lines with, on the same image: darkest pixel, centroid, cheapest path.

They are given what the project's reader is not: within which columns each trace stays, or where it begins and ends.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.arrays import Floats
from pipeline.benchmarks.film_scores import Truth

_STRIP = 1024
_BESIDE = 10  # px beyond the outermost places of a trace
_NOISES = 4.0  # sigmas of the ground above which a pixel counts
ROUTE = "scikit-image route_through_array"
ROUTE_ROWS = 800  # the cheapest path is slow: it reads so many rows

Scan = Any


@dataclass(frozen=True)
class PeerReading:
    """Columns read, (traces, rows) px, of some rows; CPU time, s, and pixels of the film in those rows."""

    position: Floats
    rows: slice
    seconds: float
    pixels: int


def readings(scan: Scan, truth: Truth) -> Iterator[tuple[str, PeerReading]]:
    """Every peer that is installed, by name."""
    windows = [
        slice(max(0, int(np.nanmin(line)) - _BESIDE), min(scan.columns, int(np.nanmax(line)) + _BESIDE))
        for line in truth.column
    ]
    for name, reader in (("column argmax", _darkest), ("centroid", _centroid)):
        yield name, _by_rows(scan, windows, reader)
    try:
        import skimage.graph  # noqa: F401
    except ImportError:
        return
    yield ROUTE, _routed(scan, truth)


def _by_rows(scan: Scan, windows: list[slice], reader: Callable[[Floats], Floats]) -> PeerReading:
    started = time.process_time()
    position = np.full((len(windows), scan.rows), np.nan)
    for first in range(0, scan.rows, _STRIP):
        stop = min(first + _STRIP, scan.rows)
        light = _darkness(scan.read(first, stop))
        for k, window in enumerate(windows):
            position[k, first:stop] = window.start + reader(light[:, window])
    return PeerReading(position, slice(None), time.process_time() - started, scan.rows * scan.columns)


def _darkness(pixels: Any) -> Any:
    """How much darker than the usual of its row every pixel is, float32."""
    values = pixels.astype(np.float32)
    return np.median(values, axis=1, keepdims=True) - values


def _darkest(light: Floats) -> Floats:
    place: Floats = np.argmax(light, axis=1) + 0.5
    return place


def _centroid(light: Floats) -> Floats:
    """Of what is darker than the noise of the ground."""
    noise = 1.4826 * np.median(np.abs(light), axis=1, keepdims=True)
    weight = np.where(light > _NOISES * noise, light, np.float32(0.0))
    total = weight.sum(axis=1, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        centre: Floats = weight @ (np.arange(light.shape[1]) + 0.5) / total
    return centre


def _routed(scan: Scan, truth: Truth) -> PeerReading:
    """The cheapest path from the true begin to the true end of each trace, dark pixels being cheap."""
    import skimage.graph

    route: Any = skimage.graph.route_through_array

    lit = np.flatnonzero(np.isfinite(truth.column).all(axis=0))
    rows = slice(int(lit[0]), min(int(lit[0]) + ROUTE_ROWS, int(lit[-1]) + 1))
    started = time.process_time()
    position = np.full(truth.column.shape, np.nan)
    light = _darkness(scan.read(rows.start, rows.stop))
    cost = np.exp(-light / (0.1 * light.max()))
    for k, line in enumerate(truth.column):
        ends = [(0, int(line[rows.start])), (len(cost) - 1, int(line[rows.stop - 1]))]
        path = np.array(route(cost, *ends, fully_connected=True, geometric=True)[0])
        total = np.bincount(path[:, 0], path[:, 1] + 0.5, len(cost))
        position[k, rows] = total / np.bincount(path[:, 0], minlength=len(cost))
    return PeerReading(position, rows, time.process_time() - started, light.size)
