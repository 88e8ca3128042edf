"""Integration by explicit steps: of its own choice, outputs from the dense polynomial, kicks where asked.

State and time are kept as sums of two doubles: a step adds an increment that is small against the state, and what
rounding drops from the first double is kept in the second. Outputs never shorten a step, so that they change nothing.
"""

from typing import Any

import numpy as np

from data_schemas.errors import RefusedError
from synth.integrators import explicit_step as stepping
from synth.integrators.events import Escapement, Memory, begin, locate, memory, miss, strike
from synth.integrators.trajectory import reason
from synth.kernels.compiled import making_kernel
from synth.phase import Floats, Integers
from synth.systems.dispatch import derivative
from synth.systems.terms import halt, jolt, kicks_of

STEPS, REJECTED, EVALUATIONS = range(3)  # of the counts
DONE, UNDERFLOW, NOT_FINITE, TOO_STIFF, TOO_LONG = range(5)
MOST_STEPS = 2_000_000_000
STIFF_STEPS = 15
_CALM_STEPS = 6
_ASIDE = 1e-4  # of a first step, to see the curvature
_LARGEST_GROWTH = 6.0
_CONTROL, _MEMORY = 0.7 / 8.0, 0.4 / 8.0  # proportional-integral step control (Gustafsson)
_AVERAGE = 1e-4  # error of a step before the first
_NOTED = 1024  # kicks for which there is room at first


@making_kernel
def march(
    system: Any, event: Any, memory: Any, start: Floats, times: Floats, tolerance: float, patience: int, amiss: float,
    states: Floats, scale: Floats, counts: Integers,
) -> tuple[int, float, Floats, Floats, Integers]:  # fmt: skip
    """Integrate from `start` (n,) over increasing `times` (k,) and fill `states` (k, n); kicks only with an `event`.

    `scale` (n,) receives the largest sizes, `counts` (3,) steps, rejected steps and evaluations. The `tolerance` is
    local, relative to `scale`; `patience` the steps at the edge of stability after which the motion counts as stiff;
    `amiss` the relative noise put to the state at each step. Returned: DONE or why it ended, time, state, kicks.
    """
    n, end = start.size, times[-1]
    space = stepping.Space(
        start.copy(), np.zeros(n), start.copy(), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n),
        np.zeros(n), np.zeros(n), scale, np.zeros((16, n)), np.zeros((7, n)),
    )  # fmt: skip
    state, following, slope, spare = space.state, space.following, space.slope, space.spare
    moments, which, noted = np.zeros(_NOTED), np.zeros(_NOTED, dtype=np.int64), 0
    time, time_low, step = times[0], 0.0, 0.0
    derivative(time, start, system, slope)
    counts[EVALUATIONS] = 2
    if not (stepping.is_finite(slope) and stepping.is_finite(start)):
        return NOT_FINITE, time, state, moments[:0], which[:0]
    aside = _ASIDE * stepping.first_step(start, slope, np.ones(n), 1.0, end - time)
    for i in range(n):
        space.point[i] = start[i] + aside * slope[i]
    derivative(time + aside, space.point, system, spare)
    for i in range(n):
        spare[i] = (spare[i] - slope[i]) / aside if aside > 0.0 else 0.0
    stepping.expect(start, slope, spare, space.expected)
    for i in range(n):
        scale[i] = abs(start[i])
    begin(event, memory, start)
    stepping.allow(tolerance, space)
    proposed = stepping.first_step(start, slope, space.allowed, tolerance, end - time)
    # the step in hand is of no length, and ends at the start
    error, share, ready, final, halted = _AVERAGE, 2.0, True, False, False
    shortest = 4e-16 * max(abs(time), abs(end))
    written, status, stiff, calm, kicks = 0, DONE, 0, 0, 0
    while True:
        reached = time + (time_low + step)
        while written < times.size and (final or times[written] <= reached):
            if not ready:
                stepping.dense(time + time_low, step, space, system)
                counts[EVALUATIONS] += 3
                ready = True
            part = min(1.0, ((times[written] - time) - time_low) / step) if step > 0.0 else 1.0
            for i in range(n):
                states[written, i] = stepping.between(part, space, i)
            written += 1
        if written == times.size:
            break
        small, before = time_low + step, time  # to the end of the step in hand
        time = before + small
        rest = time - before
        time_low = (before - (time - rest)) + (small - rest)
        if share <= 1.0:
            if event is not None:
                if noted + event.level.size > moments.size:
                    moments = np.concatenate((moments, np.empty_like(moments)))
                    which = np.concatenate((which, np.empty_like(which)))
                noted = strike(event, memory, share, time, space, system, moments, which, noted)
            derivative(time + time_low, following, system, slope)
            counts[EVALUATIONS] += 1
        if halted:
            jolt(kicks_of(system), kicks, following)
            derivative(time + time_low, following, system, slope)
            kicks += 1
            counts[EVALUATIONS] += 1
        shaken = amiss if share > 1.0 else 0.0  # a state put on a level stays there, lest it cross again
        for i in range(n):
            state[i] = following[i]
            space.low[i] = space.left_over[i] + shaken * stepping.noise(counts[STEPS], i) * following[i]
            space.k[0, i] = slope[i]
            scale[i] = max(scale[i], abs(state[i]))
        stepping.allow(tolerance, space)
        step, growth, error_before = proposed, _LARGEST_GROWTH, max(error, 1e-8)
        while status == DONE:
            stop = halt(kicks_of(system), kicks, end)
            left = (stop - time) - time_low
            final = step >= left * (1.0 - 1e-12)
            if final:
                step = left
            halted = final and stop < end
            final = final and not halted
            stepping.attempt(time + time_low, step, space, system)
            counts[EVALUATIONS] += 11
            error = stepping.local_error(step, space)
            if error <= 1.0:
                stepping.add(space)
                derivative(time + (time_low + step), following, system, slope)
                counts[EVALUATIONS] += 1
                if stepping.is_finite(slope):
                    break
                error = np.nan
            counts[REJECTED] += 1
            step *= max(0.2, 0.9 * error**-0.125) if error < np.inf else 0.1
            growth = 1.0
            if step <= shortest:
                status = UNDERFLOW if error < np.inf else NOT_FINITE
        if status != DONE:
            break
        counts[STEPS] += 1
        if stepping.is_stiff(step, space):
            stiff, calm = stiff + 1, 0
        else:
            calm += 1
            stiff = 0 if calm == _CALM_STEPS else stiff
        if stiff >= patience or counts[STEPS] == MOST_STEPS:
            status = TOO_STIFF if stiff >= patience else TOO_LONG
            break
        factor = 0.9 * max(error, 1e-8) ** -_CONTROL * error_before**_MEMORY
        proposed = step * min(growth, max(0.2, factor))
        ready, share = False, 2.0
        if event is not None:
            stepping.dense(time + time_low, step, space, system)
            counts[EVALUATIONS] += 3
            ready = True
            share = locate(event, memory, space)
            if share <= 1.0:
                step *= share
                final = halted = False
                ready = False
                stepping.attempt(time + time_low, step, space, system)
                stepping.add(space)
                derivative(time + (time_low + step), following, system, slope)
                counts[EVALUATIONS] += 12
                component, lack = miss(event, memory, share, space)
                late = lack / slope[component] if slope[component] != 0.0 else 0.0
                if abs(late) <= 1e-3 * step:  # to the level by the tangent; near a touch the root stands as found
                    step += late
                    for i in range(n):
                        space.increment[i] += late * slope[i]
                    stepping.add(space)
    return status, time, state, moments[:noted], which[:noted]


