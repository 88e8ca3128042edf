"""Exponential collocation through coupled oscillators, interval by interval.

The remainder and the exact linear flow are iterated at 16 Gauss nodes until a further turn would change nothing.
States are sums of two doubles; inside an interval they are read from the polynomial through its start, nodes and end.

Clocks repeat themselves: half a swing later the remainder is nearly the same but for its sign, and so is its change.
First guesses are backward differences over half swings (or as many intervals as make whole numbers of them); a motion
that does not repeat is continued as a polynomial. The one that would have missed least in the last interval is taken.
"""

from typing import Any, NamedTuple

import numpy as np

from synth.integrators.collocation_remainders import Work, nodes_of
from synth.kernels.collocation import NODES, advance, change, couple, last_terms
from synth.kernels.compiled import kernel, making_kernel
from synth.kernels.lanes import load, store, total
from synth.phase import Floats, Integers
from synth.systems.dispatch import remainder, taken_in
from synth.systems.terms import motion

ORDERS = 5  # differences kept; the guess that sums the first k of them is guess k, and guess `ORDERS` the polynomial
DONE, TURNING, ROUGH = 0, 1, 2  # All intervals done; iteration did not settle; the nodes do not resolve the motion
_MOST_TURNS = 16  # iterations after which an interval counts as too long
_CAUTION = 4.0  # a turn may change this many times more than the turns of the interval before promise, squared
_WILD = 1e4  # change of a position in sizes, squared, from which no later turn leads back
_RENEWAL = 16  # intervals after which convergence is watched from the first turn to the second, and guesses compared
_LEAST = 1e-300  # square of a size: what a first guess leaves at rest has none
_ASIDE = 2.0**-51  # from a node, in half intervals
_STALL = 1e3  # changes this many times the smallest that matters are rounding if they fall no longer


class Nodes(NamedTuple):
    """What every march needs of the nodes, whatever the system."""

    tail: Floats  # (1, 4 * NODES) rows of the Legendre tail
    continuation: Floats
    """(1, NODES * NODES) nodes of the interval to come (fast index) from those of the interval before (slow index)."""
    points: Floats
    shares: Floats  # (NODES,) the nodes on [-1, 1], with their barycentric shares,
    end_shares: tuple[float, float]  # and those of start and end of the interval


class Level(NamedTuple):
    """One length of intervals, with the weights of all components, (components, ...) each as in `Weights`."""

    interval: float  # s
    lag: int  # intervals after which the motion repeats itself, as far as it does; whole half swings
    mirror: Floats  # (components,) what that many do to the remainder, 1 or -1
    flow: Floats
    inner: Floats
    end: Floats
    propagator: Floats
    reach: Floats


@making_kernel
def march(
    system: Any, horizontal: Any, vertical: Any, level: Level, nodes: Nodes, work: Work, limits: Any, begin: float,
    count: int, times: Floats, states: Floats, report: Integers,
) -> int:  # fmt: skip
    """Integrate `count` intervals from `begin` (s), filling `states` (k, n) at `times` (k,); how many were done.

    `limits` are squares: change of a position, relative, that does not matter; what r beyond its last Legendre term may
    cost. The `report` (5,): readings filled, turns, intervals (all raised), why it ended, and the guess in use.
    """
    interval, mirror, reach = level.interval, level.mirror, level.reach
    state, amplitude, memory, known = work.state, work.amplitude, work.memory, work.known
    base, position, rate = work.base, work.position, work.rate
    tail, continuation = nodes.tail, nodes.continuation
    components = state.shape[0]
    sample = np.zeros((2, NODES))
    sideways, upwards = nodes_of(horizontal, sample[0]), nodes_of(vertical, sample[1])
    begun, worth = np.empty((components, 4)), np.empty(components)
    settled, unresolved = limits
    now, unchecked, falling = 0, 1, 1.0
    report[3] = DONE
    for i in range(count):
        start = begin + i * interval
        _sample(start, interval, nodes.points, horizontal, sample[0])
        _sample(start, interval, nodes.points, vertical, sample[1])
        following = start + interval
        reading = report[0] < times.size and times[report[0]] < following
        for c in range(components):
            for k in range(0, 2 * NODES, NODES):  # position, then rate
                own = load(level.flow, (c, 2 * k)) * state[c, 0]
                store(base, (c, k), own + load(level.flow, (c, 2 * k + NODES)) * state[c, 2])
        slot = report[2] % memory.shape[0]
        guess(memory, slot, report[4], mirror, continuation, known, now)
        renewed = i % _RENEWAL == 0
        turns, before, going = 0, np.inf, True
        while True:
            for c in range(components):
                couple(level.inner, 0, known, now, c, base, 0, position)
                couple(level.inner, NODES * NODES, known, now, c, base, NODES, rate)
            if not going:
                break
            if turns == _MOST_TURNS:
                report[3] = TURNING
                return i
            turns += 1
            now = 1 - now
            remainder(work, sideways, upwards, system, now)
            if turns >= unchecked:
                moved = 0.0
                for c in range(components):
                    step = change(known, c) * (reach[c] * reach[c])
                    size = max(amplitude[c], 0.25 * _square(position, c), _LEAST)
                    if step > moved * size or not step <= np.inf:
                        moved = step / size
                if turns > 1 and not moved <= _WILD:
                    report[3] = TURNING
                    return i
                if before <= _WILD:
                    falling = min(1.0, moved / before)
                going = not moved * min(1.0, _CAUTION * falling) <= settled
                if going and falling > 0.1 and before <= _WILD:
                    going = not moved <= _STALL * settled
                going = going or (renewed and turns == 1)
                before = moved
                if not (going or reading):
                    break
        unchecked = 1 if (i + 1) % _RENEWAL == 0 else max(1, turns - 1)
        for c in range(components):
            amplitude[c] = max(amplitude[c], 0.25 * _square(position, c))
            last, further = last_terms(tail, known, now, c)
            cost = reach[c] * reach[c] / (16.0 * NODES)
            if last > 0.0 and not last * min(1.0, last / max(further, 1e-300)) * cost <= unresolved * amplitude[c]:
                report[3] = ROUGH
                return i
        if renewed or i < _RENEWAL:
            missed = 0.0
            guess(memory, slot, ORDERS, mirror, continuation, known, 1 - now)
            for c in range(components):
                worth[c] = reach[c] * reach[c] / amplitude[c] if amplitude[c] > 0.0 else 0.0
                missed = max(missed, change(known, c) * worth[c])
            remember(memory, slot, mirror, known, now)
            report[4] = best(memory, slot, worth, missed)
        else:
            remember(memory, slot, mirror, known, now)
        report[1] += turns
        report[2] += 1
        for c in range(components):
            begun[c, 0], begun[c, 2] = state[c, 0], state[c, 2]
        advance(state, level.propagator, level.end, known, now)
        while report[0] < times.size and times[report[0]] < following:
            _read((times[report[0]] - start) / interval, nodes, begun, work, states, report[0])
            report[0] += 1
    return count


