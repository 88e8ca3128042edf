"""Through an interval of exponential collocation: to its end without loss, states being sums of two doubles; and states
inside it, by the polynomial through its start, nodes and end."""

from __future__ import annotations

from synth.integrators.collocation_simd import LANES, load, total
from synth.kernels.collocation import POINTS, moved
from synth.kernels.collocation_remainder import NODES
from synth.kernels.compiled import kernel, summing_kernel
from synth.phase import Floats


@kernel
def advance(state: Floats, propagator: Floats, end: Floats, known: Floats, now: int) -> None:
    """To the end of the interval: exact products with the leading doubles, everything else in the rest."""
    for c in range(state.shape[0]):
        position, position_rest, rate, rate_rest = state[c, 0], state[c, 1], state[c, 2], state[c, 3]
        for row in range(2):
            kick = product_sum(end, c, row * NODES, known, now, c)
            kick_rest = product_sum(end, c, (row + 2) * NODES, known, now, c)
            leading, rest = moved(propagator, c, 8 * row, position, position_rest, rate, rate_rest, kick, kick_rest)
            state[c, 2 * row], state[c, 2 * row + 1] = leading, rest


@kernel
def product_sum(rows: Floats, c: int, place: int, known: Floats, now: int, which: int) -> float:
    """Sum over the nodes of a row of weights times the remainder."""
    first = load(rows, (c, place)) * load(known, (now, which, 0))
    return total(first + load(rows, (c, place + LANES)) * load(known, (now, which, LANES)))


@summing_kernel
def read(
    place: float, points: Floats, shares: Floats, table: Floats, spots: Floats, states: Floats, reading: int
) -> None:
    """Fill a row of states at a place in the interval, 0 to 1; barycentric."""
    x = 2.0 * place - 1.0
    total, hit = 0.0, -1
    for j in range(POINTS):
        apart = x - points[j]
        if apart == 0.0:
            hit, apart = j, 1.0
        table[j] = shares[j] / apart
        total += table[j]
    if hit >= 0:
        for c in range(spots.shape[0]):
            states[reading, c] = spots[c, hit]
        return
    for c in range(spots.shape[0]):
        value = 0.0
        for j in range(POINTS):
            value += table[j] * spots[c, j]
        states[reading, c] = value / total
