"""One step of the explicit Runge-Kutta pair of order 8, its dense output, and what is asked of it.

Slopes are rows of one array: no views in the loop. The increment is kept apart, for compensated addition.
"""

import math
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import DOP853

from synth.kernels.compiled import kernel, summing_kernel
from synth.phase import Floats
from synth.systems.dispatch import derivative

NODES = (*DOP853.C.tolist(), 1.0, *DOP853.C_EXTRA.tolist())
INSIDE = np.zeros((16, 16))
"""Weights of all stages; row 12 holds those of the solution itself, rows 13 to 15 are for the dense output."""
INSIDE[:12, :12], INSIDE[12, :12], INSIDE[13:] = DOP853.A, DOP853.B, DOP853.A_EXTRA
ERRORS = np.array([DOP853.E3[:12], DOP853.E5[:12]])  # against the embedded solutions of order 3 and of order 5
DENSE = np.array(DOP853.D)  # (4, 16) coefficients 3 to 6 of the dense output from all slopes

# fmt: off
CORRECTION = (
    1.9918104693347241e-16, 6.063230360996143e-17, 1.8452543462255e-17, -3.210519761051388e-17,
    -3.401337336317788e-17, 1.2264582770601823e-17, -5.401355163702107e-17, -1.2496437769775465e-17,
    2.8969874090919516e-16, 2.8076857795562253e-16, -3.5844567034839826e-17, -7.619302323506572e-16,
)
# fmt: on
"""Added to row 12: with it the rounded stages meet the conditions of order 1 and 2 to 1e-18, of order 3 to 4e-17.

With the published weights rounded alone they fail by 5e-16, always in the same sense: a false damping that costs 1e-12
in a thousand swings. The smallest correction that mends it, solved in exact arithmetic.
"""

_B, _L = INSIDE[12], CORRECTION
_FIRST = CORRECTION[0] + float(sum(map(Fraction, INSIDE[12].tolist())) - 1)  # the rest of the first slope's weight
_STIFF_AT = 6.1  # |step x eigenvalue| at the edge of the stability region (Hairer, Norsett, Wanner)
_GRAIN = 1e-15  # of the state: below it the two times of the test differ by rounding only
_SURELY = 0.25  # of the size expected
_SMALL_SCALE = 1e-6  # a component more than a million times smaller than the largest is held to that size


class Space(NamedTuple):
    """Arrays of an integration, of the size of the state (n,) where nothing else is said."""

    state: Floats  # at the start of the step,
    low: Floats  # with the rest that its rounding left over;
    following: Floats  # the same at its end
    left_over: Floats
    increment: Floats  # of the state over the step
    slope: Floats  # derivative evaluated last,
    point: Floats  # and where the last stage was
    spare: Floats
    allowed: Floats  # error of the step
    expected: Floats  # sizes that the components will grow to at least
    scale: Floats  # largest sizes so far
    k: Floats  # (16, n) slopes of the stages
    polynomial: Floats  # (7, n) coefficients of the dense output


@kernel
def _reach(stage: int, h: float, state: Floats, k: Floats, slope: Floats, point: Floats) -> None:
    """Note the slope of the stage before, and go to where this one is evaluated.

    Each call names its stage, which becomes a constant of the compiler: a loop over stages is a quarter slower.
    """
    begin = 1 if stage < 3 else 2 if stage < 5 else 3  # weights between the first and this one are zero
    for i in range(state.size):
        last = slope[i]
        k[stage - 1, i] = last
        total = INSIDE[stage, 0] * k[0, i]
        for j in range(begin, stage - 1):
            total += INSIDE[stage, j] * k[j, i]
        point[i] = state[i] + h * (total + INSIDE[stage, stage - 1] * last)


@kernel
def attempt(time: float, h: float, space: Space, system: Any) -> None:
    """Fill slopes k[1..11] from k[0], and the increment of the state over a step of h."""
    state, k, point, slope, increment = space.state, space.k, space.point, space.slope, space.increment
    n = state.size
    for i in range(n):
        point[i] = state[i] + h * (INSIDE[1, 0] * k[0, i])
    derivative(time + NODES[1] * h, point, system, slope)
    _reach(2, h, state, k, slope, point)
    derivative(time + NODES[2] * h, point, system, slope)
    _reach(3, h, state, k, slope, point)
    derivative(time + NODES[3] * h, point, system, slope)
    _reach(4, h, state, k, slope, point)
    derivative(time + NODES[4] * h, point, system, slope)
    _reach(5, h, state, k, slope, point)
    derivative(time + NODES[5] * h, point, system, slope)
    _reach(6, h, state, k, slope, point)
    derivative(time + NODES[6] * h, point, system, slope)
    _reach(7, h, state, k, slope, point)
    derivative(time + NODES[7] * h, point, system, slope)
    _reach(8, h, state, k, slope, point)
    derivative(time + NODES[8] * h, point, system, slope)
    _reach(9, h, state, k, slope, point)
    derivative(time + NODES[9] * h, point, system, slope)
    _reach(10, h, state, k, slope, point)
    derivative(time + NODES[10] * h, point, system, slope)
    _reach(11, h, state, k, slope, point)
    derivative(time + NODES[11] * h, point, system, slope)
    for i in range(n):
        k[11, i] = slope[i]
        base = k[0, i]
        # the weights add up to 1: summed as differences from the first slope, the large ones make no rounding
        total, small = 0.0, _FIRST * base
        for j in range(1, 12):
            total += _B[j] * (k[j, i] - base)
            small += _L[j] * k[j, i]
        increment[i] = h * (base + (total + small))


