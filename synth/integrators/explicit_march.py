"""The march of the explicit integrator: steps of its own choice, outputs from the dense polynomial, kicks where asked.

State and time are kept as sums of two doubles: a step adds an increment that is small against the state, and what
rounding drops from the first double is kept in the second. Outputs never shorten a step, so that they change nothing.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from synth.integrators.events_kick import begin, locate, miss, strike, watching
from synth.integrators.explicit_step import attempt, between, dense, local_error
from synth.kernels.compiled import kernel
from synth.phase import Floats, Integers
from synth.systems.dispatch import derivative

DONE, UNDERFLOW, NOT_FINITE, STIFF, TOO_LONG = 0, 1, 2, 3, 4
MOST_STEPS = 2_000_000_000
_STIFF_AT = 6.1  # |step x eigenvalue| at the edge of the stability region (Hairer, Norsett, Wanner)
STIFF_STEPS = 15
_CALM_STEPS = 6
_SMALL_SCALE = 1e-6  # a component more than a million times smaller than the largest is held to that size
_LARGEST_GROWTH = 6.0
_CONTROL, _MEMORY = 0.7 / 8.0, 0.4 / 8.0  # proportional-integral step control (Gustafsson)


@kernel
def _allow(scale: Floats, tolerance: float, allowed: Floats) -> None:
    """Error allowed to each component in a step."""
    largest = 0.0
    for i in range(scale.size):
        largest = max(largest, scale[i])
    if largest == 0.0:
        largest = 1.0
    for i in range(scale.size):
        allowed[i] = tolerance * max(scale[i], _SMALL_SCALE * largest)


@kernel
def _first_step(start: Floats, slope: Floats, allowed: Floats, span: float) -> float:
    """A hundredth of the time in which the slope would change the state by its own size."""
    size, speed = 0.0, 0.0
    for i in range(start.size):
        size = max(size, abs(start[i]) / allowed[i])
        speed = max(speed, abs(slope[i]) / allowed[i])
    guess = 1e-2 * size / speed if speed > 0.0 and size > 1e-9 * speed * span else 1e-6 * span
    return min(guess, span)


@kernel
def _is_finite(values: Floats) -> bool:
    total = 0.0
    for i in range(values.size):
        total += values[i] * 0.0
    return total == 0.0


@kernel
def _is_stiff(step: float, k: Floats, slope: Floats, following: Floats, point: Floats, allowed: Floats) -> bool:
    """|step x eigenvalue| from the last stage and the end of the step, which stand at the same time."""
    above, below = 0.0, 0.0
    for i in range(slope.size):
        above += ((slope[i] - k[11, i]) / allowed[i]) ** 2
        below += ((following[i] - point[i]) / allowed[i]) ** 2
    return step * step * above > _STIFF_AT * _STIFF_AT * below and below > 0.0


@kernel
def _add(state: Floats, low: Floats, increment: Floats, following: Floats, left_over: Floats) -> None:
    """(following, left_over) = (state, low) + increment, without loss."""
    for i in range(state.size):
        small = low[i] + increment[i]
        total = state[i] + small
        part = total - state[i]
        left_over[i] = (state[i] - (total - part)) + (small - part)
        following[i] = total


@kernel
def march(
    system: Any,
    event: Any,
    memory: Any,
    start: Floats,
    times: Floats,
    tolerance: float,
    scale: Floats,
    states: Floats,
    counts: Integers,
    stop: Floats,
    patience: int,
) -> int:
    """Integrate over `times` and fill `states` there.

    Parameters
    ----------
    system : NamedTuple
    event, memory : NamedTuple or None
        `Crossings` or `Escapement`, with its memory; None compiles to nothing.
    start : (n,) array
    times : (k,) array
        Increasing; the first is the time of `start`.
    tolerance : float
        Local error allowed, relative to `scale`.
    scale : (n,) array
        Largest size of each component so far; grows on the way.
    states : (k, n) array
        Result.
    counts : (3,) int64 array
        Result: steps, rejected steps, evaluations.
    stop : (1 + n,) array
        Result: time and state where the march ended.
    patience : int
        Steps at the edge of stability after which the motion counts as stiff; `STIFF_STEPS`, or many.

    Returns
    -------
    int
        DONE, or why it ended before.
    """  # fmt: skip
    n = start.size
    k, polynomial = np.zeros((16, n)), np.zeros((7, n))
    state, low, following, left_over = start.copy(), np.zeros(n), np.zeros(n), np.zeros(n)
    point, slope, increment, allowed, spare = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    time, time_low, end = times[0], 0.0, times[-1]
    states[0] = start
    written, evaluations, steps, rejected, stiff, calm = 1, 1, 0, 0, 0, 0
    derivative(time, state, system, slope)
    status = DONE if _is_finite(slope) and _is_finite(state) else NOT_FINITE
    k[0] = slope
    begin(event, memory, state)
    _allow(scale, tolerance, allowed)
    step = _first_step(start, slope, allowed, end - time)
    error_before, growth = 1e-4, _LARGEST_GROWTH
    shortest = 4e-16 * max(abs(time), abs(end))
    while status == DONE and written < times.size:
        left = (end - time) - time_low
        final = step >= left * (1.0 - 1e-12)
        if final:
            step = left
        attempt(time + time_low, step, state, k, point, slope, increment, system)
        evaluations += 11
        error = local_error(step, k, allowed)
        if error <= 1.0:
            _add(state, low, increment, following, left_over)
            derivative(time + (time_low + step), following, system, slope)
            evaluations += 1
            if not _is_finite(slope):
                error = np.nan
        if not error <= 1.0:
            rejected += 1
            step *= max(0.2, 0.9 * error**-0.125) if error < np.inf else 0.1
            growth = 1.0
            if step <= shortest:
                status = UNDERFLOW if error < np.inf else NOT_FINITE
            continue
        if _is_stiff(step, k, slope, following, point, allowed):
            stiff += 1
            calm = 0
            if stiff == patience:
                status = STIFF
        else:
            calm += 1
            if calm == _CALM_STEPS:
                stiff = 0
        error = max(error, 1e-8)
        factor = 0.9 * error**-_CONTROL * error_before**_MEMORY
        proposed = step * min(growth, max(0.2, factor))
        ready, share = False, 2.0
        if watching(event):
            dense(time + time_low, step, state, increment, slope, k, point, spare, polynomial, system)
            evaluations += 3
            ready = True
            share = locate(event, memory, state, low, following, left_over, polynomial)
            if share <= 1.0:
                step *= share
                final = False
                ready = False
                attempt(time + time_low, step, state, k, point, slope, increment, system)
                _add(state, low, increment, following, left_over)
                derivative(time + (time_low + step), following, system, slope)
                evaluations += 12
                component, lack = miss(event, memory, share, following, left_over)
                late = lack / slope[component] if slope[component] != 0.0 else 0.0
                if abs(late) <= 1e-3 * step:  # to the level by the tangent; near a touch the root stands as found
                    step += late
                    for i in range(n):
                        increment[i] += late * slope[i]
                    _add(state, low, increment, following, left_over)
        reached = time + (time_low + step)
        while written < times.size and (final or times[written] <= reached):
            if not ready:
                dense(time + time_low, step, state, increment, slope, k, point, spare, polynomial, system)
                evaluations += 3
                ready = True
            part = min(1.0, ((times[written] - time) - time_low) / step) if step > 0.0 else 1.0
            for i in range(n):
                states[written, i] = between(part, state[i], low[i], polynomial, i)
            written += 1
        small = time_low + step
        total = time + small
        rest = total - time
        time_low = (time - (total - rest)) + (small - rest)
        time = total
        if share <= 1.0:
            strike(event, memory, share, time, time_low, following, left_over, slope, system)
            derivative(time + time_low, following, system, slope)
            evaluations += 1
        for i in range(n):
            state[i] = following[i]
            low[i] = left_over[i]
            k[0, i] = slope[i]
            scale[i] = max(scale[i], abs(state[i]))
        _allow(scale, tolerance, allowed)
        step, error_before, growth = proposed, error, _LARGEST_GROWTH
        steps += 1
        if steps == MOST_STEPS:
            status = TOO_LONG
    counts[0], counts[1], counts[2] = steps, rejected, evaluations
    stop[0] = time
    stop[1:] = state
    return status
