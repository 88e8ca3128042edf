"""What the march watches for within a step, and what happens there.

`Crossings` notes when a component passes a value; `Escapement` gives a pendulum a kick where its angle passes a
value. The march calls `begin`, `locate`, `strike` and the others below; for `None` they compile to nothing.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from synth.integrators.events_roots import DEGREE, NONE, TO_BERNSTEIN, first_crossing, margin, sign
from synth.kernels.compiled import kernel
from synth.phase import Floats, Integers
from synth.systems.dispatch import by_type, registered, response

_SAME = 1e-12  # crossings nearer than this share of a step are one instant: all of them happen


class Crossings(NamedTuple):
    """Instants to note."""

    component: Integers
    """(watches,) place in the state."""
    level: Floats
    """(watches,) value to cross."""
    direction: Integers
    """(watches,) +1 rising, -1 falling, 0 either."""


class Escapement(NamedTuple):
    """Kicks to give: at a crossing the pendulum's rate jumps along its motion, so that the energy grows as stated."""

    component: Integers
    """(kicks,) place of the pendulum's angle in the state; its rate follows."""
    level: Floats
    """(kicks,) crossing angle, rad."""
    direction: Integers
    """(kicks,) +1 rising, -1 falling, 0 either."""
    pendulum: Integers
    """(kicks,) number of the pendulum, from 0."""
    energy: Floats
    """(kicks,) energy of a kick, >= 0: J, or per m l^2 (rad^2/s^2) for systems without masses."""


class Memory(NamedTuple):
    """What a march remembers of its events, and its working space."""

    sides: Integers
    """(watches,) on which side of the level the component was last."""
    margins: Floats
    """(watches,) by how little a turn of the motion missed or passed the level so far."""
    shares: Floats
    """(watches,) next crossing in the present step."""
    coefficients: Floats
    lefts: Floats
    work: Floats
    impulse: Floats
    noted: Integers
    """(1,) number of crossings so far."""
    times: Floats
    """(capacity,) and their times,"""
    lows: Floats
    """what rounding left over of them,"""
    rates: Floats
    """how fast the component crossed,"""
    which: Integers
    """and the watch that saw each."""


def memory(event: Any, size: int, capacity: int = 1024) -> Memory | None:
    """Working space for the events of a state of `size` components; None for no event."""
    if event is None:
        return None
    watches = event.level.size
    capacity = max(capacity, watches)
    return Memory(
        np.zeros(watches, dtype=np.int64),
        np.full(watches, np.inf),
        np.full(watches, NONE),
        np.zeros((60, DEGREE + 1)),
        np.zeros((60, 2)),
        np.zeros(DEGREE + 1),
        np.zeros(size),
        np.zeros(1, dtype=np.int64),
        np.zeros(capacity),
        np.zeros(capacity),
        np.zeros(capacity),
        np.zeros(capacity, dtype=np.int64),
    )


def roomier(notes: Memory) -> Memory:
    """The same, with room for twice as many events."""
    double = {
        name: np.concatenate([old, np.zeros_like(old)]) for name, old in notes._asdict().items() if name in _NOTES
    }
    return notes._replace(**double)


_NOTES = ("times", "lows", "rates", "which")


@kernel
def begin(event: Any, memory: Any, state: Floats) -> None:
    """Remember the sides at the start."""
    if event is not None:
        for j in range(event.level.size):
            memory.sides[j] = sign(state[event.component[j]] - event.level[j])


@kernel
def locate(
    event: Any, memory: Any, state: Floats, low: Floats, following: Floats, left_over: Floats, polynomial: Floats
) -> float:
    """Share of the step at the first crossing, or 2.0; remembers the crossing of each watch."""
    earliest = NONE
    if event is not None:
        for j in range(event.level.size):
            c, level = event.component[j], event.level[j]
            for m in range(DEGREE + 1):
                value = 0.0
                for row in range(7):
                    value += TO_BERNSTEIN[row, m] * polynomial[row, c]
                memory.coefficients[0, m] = (state[c] - level) + (low[c] + value)
            # the same expression at both ends, so that a step begins with the very number its predecessor ended with
            memory.coefficients[0, 0] = (state[c] - level) + low[c]
            memory.coefficients[0, DEGREE] = (following[c] - level) + left_over[c]
            memory.margins[j] = min(memory.margins[j], margin(memory.coefficients, memory.work))
            memory.shares[j] = first_crossing(
                memory.coefficients, memory.lefts, memory.work, memory.sides[j], event.direction[j]
            )
            earliest = min(earliest, memory.shares[j])
        if earliest > 1.0:
            _pass(event, memory, following, left_over)
    return earliest


