"""First guesses of the remainder in an interval, from what it was before.

Clocks repeat themselves: half a swing later the remainder at the same nodes is nearly the same but for its sign, and
so is the way in which it changes. Backward differences over half swings (or as many intervals as make whole numbers
of them) extrapolate that; a motion that does not repeat is continued as a polynomial instead. Which of these, and the
order, is what would have missed least in the interval just done.
"""

from __future__ import annotations

import numpy as np

from synth.kernels.collocation import NODES
from synth.kernels.compiled import kernel
from synth.kernels.lanes import LANES, load, store, total, wide
from synth.phase import Floats

ORDERS = 5
"""Differences kept; the guess that sums the first k of them is guess k, and guess `ORDERS` the polynomial."""


@kernel
def guess(memory: Floats, slot: int, which: int, mirror: Floats, continuation: Floats, known: Floats, now: int) -> None:
    """Fill `known[now]` (components, NODES).

    Parameters
    ----------
    memory : (lag, ORDERS, components, NODES)
        Backward differences of the remainder, those of an interval in row `interval % lag`; zero if unknown.
    slot : int
        Row of the interval to come: its last entries are `lag` intervals old.
    which : int
        The guess.
    mirror : (components,)
        What `lag` intervals do to the remainder, 1 or -1.
    continuation : (1, NODES * NODES)
        Nodes of the interval to come (fast index) from those of the interval before (slow index).
    """
    before = (slot - 1) % memory.shape[0]
    for c in range(mirror.size):
        first, second = wide(0.0), wide(0.0)
        if which == ORDERS:
            for k in range(NODES):
                value = memory[before, 0, c, k]
                first += load(continuation, (0, k * NODES)) * value
                second += load(continuation, (0, k * NODES + LANES)) * value
        else:
            for k in range(which):
                first += load(memory, (slot, k, c, 0))
                second += load(memory, (slot, k, c, LANES))
            first, second = first * mirror[c], second * mirror[c]
        store(known, (now, c, 0), first)
        store(known, (now, c, LANES), second)


@kernel
def remember(memory: Floats, slot: int, mirror: Floats, known: Floats, now: int) -> None:
    """Take the remainder of the interval just done into its row of differences."""
    for c in range(mirror.size):
        first, second = load(known, (now, c, 0)), load(known, (now, c, LANES))
        for k in range(ORDERS):
            old, older = load(memory, (slot, k, c, 0)), load(memory, (slot, k, c, LANES))
            store(memory, (slot, k, c, 0), first)
            store(memory, (slot, k, c, LANES), second)
            first, second = first - old * mirror[c], second - older * mirror[c]


@kernel
def best(memory: Floats, slot: int, worth: Floats, missed: float) -> int:
    """The guess that would have missed least: difference k is what guess k missed.

    Parameters
    ----------
    worth : (components,)
        Of a squared change of the remainder, in squares of sizes.
    missed : float
        What the polynomial missed.
    """
    which = 0
    least = np.inf
    for k in range(ORDERS):
        worst = 0.0
        for c in range(worth.size):
            first, second = load(memory, (slot, k, c, 0)), load(memory, (slot, k, c, LANES))
            worst = max(worst, total(first * first + second * second) * worth[c])
        if worst < least:
            which, least = k, worst
    return ORDERS if missed < least else which
