"""Escapements: what the explicit march watches for within a step, and the kicks it gives; `None` compiles to nothing.

Crossings are found with certainty, on the dense polynomial in Bernstein form. The number of sign changes in its
coefficients bounds the number of roots (Descartes): none means no crossing, one means exactly one; more, and the
interval is halved (de Casteljau). A touch is no crossing; a double crossing within a step is seen as two.
"""

import math
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
_STRAIGHT = 2.0**-24  # of a step: a single crossing is interpolated linearly, to the square of this
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
    """Kick pendulums when they pass an angle: an `Escapement` of broadcast arguments, several kicks a pendulum."""
    number, way = (np.asarray(each, dtype=np.int64) for each in (pendulum, direction))
    level, given = (np.asarray(each, dtype=np.float64) for each in (angle, energy))
    columns = np.broadcast_arrays(system.first_angle + 2 * number, level, way, number, given)
    kicks = Escapement(*(np.array(each, ndmin=1) for each in columns))
    if not np.isin(kicks.direction, (-1, 0, 1)).all():
        raise UsageError("direction of a kick: 1 rising, -1 falling, 0 both ways")
    if not (kicks.energy >= 0.0).all():
        raise UsageError("energy of a kick must be 0 or more")
    return kicks


class Memory(NamedTuple):
    """What a march remembers of its kicks, and its working space."""

    sides: Integers  # (kicks,) on which side of the level the component was last
    margins: Floats  # (kicks,) by how little a turn of the motion missed or passed the level so far
    shares: Floats  # (kicks,) next crossing in the present step
    coefficients: Floats
    lefts: Floats
    impulse: Floats


def memory(event: Escapement | None, size: int) -> Memory | None:
    """Working space for the kicks of a state of `size` components; None for no event."""
    if event is None:
        return None
    kicks = event.level.size
    watched = np.zeros(kicks, dtype=np.int64), np.full(kicks, np.inf), np.full(kicks, NONE)
    return Memory(*watched, np.zeros((60, DEGREE + 1)), np.zeros((60, 2)), np.zeros(size))


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
        memory.margins[j] = min(memory.margins[j], margin(memory.coefficients))
        memory.shares[j] = first_crossing(memory.coefficients, memory.lefts, memory.sides[j], event.direction[j])
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
def strike(
    event: Escapement, memory: Memory, share: float, time: float, space: Space, system: Any, moments: Floats,
    which: Integers, noted: int,
) -> int:  # fmt: skip
    """Put what crosses at this instant on its level, kick it, and note it; how many are noted."""
    following, left_over, impulse = space.following, space.left_over, memory.impulse
    for j in range(event.level.size):
        c, side, direction, energy = event.component[j], memory.sides[j], event.direction[j], event.energy[j]
        now = sign((following[c] - event.level[j]) + left_over[c])
        passed = side != 0 and now == -side and (direction == 0 or now == direction)
        if not (memory.shares[j] <= share + _SAME or passed):
            if now != 0:
                memory.sides[j] = now
            continue
        rate = following[c + 1]
        memory.sides[j] = direction if direction != 0 else -side if side != 0 else sign(rate)
        following[c], left_over[c] = event.level[j], 0.0
        moments[noted], which[noted] = time, j
        noted += 1
        response(following, event.pendulum[j], system, impulse)
        # energy of an impulse J: J rate + J^2 ease/2; the root that pushes along the motion, without cancellation
        ease = impulse[c + 1]  # change of rate by a unit impulse
        speed = abs(rate) + math.sqrt(rate * rate + 2.0 * ease * energy)
        push = 2.0 * energy / speed if speed > 0.0 else 0.0
        if rate < 0.0 or (rate == 0.0 and direction < 0):
            push = -push
        for i in range(following.size):
            following[i] += push * impulse[i]
    return noted


@kernel
def sign(value: float) -> int:
    """-1, 0 or 1."""
    return int(value > 0.0) - int(value < 0.0)


@kernel
def changes(coefficients: Floats, row: int, before: int) -> int:
    """Number of sign changes in one row of coefficients; zeros are skipped, a leading one takes the sign `before`."""
    count, last = 0, sign(coefficients[row, 0])
    if last == 0:
        last = before
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
def first_crossing(coefficients: Floats, lefts: Floats, before: int, direction: int) -> float:
    """Share of the first crossing in `direction` (+1 rising, -1 falling, 0 either), or 2.0 for none.

    Row 0 of `coefficients` (60, 8) is the polynomial; its other rows and `lefts` (60, 2) are working space.
    """
    lefts[0, 0], lefts[0, 1] = 0.0, 1.0
    row, last = 0, before
    while row >= 0:
        count, end = changes(coefficients, row, last), sign(coefficients[row, DEGREE])
        wanted = count % 2 == 1 and (direction == 0 or end == direction)
        if (count > 1 and lefts[row, 1] > _SHORTEST) or (wanted and lefts[row, 1] > _STRAIGHT):
            halve(coefficients, row)
            half = 0.5 * lefts[row, 1]
            lefts[row + 1, 0], lefts[row + 1, 1] = lefts[row, 0], half
            lefts[row, 0] += half
            lefts[row, 1] = half
            row += 1
            continue
        if wanted:
            drop = coefficients[row, 0] - coefficients[row, DEGREE]
            return lefts[row, 0] + (lefts[row, 1] * (coefficients[row, 0] / drop) if drop != 0.0 else 0.0)
        if end != 0:
            last = end
        row -= 1
    return NONE


@kernel
def margin(coefficients: Floats) -> float:
    """Least |value| of row 0 where it turns round within the interval, or inf; rows 1 and 2 are working space."""
    rise = sign(coefficients[0, 1] - coefficients[0, 0])
    if rise * sign(coefficients[0, DEGREE] - coefficients[0, DEGREE - 1]) >= 0:
        return np.inf
    kept = 0
    for _ in range(_TURN_HALVINGS):
        for j in range(DEGREE + 1):
            coefficients[1, j] = coefficients[kept, j]
        halve(coefficients, 1)
        kept = 1 if (coefficients[1, 1] - coefficients[1, 0]) * rise > 0.0 else 2
    return abs(coefficients[kept, 0])


_POWERS = ((1, 0), (1, 1), (2, 1), (2, 2), (3, 2), (3, 3), (4, 3))  # a and b of the dense output's terms x^a (1-x)^b
TO_BERNSTEIN = np.array(
    [
        [math.comb(DEGREE - a - b, j - a) / math.comb(DEGREE, j) if j >= a else 0.0 for j in range(DEGREE + 1)]
        for a, b in _POWERS
    ]
)
"""(7, 8): from the coefficients of the dense output, less the state at the step's start."""
