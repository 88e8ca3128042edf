"""The march of the explicit integrator: steps of its own choice, outputs from the dense polynomial, kicks where asked.

State and time are kept as sums of two doubles: a step adds an increment that is small against the state, and what
rounding drops from the first double is kept in the second. Outputs never shorten a step.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from synth.integrators.events_kick import follow, first_event, journal, strike
from synth.integrators.explicit_step import attempt, between, dense, local_error
from synth.kernels.compiled import kernel
from synth.phase import Floats, Integers
from synth.systems.dispatch import derivative

DONE, UNDERFLOW, NOT_FINITE, STIFF, TOO_LONG = 0, 1, 2, 3, 4
MOST_STEPS = 2_000_000_000
_STIFF_AT = 6.1  # |step x eigenvalue| at the edge of the stability region (Hairer, Norsett, Wanner)
_STIFF_STEPS = 15
_SMALL_SCALE = 1e-6  # a component a million times smaller than the largest is held to that size


@kernel
def _limits(scale: Floats, tolerance: float, allowed: Floats) -> None:
    """Error allowed to each component in a step."""
    largest = np.max(scale)
    if largest == 0.0:
        largest = 1.0
    for i in range(scale.size):
        allowed[i] = tolerance * max(scale[i], _SMALL_SCALE * largest)


@kernel
def _first_step(start: Floats, slope: Floats, allowed: Floats, tolerance: float, span: float) -> float:
    """A thousandth of the time in which the slope would change the state by its own size."""
    size, speed = 0.0, 0.0
    for i in range(start.size):
        size = max(size, tolerance * abs(start[i]) / allowed[i])
        speed = max(speed, tolerance * abs(slope[i]) / allowed[i])
    guess = 1e-3 * size / speed if size > 1e-5 * speed * span else 1e-6 * span
    return min(guess, span)


@kernel
def _finite(values: Floats) -> bool:
    total = 0.0
    for i in range(values.size):
        total += values[i] * 0.0
    return total == 0.0


@kernel
def march(
    system: Any, event: Any, start: Floats, times: Floats, tolerance: float, scale: Floats, states: Floats, counts: Integers
) -> tuple[int, float, Floats, Floats, Integers]:
    """Integrate over `times` and fill `states` there.

    Parameters
    ----------
    system : NamedTuple
    event : NamedTuple or None
        Escapement or crossings to note; None compiles to nothing.
    start : (n,) array
    times : (k,) array
        Increasing; the first is the time of `start`.
    tolerance : float
        Local error, relative to `scale`.
    scale : (n,) array
        Largest size of each component so far; grows on the way.
    states : (k, n) array
        Result.
    counts : (3,) int64 array
        Result: steps, rejected steps, evaluations.

    Returns
    -------
    status : int
    time : float
        Where it ended.
    state : (n,) array
        And in which state.
    event_times, event_numbers : arrays
        What `event` noted.
    """  # fmt: skip
    n = start.size
    k = np.zeros((16, n))
    state, low, following = start.copy(), np.zeros(n), np.zeros(n)
    point, slope, increment, allowed = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    polynomial = np.zeros((7, n))
    notes = journal(event)
    time, time_low, end = times[0], 0.0, times[-1]
    states[0] = start
    written = 1
    derivative(time, state, system, slope)
    evaluations, steps, rejected, stiff, calm = 1, 0, 0, 0, 0
    status = DONE if _finite(slope) and _finite(state) else NOT_FINITE
    k[0] = slope
    follow(event, state, notes)
    _limits(scale, tolerance, allowed)
    step = _first_step(start, slope, allowed, tolerance, end - time)
    before, grow = 1e-4, 6.0
    shortest = 1e-15 * max(abs(time), abs(end))
    while status == DONE and (end - time) - time_low > 0.0:
        left = (end - time) - time_low
        last = step >= left * (1.0 - 1e-12)
        if last:
            step = left
        elif step > 0.5 * left:
            step = 0.5 * left  # no tiny step at the end
        if step <= shortest and not last:
            status = UNDERFLOW
            break
        attempt(time, step, state, k, point, slope, increment, system)
        evaluations += 11
        error = local_error(step, k, allowed)
        if not error <= 1.0:
            rejected += 1
            finite = error < np.inf
            step *= max(0.2, 0.9 * error ** -0.125) if finite else 0.1
            grow = 1.0
            if not finite and step <= 1e3 * shortest:
                status = NOT_FINITE
            continue
        for i in range(n):  # compensated sum: state + low + increment
            addend = low[i] + increment[i]
            following[i] = state[i] + addend
        # |step x eigenvalue| from the two last stages, which stand at the same time
        above, below = 0.0, 0.0
        derivative(time + step, following, system, slope)
        evaluations += 1
        for i in range(n):
            above += ((slope[i] - k[11, i]) / allowed[i]) ** 2
            below += ((following[i] - point[i]) / allowed[i]) ** 2
        if not above < np.inf:
            rejected += 1
            step *= 0.1
            grow = 1.0
            if step <= 1e3 * shortest:
                status = NOT_FINITE
            continue
        if step * step * above > _STIFF_AT * _STIFF_AT * below and below > 0.0:
            stiff += 1
            calm = 0
            if stiff == _STIFF_STEPS:
                status = STIFF
                break
        else:
            calm += 1
            if calm == 6:
                stiff = 0
        struck = first_event(event, time, step, state, low, following, increment, k, slope, point, polynomial, notes, system)
        if struck < 1.0:  # march to the crossing only; the step from there is tried afresh
            evaluations += 3
        ready = False
        arrival = time + (time_low + step)
        while written < times.size and (times[written] <= arrival or last):
            if not ready:
                dense(time, step, state, increment, slope, k, point, low_slope(notes), polynomial, system)
                evaluations += 3
                ready = True
            share = ((times[written] - time) - time_low) / step
            for i in range(n):
                states[written, i] = between(share, state[i], low[i], polynomial, i)
            written += 1
        steps += 1
    counts[0], counts[1], counts[2] = steps, rejected, evaluations
    return status, time, state, notes, notes
