"""States inside an interval of collocation: the polynomial through its start, nodes and end."""

from __future__ import annotations

from synth.kernels.collocation_remainder import NODES
from synth.kernels.compiled import summing_kernel
from synth.phase import Floats

POINTS = NODES + 2
"""Start, nodes and end of an interval."""


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
