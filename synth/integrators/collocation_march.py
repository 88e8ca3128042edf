"""The march of exponential collocation through coupled oscillators, interval by interval.

What the systems' remainder and the exact linear flow ask of each other at 16 Gauss nodes is iterated until a further
turn would change nothing. The state is carried as sums of two doubles.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.core import types

from synth.integrators.collocation_lanes import nodes_of
from synth.integrators.collocation_simd import LANES, load, store, total
from synth.kernels.collocation_remainder import NODES
from synth.kernels.compiled import kernel, summing_kernel
from synth.phase import Floats, Integers
from synth.systems.choice import chosen_for, plain
from synth.systems.dispatch import remainder
from synth.systems.terms import motion

POINTS = NODES + 2
"""Start, nodes and end of an interval."""

MOST_TURNS = 16
"""Iterations after which an interval counts as too long."""

DONE, TURNING, ROUGH = 0, 1, 2
"""All intervals done; iteration did not settle; the nodes do not resolve the motion."""

_CAUTION = 4.0  # a turn may change this many times more than the turns of the interval before promise, squared
_WILD = 1e4  # change of a position in sizes, squared, from which no turn leads back
_RENEWAL = 16  # intervals after which convergence is watched from the first turn on
_SPLIT = 134217729.0  # 2^27 + 1
_STALL = 1e3  # changes this many times the smallest that matters are rounding if they fall no longer


@kernel
def march(
    system: Any,
    horizontal: Any,
    vertical: Any,
    excess: Floats,
    weights: Any,
    plan: Any,
    begin: float,
    interval: float,
    count: int,
    state: Floats,
    known: Floats,
    base: Floats,
    position: Floats,
    rate: Floats,
    room: Floats,
    amplitude: Floats,
    continued: bool,
    mirror: Floats,
    limits: Any,
    times: Floats,
    states: Floats,
    report: Integers,
) -> int:
    """Carry the system through consecutive intervals and read it on the way.

    Parameters
    ----------
    system : NamedTuple
        Registered with a remainder.
    horizontal, vertical : motion term or None
        Of the ship.
    excess : (components, 2)
        As for `remainder`.
    weights : tuple of arrays
        Of `collocation_weights.Weights`, all components: flow, (inner, guess) as (2, components, ...), end, propagator and
        reach.
    plan : tuple
        Nodes in intervals (NODES,), rows of the Legendre tail (4 * NODES,), barycentric points (POINTS,) on [-1, 1] and
        shares (POINTS,).
    begin, interval : float
        Start and length, s; their multiples are exact.
    count : int
        Intervals to do.
    state : (components, 4)
        Position and rate, each as leading double and rest; moves on.
    known : (2, components, NODES)
        Remainder of the interval before, in both halves alike; zero if unknown. Moves on.
    base, position, rate, room : (components, 2 * NODES), (components, NODES) twice, (2, components, NODES)
        Work space.
    continued : bool
        Whether the first guess of the remainder is that of the interval before, continued;
    mirror : (components,)
        otherwise it is the same at the same nodes times this: 0 for none, a sign where an interval is half a swing.
    amplitude : (components,)
        Square of the largest size so far; raised.
    limits : (float, float)
        Squares: change of a position, relative to its size, that does not matter; what r beyond its last Legendre
        term may cost.
    times, states : (k,), (k, 2 * components)
        Readings; those inside these intervals are filled.
    report : (4,) int64
        Readings filled so far, turns, intervals done (all raised), and why the march ended.

    Returns
    -------
    int
        Number of intervals done.
    """
    flow, matrices, end, propagator, reach = weights
    places, tail, points, shares = plan
    components = state.shape[0]
    sample = np.zeros((2, NODES))
    sideways, upwards = nodes_of(horizontal, sample[0]), nodes_of(vertical, sample[1])
    spots, table = np.empty((2 * components, POINTS)), np.empty(POINTS)
    settled, unresolved = limits
    now, unchecked, falling = 0, 2, 1.0
    report[3] = DONE
    for i in range(count):
        start = begin + i * interval
        _sample(start, interval, places, horizontal, sample[0])
        _sample(start, interval, places, vertical, sample[1])
        following = start + interval
        reading = report[0] < times.size and times[report[0]] < following
        for c in range(components):
            _free(flow, c, state[c, 0], state[c, 2], base)
            if not continued:
                _mirror(mirror[c], known, now, c)
        which = 1 if continued else 0
        turns, before, going = 0, np.inf, True
        while True:
            _couple(matrices, which, known, now, base, position, rate)
            which = 0
            if not going:
                break
            if turns == MOST_TURNS:
                report[3] = TURNING
                return i
            turns += 1
            now = 1 - now
            remainder(position, rate, sideways, upwards, system, excess, room, known, now)
            if turns >= unchecked:
                change = 0.0
                for c in range(components):
                    step = _change(known, c) * (reach[c] * reach[c])
                    size = max(amplitude[c], 0.25 * _square(position, c))
                    if step > change * size or not step <= np.inf:
                        change = step / size
                if not change <= _WILD:
                    report[3] = TURNING
                    return i
                if before < np.inf:
                    falling = min(1.0, change / before)
                going = not change * min(1.0, _CAUTION * falling) <= settled
                if going and falling > 0.1 and before < np.inf:
                    going = not change <= _STALL * settled
                before = change
                if not (going or reading):
                    break
        unchecked = 2 if i % _RENEWAL == 0 else max(2, turns - 1)
        for c in range(components):
            amplitude[c] = max(amplitude[c], 0.25 * _square(position, c))
            last, further = _tail(tail, known, now, c)
            worth = reach[c] * reach[c] / (16.0 * NODES)
            if last > 0.0 and not last * min(1.0, last / max(further, 1e-300)) * worth <= unresolved * amplitude[c]:
                report[3] = ROUGH
                return i
        report[1] += turns
        report[2] += 1
        if reading:
            for c in range(components):
                spots[2 * c, 0], spots[2 * c + 1, 0] = state[c, 0], state[c, 2]
                for j in range(NODES):
                    spots[2 * c, j + 1] = position[c, j]
                    spots[2 * c + 1, j + 1] = rate[c, j]
        _advance(state, propagator, end, known, now)
        if reading:
            for c in range(components):
                spots[2 * c, POINTS - 1], spots[2 * c + 1, POINTS - 1] = state[c, 0], state[c, 2]
            while report[0] < times.size and times[report[0]] < following:
                _read((times[report[0]] - start) / interval, points, shares, table, spots, states, report[0])
                report[0] += 1
    known[1 - now] = known[now]
    return count


def _sample(begin: float, interval: float, places: Floats, term: Any, out: Floats) -> None:
    """The ship's acceleration at the nodes, if it moves."""
    if term is not None:
        for j in range(NODES):
            out[j] = motion(begin + interval * places[j], term)


