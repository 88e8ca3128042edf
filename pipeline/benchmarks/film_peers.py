"""What others read lines with, on the same image: darkest pixel, centroid.

They are given what the project's reader is not: within which columns each trace stays.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from pipeline.arrays import Floats
from pipeline.benchmarks.film_scores import Truth

_STRIP = 1024
_BESIDE = 10  # px beyond the outermost places of a trace
_NOISES = 4.0  # sigmas of the ground above which a pixel counts


def readings(scan: Any, truth: Truth) -> Iterator[tuple[str, Floats]]:
    """Every peer's name and the columns it reads, (traces, rows) px."""
    windows = [
        slice(max(0, int(np.nanmin(line)) - _BESIDE), min(scan.columns, int(np.nanmax(line)) + _BESIDE))
        for line in truth.column
    ]
    for name, reader in (("column argmax", _darkest), ("centroid", _centroid)):
        yield name, _by_rows(scan, windows, reader)


def _by_rows(scan: Any, windows: list[slice], reader: Callable[[Floats], Floats]) -> Floats:
    position = np.full((len(windows), scan.rows), np.nan)
    for first in range(0, scan.rows, _STRIP):
        stop = min(first + _STRIP, scan.rows)
        light = _darkness(scan.read(first, stop))
        for k, window in enumerate(windows):
            position[k, first:stop] = window.start + reader(light[:, window])
    return position


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
