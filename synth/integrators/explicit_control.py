"""What the march of the explicit integrator asks of a step: how large an error is allowed, and whether it is stiff."""

from __future__ import annotations

import math

import numpy as np

from synth.kernels.compiled import kernel
from synth.phase import Floats

_STIFF_AT = 6.1  # |step x eigenvalue| at the edge of the stability region (Hairer, Norsett, Wanner)
_GRAIN = 1e-15  # of the state: below it the two times of the test differ by rounding only
_SURELY = 0.25  # of the size expected
_SMALL_SCALE = 1e-6  # a component more than a million times smaller than the largest is held to that size


@kernel
def allow(scale: Floats, expected: Floats, tolerance: float, allowed: Floats) -> None:
    """Error allowed to each component in a step."""
    largest = 0.0
    for i in range(scale.size):
        largest = max(largest, scale[i])
    if largest == 0.0:
        largest = 1.0
    for i in range(scale.size):
        allowed[i] = tolerance * max(max(scale[i], expected[i]), _SMALL_SCALE * largest)


@kernel
def expect(start: Floats, slope: Floats, curvature: Floats, expected: Floats) -> None:
    """Sizes that the components will grow to at least, so that one which starts at zero is not held to nothing.

    With y'' = -w^2 y the rate reaches w y, and w is the root of y''/y: of all components, the fastest.
    """
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

    Errors of the first steps too are to be proportional to the tolerance, as it is assumed where marches are compared:
    an unstable motion enlarges them more than all later ones.
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
def is_stiff(step: float, k: Floats, slope: Floats, following: Floats, point: Floats, allowed: Floats) -> bool:
    """|step x eigenvalue| from the last stage and the end of the step, which stand at the same time."""
    above, below, coarse = 0.0, 0.0, 0.0
    for i in range(slope.size):
        unit = 1.0 / allowed[i]
        turn, shift, grain = (slope[i] - k[11, i]) * unit, (following[i] - point[i]) * unit, following[i] * unit
        above += turn * turn
        below += shift * shift
        coarse += grain * grain
    return step * step * above > _STIFF_AT * _STIFF_AT * below and below > _GRAIN * _GRAIN * coarse


@kernel
def add(state: Floats, low: Floats, increment: Floats, following: Floats, left_over: Floats) -> None:
    """(following, left_over) = (state, low) + increment, without loss."""
    for i in range(state.size):
        small = low[i] + increment[i]
        total = state[i] + small
        part = total - state[i]
        left_over[i] = (state[i] - (total - part)) + (small - part)
        following[i] = total