@chosen_for(_sample)
def _sampled(begin: Any, interval: Any, places: Any, term: Any, out: Any) -> Any:
    if isinstance(term, types.NoneType):
        return lambda begin, interval, places, term, out: None
    return plain(_sample)


@kernel
def _free(flow: Floats, c: int, position: float, rate: float, out: Floats) -> None:
    for j in range(0, NODES, LANES):
        store(out, (c, j), load(flow, (c, j)) * position + load(flow, (c, NODES + j)) * rate)
        k = 2 * NODES + j
        store(out, (c, NODES + j), load(flow, (c, k)) * position + load(flow, (c, NODES + k)) * rate)


@kernel
def _mirror(sign: float, known: Floats, now: int, c: int) -> None:
    for j in range(0, NODES, LANES):
        store(known, (now, c, j), sign * load(known, (now, c, j)))


@kernel
def _couple(
    matrices: Floats, which: int, known: Floats, now: int, base: Floats, position: Floats, rate: Floats
) -> None:
    for c in range(position.shape[0]):
        first, second = load(base, (c, 0)), load(base, (c, LANES))
        third, fourth = load(base, (c, NODES)), load(base, (c, NODES + LANES))
        for k in range(NODES):
            value = known[now, c, k]
            row = k * NODES
            first += load(matrices, (which, c, row)) * value
            second += load(matrices, (which, c, row + LANES)) * value
            third += load(matrices, (which, c, row + NODES * NODES)) * value
            fourth += load(matrices, (which, c, row + NODES * NODES + LANES)) * value
        store(position, (c, 0), first)
        store(position, (c, LANES), second)
        store(rate, (c, 0), third)
        store(rate, (c, LANES), fourth)


@kernel
def _change(known: Floats, c: int) -> float:
    first = load(known, (1, c, 0)) - load(known, (0, c, 0))
    second = load(known, (1, c, LANES)) - load(known, (0, c, LANES))
    return total(first * first + second * second)


@kernel
def _square(position: Floats, c: int) -> float:
    first, second = load(position, (c, 0)), load(position, (c, LANES))
    return total(first * first + second * second)


@kernel
def _product_sum(rows: Floats, c: int, place: int, known: Floats, now: int, which: int) -> float:
    """Sum over the nodes of a row of weights times the remainder."""
    first = load(rows, (c, place)) * load(known, (now, which, 0))
    return total(first + load(rows, (c, place + LANES)) * load(known, (now, which, LANES)))


@kernel
def _tail(tail: Floats, known: Floats, now: int, c: int) -> tuple[float, float]:
    """Squares of the last and of the last but one pair of Legendre coefficients."""
    first = _product_sum(tail, 0, 0, known, now, c)
    second = _product_sum(tail, 0, NODES, known, now, c)
    third = _product_sum(tail, 0, 2 * NODES, known, now, c)
    fourth = _product_sum(tail, 0, 3 * NODES, known, now, c)
    return third * third + fourth * fourth, first * first + second * second


@kernel
def _advance(state: Floats, propagator: Floats, end: Floats, known: Floats, now: int) -> None:
    """To the end of the interval: exact products with the leading doubles, everything else in the rest."""
    for c in range(state.shape[0]):
        position, position_rest, rate, rate_rest = state[c, 0], state[c, 1], state[c, 2], state[c, 3]
        for row in range(2):
            kick = _product_sum(end, c, row * NODES, known, now, c)
            kick_rest = _product_sum(end, c, (row + 2) * NODES, known, now, c)
            leading, rest = _moved(propagator, c, 8 * row, position, position_rest, rate, rate_rest, kick, kick_rest)
            state[c, 2 * row], state[c, 2 * row + 1] = leading, rest


@kernel
def _moved(
    entries: Floats,
    c: int,
    row: int,
    position: float,
    position_rest: float,
    rate: float,
    rate_rest: float,
    kick: float,
    kick_rest: float,
) -> tuple[float, float]:
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


@summing_kernel
def _read(
    place: float, points: Floats, shares: Floats, table: Floats, spots: Floats, states: Floats, reading: int
) -> None:
    """State inside an interval: the polynomial through start, nodes and end, barycentric."""
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
