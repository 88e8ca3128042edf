"""What all exponential collocation shares: the end of an interval, reached without loss.

States are sums of two doubles, (components, 4): position and rate, each as leading double and rest. The remainder at
the nodes is `known` (2, components, NODES): that of this turn, `known[now]`, and of the turn before.
"""

from __future__ import annotations

from typing import Any

from synth.kernels.compiled import kernel
from synth.kernels.lanes import LANES, load, total
from synth.phase import Floats

NODES = 16
"""Gauss nodes of an interval."""

POINTS = NODES + 2
"""Start, nodes and end of an interval."""

_SPLIT = 134217729.0  # 2^27 + 1


@kernel
def advance(state: Floats, propagator: Floats, end: Floats, known: Floats, now: int) -> None:
    """To the end of the interval: exact products with the leading doubles, everything else in the rest."""
    for c in range(state.shape[0]):
        position, position_rest, rate, rate_rest = state[c, 0], state[c, 1], state[c, 2], state[c, 3]
        for row in range(2):
            kick = product_sum(end, c, row * NODES, known, now, c)
            kick_rest = product_sum(end, c, (row + 2) * NODES, known, now, c)
            leading, rest = _moved(propagator, c, 8 * row, position, position_rest, rate, rate_rest, kick, kick_rest)
            state[c, 2 * row], state[c, 2 * row + 1] = leading, rest


@kernel
def product_sum(rows: Floats, c: int, place: int, known: Floats, now: int, which: int) -> float:
    """Sum over the nodes of a row of weights times the remainder."""
    first = load(rows, (c, place)) * load(known, (now, which, 0))
    return total(first + load(rows, (c, place + LANES)) * load(known, (now, which, LANES)))


@kernel
def _moved(
    entries: Any, c: int, row: int, position: float, position_rest: float, rate: float, rate_rest: float,
    kick: float, kick_rest: float,
) -> tuple[float, float]:  # fmt: skip
    """One row of the propagator times the state, plus what the remainder adds; leading double and rest."""
    a, lost = _product(entries[c, row], entries[c, row + 1], entries[c, row + 2], position)
    b, more = _product(entries[c, row + 4], entries[c, row + 5], entries[c, row + 6], rate)
    small = entries[c, row + 3] * position + entries[c, row + 2] * position_rest
    small += entries[c, row + 7] * rate + entries[c, row + 6] * rate_rest
    free, first = _two_sum(a, b)
    total, second = _two_sum(free, kick)
    small = ((small + kick_rest) + (lost + more)) + (first + second)
    leading = total + small
    return leading, small - (leading - total)


@kernel
def _product(head: float, tail: float, whole: float, value: float) -> tuple[float, float]:
    """Product, and what its rounding lost; exact."""
    value_head = value * _SPLIT
    value_head = value_head - (value_head - value)
    value_tail = value - value_head
    product = whole * value
    return product, ((head * value_head - product) + (head * value_tail + tail * value_head)) + tail * value_tail


@kernel
def _two_sum(a: float, b: float) -> tuple[float, float]:
    """Sum, and what its rounding lost; exact."""
    total = a + b
    turned = total - a
    return total, (a - (total - turned)) + (b - turned)
