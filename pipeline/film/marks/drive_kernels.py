"""Kalman filter and smoother of the paper's motion from mark to mark.

The state is a row, its speed and acceleration, with white noise in the acceleration's rate, and a rotating pair for
each line of wow. Every mark may be measured on any of the traces.
"""

from __future__ import annotations

import math

import numpy as np

from pipeline.arrays import Floats
from pipeline.film.marks.curve_kernels import solve
from synth.kernels.compiled import kernel


@kernel
def filter_drive(
    step: Floats,
    noise: Floats,
    seen: Floats,
    start: Floats,
    start_variance: Floats,
    rows: Floats,
    variance: Floats,
    state: Floats,
    spread: Floats,
    ahead: Floats,
    ahead_spread: Floats,
) -> float:
    """Filter forward; returns -2 log likelihood.

    Parameters
    ----------
    step, noise : (n, n) arrays
        From one mark to the next.
    seen : (n,) array
        What of the state a row is the sum of.
    start, start_variance : (n,), (n, n) arrays
        Before the first mark is seen.
    rows, variance : (traces, marks) arrays
        Measured; NaN = missing.
    state, spread, ahead, ahead_spread : (marks, n) and (marks, n, n) arrays
        After each mark is seen, and before: results.
    """
    n = start.size
    x, p = start.copy(), start_variance.copy()
    gain, moved, half = np.empty(n), np.empty(n), np.empty((n, n))
    total = 0.0
    for k in range(rows.shape[1]):
        if k > 0:
            for i in range(n):
                moved[i] = 0.0
                for j in range(n):
                    moved[i] += step[i, j] * x[j]
                    half[i, j] = 0.0
                    for m in range(n):
                        half[i, j] += step[i, m] * p[m, j]
            for i in range(n):
                x[i] = moved[i]
                for j in range(n):
                    value = noise[i, j]
                    for m in range(n):
                        value += half[i, m] * step[j, m]
                    p[i, j] = value
        for i in range(n):
            ahead[k, i] = x[i]
            for j in range(n):
                ahead_spread[k, i, j] = p[i, j]
        for trace in range(rows.shape[0]):
            away = rows[trace, k]
            if math.isnan(away):
                continue
            room = variance[trace, k]
            for i in range(n):
                gain[i] = 0.0
                for j in range(n):
                    gain[i] += p[i, j] * seen[j]
                away -= seen[i] * x[i]
            for i in range(n):
                room += seen[i] * gain[i]
            for i in range(n):
                x[i] += gain[i] * away / room
            for i in range(n):
                for j in range(n):
                    p[i, j] -= gain[i] * gain[j] / room
            total += away * away / room + math.log(room)
        for i in range(n):
            state[k, i] = x[i]
            for j in range(n):
                spread[k, i, j] = p[i, j]
    return total


@kernel
def smooth_drive(step: Floats, state: Floats, spread: Floats, ahead: Floats, ahead_spread: Floats) -> None:
    """Rauch, Tung and Striebel's smoother: `state` and `spread` become those given all marks."""
    marks, n = state.shape
    half, gain, other = np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    inverse, apart = np.empty((n, n)), np.empty(n)
    for k in range(marks - 2, -1, -1):
        for i in range(n):
            apart[i] = state[k + 1, i] - ahead[k + 1, i]
            for j in range(n):
                inverse[i, j] = ahead_spread[k + 1, i, j]
                other[i, j] = spread[k + 1, i, j] - ahead_spread[k + 1, i, j]
                half[i, j] = 0.0
                for m in range(n):
                    half[i, j] += spread[k, i, m] * step[j, m]
        if not solve(inverse, np.zeros(n), n):
            continue
        multiply(half, inverse, gain, False)
        for i in range(n):
            for j in range(n):
                state[k, i] += gain[i, j] * apart[j]
        multiply(gain, other, half, False)
        multiply(half, gain, other, True)
        for i in range(n):
            for j in range(n):
                spread[k, i, j] += 0.5 * (other[i, j] + other[j, i])


@kernel
def multiply(a: Floats, b: Floats, out: Floats, turned: bool) -> None:
    """Product of two square matrices, the second transposed if `turned`."""
    n = a.shape[0]
    for i in range(n):
        for j in range(n):
            total = 0.0
            for m in range(n):
                total += a[i, m] * (b[j, m] if turned else b[m, j])
            out[i, j] = total
