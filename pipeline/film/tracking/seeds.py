"""Seeds without clicks: three turning points make a swing, and a swing either lies on dark paper all along or not.

Two turning points on one side and one on the other between them fix a harmonic on a slow curve. The hypothesis is
judged by the share of its way on which the paper is darker than both its sides: nothing but a swinging trace is dark
along 1.5 periods of such a curve.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from pipeline.film.tracking.row_fit import solve
from synth.kernels.compiled import kernel

SAMPLES = 96
LEAST_SHARE = 0.5
STRIDE = 37  # has no divisor in common with it: a few of them are spread over the whole way
BEYOND = 0.3  # periods judged before the first and after the last turning point
Floats32 = NDArray[np.float32]


@kernel
def swing_through(points: Floats, a: int, b: int, c: int, out: Floats, matrix: Floats, right: Floats) -> bool:
    """Harmonic on a parabola that turns at three points, at the row of the middle one: m, m1, m2, p, q, w."""
    before, after = points[a, 0] - points[b, 0], points[c, 0] - points[b, 0]
    frequency = 2.0 * math.pi / (after - before)
    swing = 0.5 * abs(points[b, 1] - 0.5 * (points[a, 1] + points[c, 1]))
    for i in range(5):
        right[i] = 0.0
        for j in range(5):
            matrix[i, j] = 0.0
    row = right[5:10]
    slack = 0.05 * swing * frequency  # of the slope at a turning point: its row is known to a good part of a row
    for n in range(6):
        place = before if n % 3 == 0 else (0.0 if n % 3 == 1 else after)
        at = a if n % 3 == 0 else (b if n % 3 == 1 else c)
        co, si = math.cos(frequency * place), math.sin(frequency * place)
        if n < 3:
            row[0], row[1], row[2], row[3], row[4] = 1.0, place, 0.5 * place * place, co, -si
            value = points[at, 1]
        else:
            row[0], row[1], row[2] = 0.0, 1.0 / slack, place / slack
            row[3], row[4] = -frequency * si / slack, -frequency * co / slack
            value = 0.0
        for i in range(5):
            right[i] += row[i] * value
            for j in range(5):
                matrix[i, j] += row[i] * row[j]
    stiff = 1.0 / (0.05 * swing * frequency * frequency)
    matrix[2, 2] += stiff * stiff
    if not solve(matrix, right, 5):
        return False
    for i in range(5):
        out[i] = right[i]
    out[5] = frequency
    return True


@kernel
def share_on_line(smooth: Floats32, middle: float, state: Floats, spot: float, least: float) -> float:
    """Share of a hypothesis' way, 1.5 periods and a bit, on which the paper is darker than both its sides."""
    rows, columns = smooth.shape
    period = 2.0 * math.pi / state[5]
    length = (0.5 + BEYOND) * period
    hits, seen = 0, 0
    for n in range(SAMPLES):
        i = n * STRIDE % SAMPLES
        if n == SAMPLES // 4 and hits < SAMPLES // 10:
            return 0.0
        along = -length + 2.0 * length * (i + 0.5) / SAMPLES
        co, si = math.cos(state[5] * along), math.sin(state[5] * along)
        column = state[0] + along * (state[1] + 0.5 * along * state[2]) + state[3] * co - state[4] * si
        slope = state[1] + along * state[2] - state[5] * (state[3] * si + state[4] * co)
        size = math.sqrt(1.0 + slope * slope)
        row = middle + along
        if row < 0.0 or row >= rows or column < 0.0 or column >= columns:
            continue
        seen += 1
        sides, lowest = 0.0, 0
        for sign in (-1.0, 1.0):
            r = int(row + sign * 4.0 * spot * slope / size)
            c = int(column - sign * 4.0 * spot / size)
            if 0 <= r < rows and 0 <= c < columns:
                sides += smooth[r, c]
                lowest += 1
        here = smooth[int(row), int(column)]
        if lowest > 0 and here - sides / lowest > least:
            hits += 1
    if seen < 0.7 * SAMPLES:
        return 0.0
    return hits / seen


@kernel
def propose(
    smooth: Floats32, points: Floats, spot: float, least: float, shortest: float, longest: float, out: Floats
) -> int:
    """Swings through all triples of turning points that are good enough: (n, 8) of row, state, share; their number."""
    n, count = points.shape[0], 0
    state, matrix, right = np.empty(6), np.empty((5, 5)), np.empty(10)
    for a in range(n):
        for b in range(a + 1, n):
            first = points[b, 0] - points[a, 0]
            if first > 0.7 * longest:
                break
            width = abs(points[b, 1] - points[a, 1])
            if points[a, 2] == points[b, 2] or first < 0.3 * shortest or width < 8.0 * spot:
                continue
            if (points[b, 1] - points[a, 1]) * points[b, 2] < 0.0:
                continue
            for c in range(b + 1, n):
                second = points[c, 0] - points[b, 0]
                if second > 2.0 * first or first + second > longest:
                    break
                if points[c, 2] != points[a, 2] or second < 0.5 * first or first + second < shortest:
                    continue
                if abs(points[c, 1] - points[a, 1]) > 1.2 * width:
                    continue
                if not swing_through(points, a, b, c, state, matrix, right):
                    continue
                share = share_on_line(smooth, points[b, 0], state, spot, least)
                if share >= LEAST_SHARE and count < out.shape[0]:
                    out[count, 0] = points[b, 0]
                    for i in range(6):
                        out[count, 1 + i] = state[i]
                    out[count, 7] = share
                    count += 1
    return count