@kernel
def local_error(step: float, space: Space) -> float:
    """Size of the local error over what is allowed: Hairer's blend of the estimates of order 5 and 3, of order 8."""
    k, scale = space.k, space.allowed
    third, fifth = 0.0, 0.0
    for i in range(scale.size):
        low, high = 0.0, 0.0
        for j in range(12):
            low += ERRORS[0, j] * k[j, i]
            high += ERRORS[1, j] * k[j, i]
        third += (low / scale[i]) ** 2
        fifth += (high / scale[i]) ** 2
    if fifth == 0.0:
        return 0.0
    return abs(step) * fifth / math.sqrt((fifth + 0.01 * third) * scale.size)


@kernel
def dense(time: float, step: float, space: Space, system: Any) -> None:
    """Coefficients of the dense output of order 7 of a step that was accepted; three more evaluations."""
    state, k, point, slope, spare = space.state, space.k, space.point, space.slope, space.spare
    for i in range(state.size):
        k[12, i] = slope[i]
    for stage in range(13, 16):
        for i in range(state.size):
            total = 0.0
            for j in range(stage):
                total += INSIDE[stage, j] * k[j, i]
            point[i] = state[i] + step * total
        derivative(time + NODES[stage] * step, point, system, spare)
        for i in range(state.size):
            k[stage, i] = spare[i]
    _curve(step, k, space.increment, space.polynomial)


@summing_kernel
def _curve(h: float, k: Floats, increment: Floats, polynomial: Floats) -> None:
    for i in range(increment.size):
        rise = increment[i]
        polynomial[0, i] = rise
        polynomial[1, i] = h * k[0, i] - rise
        polynomial[2, i] = 2.0 * rise - h * (k[12, i] + k[0, i])
        for row in range(4):
            total = 0.0
            for j in range(16):
                total += DENSE[row, j] * k[j, i]
            polynomial[3 + row, i] = h * total


@kernel
def between(share: float, space: Space, i: int) -> float:
    """Component i at x = `share` of the step: x [F0 + (1-x) (F1 + x (F2 + (1-x) (F3 + x (F4 + (1-x) (F5 + x F6)))))]."""
    polynomial = space.polynomial
    rest = 1.0 - share
    value = polynomial[5, i] + share * polynomial[6, i]
    value = polynomial[4, i] + rest * value
    value = polynomial[3, i] + share * value
    value = polynomial[2, i] + rest * value
    value = polynomial[1, i] + share * value
    value = polynomial[0, i] + rest * value
    return space.state[i] + (space.low[i] + share * value)


@kernel
def allow(tolerance: float, space: Space) -> None:
    """Error allowed to each component in a step."""
    scale, expected, allowed = space.scale, space.expected, space.allowed
    largest = 0.0
    for i in range(scale.size):
        largest = max(largest, scale[i])
    largest = largest if largest > 0.0 else 1.0
    for i in range(scale.size):
        allowed[i] = tolerance * max(max(scale[i], expected[i]), _SMALL_SCALE * largest)


@kernel
def expect(start: Floats, slope: Floats, curvature: Floats, expected: Floats) -> None:
    """Sizes that components will reach at least, for those that start at zero: y'' = -w^2 y lets the rate reach w y."""
    square = 0.0
    for i in range(start.size):
        if start[i] != 0.0:
            square = max(square, abs(curvature[i] / start[i]))
    for i in range(start.size):
        expected[i] = abs(start[i])
        if 0.0 < square < np.inf:
            expected[i] = max(expected[i], _SURELY * max(abs(slope[i]) / math.sqrt(square), abs(curvature[i]) / square))


@kernel
def first_step(start: Floats, slope: Floats, allowed: Floats, tolerance: float, span: float) -> float:
    """At most a hundredth of the time in which the slope would change the state by its own size.

    Errors of the first steps too are to be proportional to the tolerance, as is assumed where runs are compared.
    """
    size, speed = 0.0, 0.0
    for i in range(slope.size):
        size = max(size, abs(start[i]) / allowed[i])
        speed = max(speed, abs(slope[i]) / allowed[i])
    guess = 1e-2 * size / speed if speed > 0.0 and size > 1e-9 * speed * span else 1e-6 * span
    return min(guess * tolerance**0.125, span)


@kernel
def noise(step: int, component: int) -> float:
    """-1 or 1, as if by chance (a linear congruence of the two, its high bits stirred)."""
    word = (step * 1103515245 + component * 374761393 + 12345) & 0x7FFFFFFF
    word = ((word ^ (word >> 13)) * 1274126177) & 0x7FFFFFFF
    return 1.0 if (word >> 17) & 1 else -1.0


@kernel
def is_finite(values: Floats) -> bool:
    """Whether every value is a number."""
    total = 0.0
    for i in range(values.size):
        total += values[i] * 0.0
    return total == 0.0


@kernel
def is_stiff(step: float, space: Space) -> bool:
    """|step x eigenvalue| from the last stage and the end of the step, which stand at the same time."""
    k, slope, following, point, allowed = space.k, space.slope, space.following, space.point, space.allowed
    above, below, coarse = 0.0, 0.0, 0.0
    for i in range(slope.size):
        unit = 1.0 / allowed[i]
        turn, shift, grain = (slope[i] - k[11, i]) * unit, (following[i] - point[i]) * unit, following[i] * unit
        above += turn * turn
        below += shift * shift
        coarse += grain * grain
    return step * step * above > _STIFF_AT * _STIFF_AT * below and below > _GRAIN * _GRAIN * coarse


@kernel
def add(space: Space) -> None:
    """(following, left_over) = (state, low) + increment, without loss."""
    state = space.state
    for i in range(state.size):
        small = space.low[i] + space.increment[i]
        total = state[i] + small
        part = total - state[i]
        space.left_over[i] = (state[i] - (total - part)) + (small - part)
        space.following[i] = total
