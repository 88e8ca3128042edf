"""Counting the marks: the cheapest way through all events, each a mark of some number or none (Viterbi).

A step goes from one event to a later one and counts d marks. Its price: marks missed, events passed over, speed unlike
that of the step before, and pendulums that did not swing d marks' time meanwhile.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Floats
from synth.kernels.compiled import kernel

SLACK = 0.12  # of the speed over the whole film: drift, wow and walk together
SKIP = 8  # events that may be passed over in a row
MISSED, PASSED = 2.5, 14.0  # prices of a mark missed, of an event that is none
PHASE_MOST = 40.0  # price of a swing that does not fit at all
WANDER = 0.006  # rad per root of a mark: what swell does to a pendulum's phase
Whole = NDArray[np.int64]


@kernel
def list_steps(row: Floats, spacing: float, begin: Whole, end: Whole, count: Whole) -> int:
    """Write all steps that could be meant, by their later event; returns how many (also beyond the arrays' size)."""
    total = 0
    for b in range(1, row.size):
        for a in range(max(0, b - SKIP), b):
            length = (row[b] - row[a]) / spacing
            low, high = max(1, math.ceil(length / (1.0 + SLACK))), math.floor(length / (1.0 - SLACK))
            for d in range(low, high + 1):
                if total < begin.size:
                    begin[total], end[total], count[total] = a, b, d
                total += 1
    return total


@kernel
def count_marks(
    row: Floats,
    sigma: Floats,
    spacing: float,
    begin: Whole,
    end: Whole,
    count: Whole,
    price: Floats,
    first_of: Whole,
    ends: int,
    change: float,
    most_change: float,
    forward: Floats,
    backward: Floats,
    before: Whole,
) -> None:
    """Least price of all ways up to and including each step, and of all ways after it; the step before it.

    `first_of` (events + 1,) tells where the steps that end at each event begin. `change` is 1 sigma of the relative
    speed's change per mark's interval, `most_change` its limit over long times. Ways begin and end within the first and
    last `ends` events.
    """
    events = row.size
    for k in range(begin.size):
        a = begin[k]
        best, which = math.inf, -1
        if a < ends:
            best = PASSED * a
        for j in range(first_of[a], first_of[a + 1]):
            total = forward[j] + turn_price(row, sigma, spacing, begin, end, count, j, k, change, most_change)
            if total < best:
                best, which = total, j
        forward[k], before[k] = best + price[k], which
    for k in range(begin.size):
        left = events - 1 - end[k]
        backward[k] = PASSED * left if left < ends else math.inf
    for k in range(begin.size - 1, -1, -1):
        a = begin[k]
        for j in range(first_of[a], first_of[a + 1]):
            total = (
                backward[k] + price[k] + turn_price(row, sigma, spacing, begin, end, count, j, k, change, most_change)
            )
            backward[j] = min(backward[j], total)


@kernel
def turn_price(
    row: Floats,
    sigma: Floats,
    spacing: float,
    begin: Whole,
    end: Whole,
    count: Whole,
    j: int,
    k: int,
    change: float,
    most_change: float,
) -> float:
    """Price of the speed's change from step j to the next, k."""
    length_j, length_k = row[end[j]] - row[begin[j]], row[end[k]] - row[begin[k]]
    away = (length_k / count[k] - length_j / count[j]) / spacing
    apart = 0.5 * (count[j] + count[k])
    room = min(change * apart, most_change) ** 2
    noise = (sigma[begin[j]] ** 2 + sigma[end[j]] ** 2) / count[j] ** 2
    noise += (sigma[begin[k]] ** 2 + sigma[end[k]] ** 2) / count[k] ** 2
    return float(away * away / (room + noise / spacing**2))


@kernel
def price_steps(
    begin: Whole, end: Whole, count: Whole, phase: Floats, doubt: Floats, advance: Floats, spread: Floats, price: Floats
) -> None:
    """Price of every step by itself: marks missed, events passed over, and swings that do not fit."""
    for k in range(begin.size):
        a, b, d = begin[k], end[k], count[k]
        price[k] = MISSED * (d - 1) if d < 6 else MISSED * (5.0 + 0.1 * (d - 6))
        price[k] += PASSED * (b - a - 1)
        for trace in range(phase.shape[0]):
            away = phase[trace, b] - phase[trace, a] - advance[trace] * d
            if math.isfinite(away):
                away -= 2.0 * math.pi * math.floor(away / (2.0 * math.pi) + 0.5)
                room = 2.0 * spread[trace] ** 2 + WANDER**2 * d + doubt[trace, a] + doubt[trace, b]
                price[k] += min(away * away / room, PHASE_MOST)
