"""Escapements: what the explicit march watches for within a step, and the kicks it gives there.

The march calls `begin`, `locate`, `strike` and the others below; for `None` they compile to nothing.

Crossings are found with certainty, on the dense polynomial in Bernstein form. The number of sign changes in its coefficients
bounds the number of roots (Descartes): none means no crossing, one means exactly one; more, and the interval is halved
(de Casteljau). A touch without crossing ends as an interval too short to split and is no crossing; a double crossing
within a step is seen as two.
"""

from __future__ import annotations

import math
from math import comb
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from data_schemas.errors import UsageError
from synth.integrators.explicit_step import Space
from synth.kernels.compiled import kernel
from synth.phase import Floats, Integers
from synth.systems.dispatch import response

DEGREE = 7
NONE = 2.0
_TURN_HALVINGS = 30  # the value at a turn errs by the square of 2^-30
_SHORTEST = 2.0**-48  # of a step: roots closer than this differ by rounding only
_SAME = 1e-12  # crossings nearer than this share of a step are one instant: all of them happen


class Escapement(NamedTuple):
    """Kicks to give: at a crossing the pendulum's rate jumps along its motion, so that the energy grows as stated."""

    component: Integers  # (kicks,) place of the pendulum's angle in the state; its rate follows
    level: Floats  # (kicks,) crossing angle, rad
    direction: Integers  # (kicks,) +1 rising, -1 falling, 0 either
    pendulum: Integers  # (kicks,) number of the pendulum, from 0
    energy: Floats  # (kicks,) energy of a kick, >= 0: J, or per m l^2 (rad^2/s^2) for systems without masses


def escapement(
    system: Any, pendulum: ArrayLike, angle: ArrayLike, energy: ArrayLike, direction: ArrayLike = 1
) -> Escapement:
    """Kick pendulums when they pass an angle.

    Parameters
    ----------
    system : NamedTuple
    pendulum : array of int
        Number of the pendulum each kick belongs to, from 0; a pendulum may have several.
    angle : array
        Crossing angle, rad.
    energy : array
        What a kick adds to the energy of the whole system: J, or per m l^2 (rad^2/s^2) where the system has no
        masses. Not negative.
    direction : array of int
        +1 rising, -1 falling, 0 both ways.
    """
    number, way = (np.asarray(each, dtype=np.int64) for each in (pendulum, direction))
    level, given = (np.asarray(each, dtype=np.float64) for each in (angle, energy))
    columns = np.broadcast_arrays(system.first_angle + 2 * number, level, way, number, given)
    made = Escapement(*(np.array(each, ndmin=1) for each in columns))
    if not np.isin(made.direction, (-1, 0, 1)).all():
        raise UsageError("direction of a kick: 1 rising, -1 falling, 0 both ways")
    if not (made.energy >= 0.0).all():
        raise UsageError("energy of a kick must be 0 or more")
    return made


class Memory(NamedTuple):
    """What a march remembers of its kicks, and its working space."""

    sides: Integers  # (kicks,) on which side of the level the component was last
    margins: Floats  # (kicks,) by how little a turn of the motion missed or passed the level so far
    shares: Floats  # (kicks,) next crossing in the present step
    coefficients: Floats
    lefts: Floats
    work: Floats
    impulse: Floats


def memory(event: Escapement | None, size: int) -> Memory | None:
    """Working space for the kicks of a state of `size` components; None for no event."""
    if event is None:
        return None
    kicks = event.level.size
    watched = np.zeros(kicks, dtype=np.int64), np.full(kicks, np.inf), np.full(kicks, NONE)
    return Memory(*watched, np.zeros((60, DEGREE + 1)), np.zeros((60, 2)), np.zeros(DEGREE + 1), np.zeros(size))


@kernel
def begin(event: Any, memory: Any, state: Floats) -> None:
    """Remember the sides at the start."""
    if event is not None:
        for j in range(event.level.size):
            memory.sides[j] = sign(state[event.component[j]] - event.level[j])


@kernel
def locate(event: Escapement, memory: Memory, space: Space) -> float:
    """Share of the step at the first crossing, or 2.0; remembers the crossing of each kick, and the sides if none."""
    state, low, following, left_over = space.state, space.low, space.following, space.left_over
    earliest = NONE
    for j in range(event.level.size):
        c, level = event.component[j], event.level[j]
        for m in range(DEGREE + 1):
            value = 0.0
            for row in range(7):
                value += TO_BERNSTEIN[row, m] * space.polynomial[row, c]
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
        for j in range(event.level.size):
            now = sign((following[event.component[j]] - event.level[j]) + left_over[event.component[j]])
            if now != 0:
                memory.sides[j] = now
    return earliest


@kernel
def miss(event: Escapement, memory: Memory, share: float, space: Space) -> tuple[int, float]:
    """Component of the earliest crossing, and what the state lacks to its level."""
    c, lack = 0, 0.0
    for j in range(event.level.size):
        if memory.shares[j] == share:
            c = event.component[j]
            lack = (event.level[j] - space.following[c]) - space.left_over[c]
    return c, lack


@kernel
def _happens(event: Any, memory: Memory, j: int, share: float, space: Space) -> bool:
    """Whether kick j fires at this instant; if so, its component is put on the level exactly."""
    following, left_over = space.following, space.left_over
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
def strike(
    event: Escapement, memory: Memory, share: float, time: float, space: Space, system: Any, moments: Floats,
    which: Integers, noted: int,
) -> int:  # fmt: skip
    """Give the kicks of what crosses at this instant, and note them; how many are noted."""
    for j in range(event.level.size):
        if _happens(event, memory, j, share, space):
            moments[noted], which[noted] = time, j
            noted += 1
            _kick(event, j, memory.impulse, space.following, system)
    return noted


