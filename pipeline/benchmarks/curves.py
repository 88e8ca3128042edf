"""Reading work-precision points: the least time at which a method's error is at most so much."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.benchmarks.work_precision import Point


def of(points: Sequence[Point], method: str) -> list[Point]:
    """Points of a method that have a value."""
    return [point for point in points if point.method == method and point.seconds and math.isfinite(point.error)]


def own(points: Sequence[Point]) -> list[Point]:
    """Points of all of the project's propagators that have a value."""
    return [point for point in points if point.own and point.seconds and math.isfinite(point.error)]


def time_at(points: Sequence[Point], error: float) -> float:
    """Time, ms, at which one method reaches an error: its curve, interpolated between logarithms; NaN if never.

    Points that others beat in both respects are passed over. A method that is always better takes its least time.
    """
    front: list[Point] = []
    for point in sorted(points, key=lambda point: (point.ms, point.error)):
        if not front or point.error < front[-1].error:
            front.append(point)
    if not front or front[-1].error > error:
        return math.nan
    if front[0].error <= error:
        return front[0].ms
    errors = np.log([max(point.error, 1e-17) for point in front])
    times = np.log([point.ms for point in front])
    return float(np.exp(np.interp(-math.log(error), -errors, times)))