_REASONS = {
    TOO_STIFF: "the motion is stiff (use the propagator radau), or it stands at the top of a swing where rounding"
    " decides (move the start)",
    NOT_FINITE: "the acceleration is not finite; look for a singular state or NaN in parameters",
    TOO_LONG: "more steps than can be counted; shorten the record or loosen the tolerance",
    UNDERFLOW: "the step shrank to the rounding of time, as at a jump or in stiff motion; use the propagator radau",
}


class StiffError(RefusedError):
    """Refused since the motion is stiff."""


class Run:
    """An integration that is done, see `march`; `RefusedError` where there are no states at some of the times."""

    def __init__(
        self, system: Any, event: Escapement | None, start: Floats, times: Floats, tolerance: float,
        patience: int = STIFF_STEPS, amiss: float = 0.0,
    ) -> None:  # fmt: skip
        self.times, self.tolerance = times, tolerance
        self.states: Floats = np.empty((times.size, start.size))
        self.events: Memory | None = memory(event, start.size)
        self.scale: Floats = np.zeros(start.size)  # (n,) largest size of each component
        self.counts: Integers = np.zeros(3, dtype=np.int64)  # steps, rejected steps, evaluations
        status, time, state, *self.happenings = march(
            system, event, self.events, start, times, tolerance, patience, amiss, self.states, self.scale, self.counts
        )
        if status != DONE:
            kind = StiffError if status == TOO_STIFF else RefusedError
            why = reason(system, state, _REASONS[status])
            raise kind(f"explicit, {type(system).__name__} at t = {time:.6g}: {why}")

    def at(self, times: Floats) -> Floats:
        """States (k, n) at some of its times."""
        return self.states[np.searchsorted(self.times, times)]