@kernel
def _kick(event: Escapement, j: int, impulse: Floats, following: Floats, system: Any) -> None:
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


@kernel
def sign(value: float) -> int:
    """-1, 0 or 1."""
    return int(value > 0.0) - int(value < 0.0)


@kernel
def changes(coefficients: Floats, row: int, before: int) -> int:
    """Number of sign changes in one row of coefficients; zeros are skipped, a leading one takes the sign `before`."""
    count = 0
    last = before
    if coefficients[row, 0] != 0.0:
        last = sign(coefficients[row, 0])
    for j in range(1, DEGREE + 1):
        now = sign(coefficients[row, j])
        if now != 0:
            if last != 0 and now != last:
                count += 1
            last = now
    return count


@kernel
def halve(coefficients: Floats, row: int) -> None:
    """Split a row at its middle: the right half stays in `row`, the left half goes to `row + 1`."""
    for level in range(DEGREE + 1):
        coefficients[row + 1, level] = coefficients[row, 0]
        for j in range(DEGREE - level):
            coefficients[row, j] = 0.5 * (coefficients[row, j] + coefficients[row, j + 1])
    # what is left on the triangle's other side is the right half, in order


@kernel
def value_and_slope(coefficients: Floats, row: int, share: float, work: Floats) -> tuple[float, float]:
    """Polynomial and derivative at `share` of the row's own interval (de Casteljau, stable)."""
    rest = 1.0 - share
    for j in range(DEGREE + 1):
        work[j] = coefficients[row, j]
    for level in range(DEGREE - 1):
        for j in range(DEGREE - level):
            work[j] = rest * work[j] + share * work[j + 1]
    return rest * work[0] + share * work[1], DEGREE * (work[1] - work[0])


@kernel
def polish(coefficients: Floats, row: int, rising: int, work: Floats) -> float:
    """The only crossing within a row's interval, to rounding: Newton inside a bracket that halves when it must.

    A zero at the left end is the crossing if the polynomial leaves it to the side it crosses to; otherwise it is the
    crossing before, and this one is further on.
    """
    left, right = 0.0, 1.0
    first, last = coefficients[row, 0], coefficients[row, DEGREE]
    share = first / (first - last) if first != last else 0.5
    if first == 0.0:
        for j in range(1, DEGREE + 1):
            leaving = sign(coefficients[row, j])
            if leaving == rising:
                return 0.0
            if leaving != 0:
                break
        share = 0.5
    for _ in range(100):
        value, slope = value_and_slope(coefficients, row, share, work)
        if value * rising < 0.0:
            left = share
        else:
            right = share
        if slope * rising > 0.0:
            guess = share - value / slope
        else:
            guess = 0.5 * (left + right)
        if not left <= guess <= right:
            guess = 0.5 * (left + right)
        if abs(guess - share) <= 1e-16:
            return guess
        share = guess
    return share


@kernel
def first_crossing(coefficients: Floats, lefts: Floats, work: Floats, before: int, direction: int) -> float:
    """Share of the first crossing in `direction` (+1 rising, -1 falling, 0 either), or 2.0 for none.

    Row 0 of `coefficients` (60, 8) holds the polynomial and is used up; the other rows, `lefts` (60, 2: left end and
    width of each row's interval) and `work` (8,) are working space. `before` is the sign of the polynomial just before
    the interval, for a start at zero exactly.
    """
    lefts[0, 0] = 0.0
    lefts[0, 1] = 1.0
    row = 0
    last = before
    while row >= 0:
        count = changes(coefficients, row, last)
        if count > 1 and lefts[row, 1] > _SHORTEST:
            halve(coefficients, row)
            half = 0.5 * lefts[row, 1]
            lefts[row + 1, 0] = lefts[row, 0]
            lefts[row + 1, 1] = half
            lefts[row, 0] += half
            lefts[row, 1] = half
            row += 1
            continue
        end = sign(coefficients[row, DEGREE])
        if count % 2 == 1 and (direction == 0 or end == direction):
            return lefts[row, 0] + lefts[row, 1] * polish(coefficients, row, end, work)
        if end != 0:
            last = end
        row -= 1
    return NONE


@kernel
def margin(coefficients: Floats, work: Floats) -> float:
    """|value| of row 0 where it turns round within the interval: how near it comes to a touch; inf if it does not turn."""
    rise = sign(coefficients[0, 1] - coefficients[0, 0])
    if rise * sign(coefficients[0, DEGREE] - coefficients[0, DEGREE - 1]) >= 0:
        return np.inf
    left, right = 0.0, 1.0
    for _ in range(_TURN_HALVINGS):
        middle = 0.5 * (left + right)
        _, slope = value_and_slope(coefficients, 0, middle, work)
        if slope * rise > 0.0:
            left = middle
        else:
            right = middle
    value, _ = value_and_slope(coefficients, 0, right, work)
    return abs(value)


def _bernstein() -> Floats:
    """Bernstein coefficients of x^a (1-x)^b, the terms of the dense output."""
    powers = ((1, 0), (1, 1), (2, 1), (2, 2), (3, 2), (3, 3), (4, 3))
    table = np.zeros((7, DEGREE + 1))
    for term, (a, b) in enumerate(powers):
        free = DEGREE - a - b
        for j in range(free + 1):
            table[term, a + j] = comb(free, j) / comb(DEGREE, a + j)
    return table


TO_BERNSTEIN = _bernstein()  # (7, 8): from the coefficients of the dense output, less the state at the step's start
