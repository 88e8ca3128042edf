"""Which trace is which, where the user knows: by resting place, amplitude, or points clicked on the film."""

from __future__ import annotations

from itertools import permutations

import numpy as np

from pipeline.arrays import Floats
from pipeline.film.parts import Expected

MOST_TRACES = 7


def order(course: Floats, slope: Floats, expected: Expected) -> list[int]:
    """Rows of `course` (traces, rows) in the order of `expected`; as they are where nothing is expected of them.

    Distances from clicked points are counted across the line, those of resting place and amplitude along the row, px.
    """
    traces = course.shape[0]
    cost = np.zeros((traces, traces))  # of trace i standing in place j
    middle = np.array([_middle(each) for each in course])
    for j in range(traces):
        if expected.positions is not None and j < len(expected.positions):
            cost[:, j] += np.abs(middle[:, 0] - expected.positions[j])
        if expected.amplitudes is not None and j < len(expected.amplitudes):
            cost[:, j] += np.abs(middle[:, 1] - expected.amplitudes[j])
    if expected.seeds is not None:
        for number, row, column in expected.seeds:
            at = int(np.clip(row, 0, course.shape[1] - 1))
            away = np.abs(course[:, at] - column) / np.sqrt(1.0 + slope[:, at] ** 2)
            if 0 <= int(number) < traces:
                cost[:, int(number)] += np.nan_to_num(away, nan=1e3)
    if traces > MOST_TRACES or not cost.any():
        return list(range(traces))
    return list(min(permutations(range(traces)), key=lambda each: sum(cost[i, j] for j, i in enumerate(each))))


def _middle(course: Floats) -> tuple[float, float]:
    """Resting place and amplitude of a course."""
    known = course[np.isfinite(course)]
    if known.size == 0:
        return 0.0, 0.0
    low, high = np.quantile(known, [0.02, 0.98])
    return 0.5 * float(low + high), 0.5 * float(high - low)
