"""Joint least squares of all traces that overlap on one row.

Darkness is a known function f of exposure, exposures of several lines add up, and grain is known per darkness:

    y(u) = background + f(sum_k brightness_k E_k(u - shift_k)) + noise of variance v0 + v1 f.

Where a trace turns, what lies on a row depends as much on when it turned as on where: the slope of its course may be
wrong by what the course is uncertain, and the fit allows for it.

Fitted in darkness, where the grain is normal, and not in exposure, where the toe of the curve would bend it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.tracking.line_profile import profile
from synth.kernels.compiled import kernel

Floats32 = NDArray[np.float32]
Integers = NDArray[np.int64]

OUTLIER = 3.5  # sigma from which on a pixel counts less
FAINTEST = 0.02
ROUNDS = 4
BRIGHTNESS_PRIOR = 0.7
"""1 sigma of what is known of the brightness before, relative."""


@kernel
def solve(matrix: Floats, right: Floats, n: int) -> bool:
    """Inverse of the first n x n of a positive matrix, and its product with `right`, both in place (Gauss-Jordan)."""
    for k in range(n):
        pivot = matrix[k, k]
        if not pivot > 0.0:
            return False
        matrix[k, k] = 1.0
        for j in range(n):
            matrix[k, j] /= pivot
        right[k] /= pivot
        for i in range(n):
            if i != k:
                factor = matrix[i, k]
                matrix[i, k] = 0.0
                for j in range(n):
                    matrix[i, j] -= factor * matrix[k, j]
                right[i] -= factor * right[k]
    return True


@kernel
def fit_row(
    darkness: Floats32,
    first: int,
    nodes: Floats,
    counts: Integers,
    members: Integers,
    spot: float,
    table: Floats,
    table_step: float,
    grain: Floats,
    lamp: Floats,
    prior: Floats,
    settled: float,
    found: Floats,
    profiles: Floats,
    matrices: Floats,
) -> None:
    """Shift and brightness of the traces of one group.

    Parameters
    ----------
    darkness : (n,) array
        Of the pixels of the group's window.
    first : int
        Column of the first of them.
    nodes : (traces, 3, ...) array
        Of all traces (`line_profile.nodes_of`), their numbers in `counts`.
    members : (g,) array
        Which traces.
    table, table_step : (2, m) array, float
        Darkness and its derivative at even steps of exposure.
    lamp : (traces,) array
        Brightness to start from.
    prior : (traces, 2) array
        Variance of the shift as known before, for the sake of the OTHER traces of the group (inf for none), and of the
        slope.
    settled : float
        Last step, over 1.5 spots of the normal, at which to stop.
    found : (traces, 6) array
        Overwritten: shift, its variance, brightness, its variance, mean square residual in units of the noise,
        variance of the shift if the trace lay alone.
    profiles : (traces, 3, ...) array
        Work.
    matrices : (3, 3*traces + 8, 3*traces + 8) array
        Work.
    """
    size, g = darkness.size, members.size
    n = 3 * g + 1
    top = table.shape[1] - 2
    normal, copy, rows = matrices[0], matrices[1], matrices[2]
    value, right, other, start, misfit, weights, limit = rows[0], rows[1], rows[2], rows[3], rows[4], rows[5], rows[6]
    for a in range(g):
        value[3 * a] = 0.0
        value[3 * a + 1] = lamp[members[a]]
        value[3 * a + 2] = 0.0
    value[n - 1] = 0.0
    offset_variance = 0.25 * grain[0]
    for _ in range(ROUNDS):
        for a in range(g):
            k = members[a]
            profile(nodes[k], counts[k], value[3 * a], value[3 * a + 2], spot, first, profiles[k, :, :size])
            peak = 0.02
            for i in range(size):
                peak = max(peak, profiles[k, 0, i])
            limit[a] = 1.5 * spot / peak
            misfit[a], weights[a] = 0.0, 1e-12
        for i in range(n):
            right[i] = 0.0
            start[i] = value[i]
            for j in range(n):
                normal[i, j] = 0.0
        for i in range(size):
            exposure = 0.0
            for a in range(g):
                exposure += value[3 * a + 1] * profiles[members[a], 0, i]
            place = exposure / table_step
            index = min(int(place), top)
            share = min(place - index, 1.0)
            dark = table[0, index] + share * (table[0, index + 1] - table[0, index])
            rate = table[1, index] + share * (table[1, index + 1] - table[1, index])
            residual = darkness[i] - value[n - 1] - dark
            weight = 1.0 / (grain[0] + grain[1] * dark)
            square = residual * residual * weight
            if square > OUTLIER * OUTLIER:
                weight *= OUTLIER / math.sqrt(square)
            for a in range(g):
                k = members[a]
                misfit[a] += square * profiles[k, 0, i]
                weights[a] += profiles[k, 0, i]
                other[3 * a] = rate * value[3 * a + 1] * profiles[k, 1, i]
                other[3 * a + 1] = rate * profiles[k, 0, i]
                other[3 * a + 2] = rate * value[3 * a + 1] * profiles[k, 2, i]
            other[n - 1] = 1.0
            for a in range(n):
                scaled = weight * other[a]
                right[a] += scaled * residual
                for b in range(a + 1):
                    normal[a, b] += scaled * other[b]
        for a in range(g):
            wide = BRIGHTNESS_PRIOR * lamp[members[a]]
            normal[3 * a + 1, 3 * a + 1] += 1.0 / (wide * wide)
            right[3 * a + 1] += (lamp[members[a]] - value[3 * a + 1]) / (wide * wide)
            normal[3 * a, 3 * a] += 1e-9
            normal[3 * a + 2, 3 * a + 2] += 1.0 / prior[members[a], 1]
            right[3 * a + 2] -= value[3 * a + 2] / prior[members[a], 1]
        normal[n - 1, n - 1] += 1.0 / offset_variance
        right[n - 1] -= value[n - 1] / offset_variance
        for a in range(n):
            for b in range(a):
                normal[b, a] = normal[a, b]
        for i in range(n):
            other[i] = right[i]
            for j in range(n):
                copy[i, j] = normal[i, j]
        for a in range(g):
            copy[3 * a, 3 * a] += 1.0 / prior[members[a], 0]
            other[3 * a] -= value[3 * a] / prior[members[a], 0]
        if not solve(copy, other, n):
            break
        moved = 0.0
        for a in range(g):
            step = min(max(other[3 * a], -limit[a]), limit[a])
            value[3 * a] += step
            value[3 * a + 2] += other[3 * a + 2]
            value[3 * a + 1] = max(value[3 * a + 1] + other[3 * a + 1], FAINTEST * lamp[members[a]])
            moved = max(moved, abs(step) / limit[a], 0.3 * abs(other[3 * a + 1]) / lamp[members[a]])
        value[n - 1] += other[n - 1]
        if moved < settled:
            break
    for a in range(g):  # each trace's own reading: the others with what was known of them, itself without
        k = members[a]
        for i in range(n):
            other[i] = right[i]
            for j in range(n):
                copy[i, j] = normal[i, j]
        for b in range(g):
            if b != a:
                copy[3 * b, 3 * b] += 1.0 / prior[members[b], 0]
                other[3 * b] -= start[3 * b] / prior[members[b], 0]
        if not solve(copy, other, n):
            found[k, 0], found[k, 1] = 0.0, np.inf
        else:
            found[k, 0] = start[3 * a] + min(max(other[3 * a], -limit[a]), limit[a])
            found[k, 1] = copy[3 * a, 3 * a]
        found[k, 2] = value[3 * a + 1]
        found[k, 3] = copy[3 * a + 1, 3 * a + 1]
        found[k, 4] = misfit[a] / weights[a]
        found[k, 5] = found[k, 1]
        if g > 1:
            for i in range(4):
                for j in range(4):
                    copy[i, j] = normal[n - 1 if i == 3 else 3 * a + i, n - 1 if j == 3 else 3 * a + j]
            found[k, 5] = copy[0, 0] if solve(copy, other, 4) else np.inf
