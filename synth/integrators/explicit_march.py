"""The march of the explicit integrator: steps of its own choice, outputs from the dense polynomial, kicks where asked.

State and time are kept as sums of two doubles: a step adds an increment that is small against the state, and what
rounding drops from the first double is kept in the second. Outputs never shorten a step, so that they change nothing;
nor does a halt for room to note kicks, since a march goes on with the step that it has in hand.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from data_schemas.errors import RefusedError
from synth.integrators.events import Escapement, Memory, begin, full, happenings, locate, memory, miss, roomier, strike
from synth.integrators.explicit_step import (
    Progress,
    add,
    allow,
    attempt,
    between,
    dense,
    expect,
    first_step,
    is_finite,
    is_stiff,
    local_error,
    noise,
)
from synth.integrators.trajectory import reason
from synth.kernels.compiled import kernel
from synth.phase import Floats, Integers
from synth.systems.dispatch import derivative
from synth.systems.terms import halt, jolt, kicks_of

TIME, TIME_LOW, STEP, PROPOSED, ERROR, SHARE = range(6)  # of `Progress.clock`
STEPS, REJECTED, EVALUATIONS, STIFF, CALM, READY, FINAL, WRITTEN, KICKS, HALTED = range(10)  # of `Progress.counts`
DONE, UNDERFLOW, NOT_FINITE, TOO_STIFF, TOO_LONG, FULL = range(6)
MOST_STEPS = 2_000_000_000
STIFF_STEPS = 15
_CALM_STEPS = 6
_ASIDE = 1e-4  # of a first step, to see the curvature
_LARGEST_GROWTH = 6.0
_CONTROL, _MEMORY = 0.7 / 8.0, 0.4 / 8.0  # proportional-integral step control (Gustafsson)
_NOT_YET, _AVERAGE = 2.0, 1e-4


def begin_at(start: Floats, time: float) -> Progress:
    """Progress before the first step, of no length, which ends at `start`."""
    n = start.size
    spaces = {name: np.zeros(n) for name in Progress._fields}
    spaces |= {"state": start.copy(), "following": start.copy(), "k": np.zeros((16, n)), "polynomial": np.zeros((7, n))}
    spaces["clock"] = np.array([time, 0.0, 0.0, 0.0, _AVERAGE, _NOT_YET])
    return Progress(**spaces | {"counts": np.array([0, 0, 0, 0, 0, 1, 0, 0, 0, 0])})


@kernel
def start_march(system: Any, event: Any, memory: Any, progress: Progress, end: float, tolerance: float) -> int:
    """Slope at the start, sizes of the components and a first step; to be called once before `march`."""
    clock, start, slope = progress.clock, progress.following, progress.slope
    point, spare = progress.point, progress.spare
    derivative(clock[TIME], start, system, slope)
    progress.counts[EVALUATIONS] = 2
    if not (is_finite(slope) and is_finite(start)):
        return NOT_FINITE
    aside = _ASIDE * first_step(start, slope, np.ones(start.size), 1.0, end - clock[TIME])
    for i in range(start.size):
        point[i] = start[i] + aside * slope[i]
    derivative(clock[TIME] + aside, point, system, spare)
    for i in range(start.size):
        spare[i] = (spare[i] - slope[i]) / aside if aside > 0.0 else 0.0
    expect(start, slope, spare, progress.expected)
    for i in range(start.size):
        progress.scale[i] = abs(start[i])
    begin(event, memory, start)
    allow(progress.scale, progress.expected, tolerance, progress.allowed)
    clock[PROPOSED] = first_step(start, slope, progress.allowed, tolerance, end - clock[TIME])
    return DONE


@kernel
def march(
    system: Any, event: Any, memory: Any, progress: Progress, times: Floats, end: float, tolerance: float, states: Floats,
    patience: int, amiss: float,
) -> int:  # fmt: skip
    """Integrate over `times` and fill `states` there.

    Parameters
    ----------
    system : NamedTuple
    event, memory : NamedTuple or None
        `Escapement`, with its memory; None compiles to nothing.
    progress : Progress
        From `begin_at`, made ready by `start_march`; the march can be taken up again with it.
    times : (k,) array
        Increasing, from the time reached so far.
    end : float
        Where the whole march ends: the last step is cut off there.
    tolerance : float
        Local error allowed, relative to `progress.scale`, which grows on the way.
    states : (k, n) array
        Result.
    patience : int
        Steps at the edge of stability after which the motion counts as stiff; `STIFF_STEPS`, or many.
    amiss : float
        Put to the state at each step, relative, up or down by chance: 0, or much more than rounding to see what the
        motion makes of it.

    Returns
    -------
    int
        DONE; FULL when the memory has no room for further events and the march waits for more, with the number of
        `states` filled in `progress.counts[WRITTEN]`; or why it ended before.
    """
    state, low, following, left_over = progress.state, progress.low, progress.following, progress.left_over
    increment, slope, k, polynomial = progress.increment, progress.slope, progress.k, progress.polynomial
    scale, allowed, expected = progress.scale, progress.allowed, progress.expected
    point, spare, clock, counts, n = progress.point, progress.spare, progress.clock, progress.counts, slope.size
    time, time_low, step, proposed = clock[TIME], clock[TIME_LOW], clock[STEP], clock[PROPOSED]
    error, share, ready, final = clock[ERROR], clock[SHARE], counts[READY] != 0, counts[FINAL] != 0
    halted = counts[HALTED] != 0
    shortest = 4e-16 * max(abs(time), abs(end))
    written, status = 0, DONE
    while True:
        reached = time + (time_low + step)
        while written < times.size and (final or times[written] <= reached):
            if not ready:
                dense(time + time_low, step, state, k, point, slope, spare, increment, polynomial, system)
                counts[EVALUATIONS] += 3
                ready = True
            part = min(1.0, ((times[written] - time) - time_low) / step) if step > 0.0 else 1.0
            for i in range(n):
                states[written, i] = between(part, state[i], low[i], polynomial, i)
            written += 1
        if written == times.size:
            break
        if full(event, memory):
            status = FULL
            break
        small = time_low + step  # to the end of the step in hand
        total = time + small
        rest = total - time
        time_low = (time - (total - rest)) + (small - rest)
        time = total
        if share <= 1.0:
            strike(event, memory, share, time, time_low, following, left_over, system)
            derivative(time + time_low, following, system, slope)
            counts[EVALUATIONS] += 1
        if halted:
            jolt(kicks_of(system), counts[KICKS], following)
            derivative(time + time_low, following, system, slope)
            counts[KICKS] += 1
            counts[EVALUATIONS] += 1
        shaken = amiss if share > 1.0 else 0.0  # a state put on a level stays there, lest it cross again
        for i in range(n):
            state[i] = following[i]
            low[i] = left_over[i] + shaken * noise(counts[STEPS], i) * following[i]
            k[0, i] = slope[i]
            scale[i] = max(scale[i], abs(state[i]))
        allow(scale, expected, tolerance, allowed)
        step, growth, error_before = proposed, _LARGEST_GROWTH, max(error, 1e-8)
        while status == DONE:
            stop = halt(kicks_of(system), counts[KICKS], end)
            left = (stop - time) - time_low
            final = step >= left * (1.0 - 1e-12)
            if final:
                step = left
            halted = final and stop < end
            final = final and not halted
            attempt(time + time_low, step, state, k, point, slope, increment, system)
            counts[EVALUATIONS] += 11
            error = local_error(step, k, allowed)
            if error <= 1.0:
                add(state, low, increment, following, left_over)
                derivative(time + (time_low + step), following, system, slope)
                counts[EVALUATIONS] += 1
                if is_finite(slope):
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
        if is_stiff(step, k, slope, following, point, allowed):
            counts[STIFF] += 1
            counts[CALM] = 0
        else:
            counts[CALM] += 1
            if counts[CALM] == _CALM_STEPS:
                counts[STIFF] = 0
        if counts[STIFF] >= patience:
            status = TOO_STIFF
            break
        if counts[STEPS] == MOST_STEPS:
            status = TOO_LONG
            break
        factor = 0.9 * max(error, 1e-8) ** -_CONTROL * error_before**_MEMORY
        proposed = step * min(growth, max(0.2, factor))
        ready, share = False, 2.0
        if event is not None:
            dense(time + time_low, step, state, k, point, slope, spare, increment, polynomial, system)
            counts[EVALUATIONS] += 3
            ready = True
            share = locate(event, memory, state, low, following, left_over, polynomial)
            if share <= 1.0:
                step *= share
                final = halted = False
                ready = False
                attempt(time + time_low, step, state, k, point, slope, increment, system)
                add(state, low, increment, following, left_over)
                derivative(time + (time_low + step), following, system, slope)
                counts[EVALUATIONS] += 12
                component, lack = miss(event, memory, share, following, left_over)
                late = lack / slope[component] if slope[component] != 0.0 else 0.0
                if abs(late) <= 1e-3 * step:  # to the level by the tangent; near a touch the root stands as found
                    step += late
                    for i in range(n):
                        increment[i] += late * slope[i]
                    add(state, low, increment, following, left_over)
    clock[TIME], clock[TIME_LOW], clock[STEP], clock[PROPOSED] = time, time_low, step, proposed
    clock[ERROR], clock[SHARE] = error, share
    counts[READY], counts[FINAL], counts[WRITTEN], counts[HALTED] = int(ready), int(final), written, int(halted)
    return status


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
    """A march that is done.

    `RefusedError`: why there are no states at some of the times.

    Parameters
    ----------
    system, event
        As of `march`.
    start : (n,) array
    times : (k,) array
        Increasing, s; the first is the time of the start.
    tolerance : float
        Local error allowed, relative to the largest size of each component so far.
    patience, amiss
        As of `march`.
    """

    def __init__(
        self, system: Any, event: Escapement | None, start: Floats, times: Floats, tolerance: float,
        patience: int = STIFF_STEPS, amiss: float = 0.0,
    ) -> None:  # fmt: skip
        self.times, self.tolerance = times, tolerance
        self.states: Floats = np.empty((times.size, start.size))
        self.events: Memory | None = memory(event, start.size)
        progress, end, written = begin_at(start, float(times[0])), float(times[-1]), 0
        status = start_march(system, event, self.events, progress, end, tolerance)
        while status in (DONE, FULL):
            status = march(
                system, event, self.events, progress, times[written:], end, tolerance, self.states[written:], patience,
                amiss,
            )  # fmt: skip
            if status != FULL or self.events is None:
                break
            written += int(progress.counts[WRITTEN])
            self.events = roomier(self.events)
        if status != DONE:
            kind = StiffError if status == TOO_STIFF else RefusedError
            why = reason(system, progress.state, _REASONS[status])
            raise kind(f"explicit, {type(system).__name__} at t = {progress.clock[TIME]:.6g}: {why}")
        self.scale: Floats = progress.scale
        """(n,) largest size of each component."""
        self.counts: Integers = progress.counts[:3]
        """Steps, rejected steps, evaluations."""

    def happenings(self) -> tuple[Floats, Integers]:
        """Times of the kicks, and the number of each."""
        return happenings(self.events)