@kernel
def _pass(event: Any, memory: Memory, following: Floats, left_over: Floats) -> None:
    """Remember the sides after a step without events."""
    for j in range(event.level.size):
        now = sign((following[event.component[j]] - event.level[j]) + left_over[event.component[j]])
        if now != 0:
            memory.sides[j] = now


@kernel
def miss(event: Any, memory: Any, share: float, following: Floats, left_over: Floats) -> tuple[int, float]:
    """Component of the earliest crossing, and what the state lacks to its level."""
    c, lack = 0, 0.0
    if event is not None:
        for j in range(event.level.size):
            if memory.shares[j] == share:
                c = event.component[j]
                lack = (event.level[j] - following[c]) - left_over[c]
    return c, lack


@kernel
def _happens(event: Any, memory: Memory, j: int, share: float, following: Floats, left_over: Floats) -> bool:
    """Whether watch j fires at this instant; if so, its component is put on the level exactly."""
    c = event.component[j]
    side, direction = memory.sides[j], event.direction[j]
    now = sign((following[c] - event.level[j]) + left_over[c])
    passed = side != 0 and now == -side and (direction == 0 or now == direction)
    if not (memory.shares[j] <= share + _SAME or passed):
        if now != 0:
            memory.sides[j] = now
        return False
    if direction != 0:
        memory.sides[j] = direction
    else:
        memory.sides[j] = -side if side != 0 else sign(following[c + 1])
    following[c] = event.level[j]
    left_over[c] = 0.0
    return True


@kernel
def _note(memory: Memory, j: int, time: float, time_low: float, rate: float) -> None:
    place = memory.noted[0]
    memory.times[place] = time
    memory.lows[place] = time_low
    memory.rates[place] = rate
    memory.which[place] = j
    memory.noted[0] = place + 1


@kernel
def full(event: Any, memory: Any) -> bool:
    """Whether the memory may have no room for what happens next."""
    return event is not None and memory.noted[0] + memory.sides.size > memory.times.size


@kernel
def strike(
    event: Any, memory: Any, share: float, time: float, time_low: float, following: Floats, left_over: Floats,
    slope: Floats, system: Any,
) -> None:  # fmt: skip
    """Note what crosses at this instant, and give the kicks."""
    if event is not None:
        for j in range(event.level.size):
            if _happens(event, memory, j, share, following, left_over):
                _note(memory, j, time, time_low, slope[event.component[j]])
                _kick(event, j, memory.impulse, following, system)


@by_type("event")
def _kick(event: Any, j: int, impulse: Floats, following: Floats, system: Any) -> None:
    """What the crossing of watch j does to the state."""


@registered("_kick", Crossings)
def _nothing(event: Crossings, j: int, impulse: Floats, following: Floats, system: Any) -> None:
    return None


@registered("_kick", Escapement)
@kernel
def _push(event: Escapement, j: int, impulse: Floats, following: Floats, system: Any) -> None:
    rate = following[event.component[j] + 1]
    response(following, event.pendulum[j], system, impulse)
    ease = impulse[event.component[j] + 1]  # change of rate by a unit impulse
    # energy of an impulse J: J rate + J^2 ease/2; the root that pushes along the motion, without cancellation
    speed = abs(rate) + math.sqrt(rate * rate + 2.0 * ease * event.energy[j])
    push = 2.0 * event.energy[j] / speed if speed > 0.0 else 0.0
    if rate < 0.0 or (rate == 0.0 and event.direction[j] < 0):
        push = -push
    for i in range(following.size):
        following[i] += push * impulse[i]