@taken_in
def _sample(begin: float, interval: float, points: Floats, term: Any, out: Floats) -> None:
    """The ship's acceleration at the nodes, if it moves."""
    if term is not None:
        for j in range(NODES):
            out[j] = motion(begin + interval * (0.5 * (points[j] + 1.0)), term)


@kernel
def _square(position: Floats, c: int) -> float:
    values = load(position, (c, 0))
    return total(values * values)


@kernel
def _read(place: float, nodes: Nodes, begun: Floats, work: Work, states: Floats, reading: int) -> None:
    """Fill a row of states at a place in the interval, 0 to 1: barycentric, through its start, nodes and end."""
    if place == 0.0:
        for c in range(begun.shape[0]):
            states[reading, 2 * c], states[reading, 2 * c + 1] = begun[c, 0], begun[c, 2]
        return
    x, whole = 2.0 * place - 1.0, np.inf
    while not abs(whole) < np.inf:
        inside = load(nodes.shares, (0,)) / (x - load(nodes.points, (0,)))
        start, end = nodes.end_shares[0] / (x + 1.0), nodes.end_shares[1] / (x - 1.0)
        whole = (start + end) + total(inside)
        x += _ASIDE  # at a node the sum is not finite
    for c in range(begun.shape[0]):
        one, two = total(inside * load(work.position, (c, 0))), total(inside * load(work.rate, (c, 0)))
        states[reading, 2 * c] = (one + start * begun[c, 0] + end * work.state[c, 0]) / whole
        states[reading, 2 * c + 1] = (two + start * begun[c, 2] + end * work.state[c, 2]) / whole


@kernel
def guess(memory: Floats, slot: int, which: int, mirror: Floats, continuation: Floats, known: Floats, now: int) -> None:
    """Fill `known[now]` by guess number `which`.

    Row `interval % lag` of `memory` holds an interval's backward differences, zero if unknown; `slot` is the next row.
    """
    before = (slot - 1) % memory.shape[0]
    for c in range(mirror.size):
        guessed = 0.0
        if which == ORDERS:
            for k in range(NODES):
                guessed += load(continuation, (0, k * NODES)) * memory[before, 0, c, k]
        else:
            for k in range(which):
                guessed += load(memory, (slot, k, c, 0))
            guessed = guessed * mirror[c]
        store(known, (now, c, 0), guessed)


@kernel
def remember(memory: Floats, slot: int, mirror: Floats, known: Floats, now: int) -> None:
    """Take the remainder of the interval just done into its row of differences."""
    for c in range(mirror.size):
        difference = load(known, (now, c, 0))
        for k in range(ORDERS):
            old = load(memory, (slot, k, c, 0))
            store(memory, (slot, k, c, 0), difference)
            difference = difference - old * mirror[c]


@kernel
def best(memory: Floats, slot: int, worth: Floats, missed: float) -> int:
    """The guess that would have missed least; `worth` (components,) is that of a squared change of the remainder."""
    which = 0
    least = np.inf
    for k in range(ORDERS):
        worst = 0.0
        for c in range(worth.size):
            difference = load(memory, (slot, k, c, 0))
            worst = max(worst, total(difference * difference) * worth[c])
        if worst < least:
            which, least = k, worst
    return ORDERS if missed < least else which
