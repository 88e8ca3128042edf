"""Integration by Radau IIA: the length of its steps, their order, and the readings on the way.

The state and the time are kept as sums of two doubles: a step adds an increment that is small against them.

A step ends with order 2 s - 1, its polynomial inside with order s only. Local errors are therefore allowed the
power (s + 1)/(2 s) of the tolerance (Hairer and Wanner 1999), and a reading inside a step that has not earned its
tolerance is solved for as a part step, or, where that fails, made the end of a step. Where readings are so many that
this costs more than short steps, steps are chosen for the polynomial. Errors of ends add up and those of readings do
not: they have tolerances of their own.
"""

from __future__ import annotations

import math
from typing import Any

from synth.integrators.radau_step import (
    NOT_FINITE,
    SOLVED,
    Space,
    addresses,
    collocate_any,
    differences,
    evaluate,
    first_step,
    guess,
    local_error,
    part_step,
)
from synth.kernels.compiled import kernel
from synth.systems.dispatch import derivative, jacobian

DONE, STUCK, UNDEFINED, ENDLESS = 0, 1, 2, 3
STEPS, EVALUATIONS, REJECTED = 0, 1, 2

_MOST_STEPS = 100_000_000
_SHORTEST = 1e-14  # of the span
_SHARE = 0.1  # of the tolerance's power for local errors
_NEWTON, _ROUNDED = 0.1, 1e-17  # of the tolerance for what Newton leaves; not less than this of the sizes
_DENSE = 10.0  # error of the end over the largest error of the polynomial inside, at least
_BROAD = 1e-6  # tolerance for which the first step is what it is
_PART = 0.6  # cost of a part step over that of a step
_FLOOR = 1e-2  # of a component's largest size: errors are not asked to be smaller where it passes zero
_SMALL = 1e-10  # of the largest component: smaller ones count as that large
LOOSE = 3e-8  # tolerance above which 7 stages do not pay
_EASY, _WANTED = 0.05, 0.1  # contraction that allows a higher order; that steps should not exceed by their growth
_STAY = 10  # steps between changes of order
_SAFE, _GROWTH, _DROP = 0.9, 8.0, 0.125


@kernel
def _allowances(tolerance: float, dense: float, s: int) -> tuple[float, float]:
    """Local error allowed where only ends of steps count; how much longer steps are then than those for readings."""
    loose = max(_SHARE * tolerance ** (0.5 * (s + 1) / s), _DENSE * tolerance)
    return loose, max(1.0, (loose / dense) ** (1.0 / (s + 1)))


@kernel
def march(
    system: Any, arrays: Space, times: Any, least: Any, tolerances: tuple[float, float], orders: tuple[int, int],
    size: Any, out: Any, counts: Any,
) -> tuple[int, float]:  # fmt: skip
    """Integrate from the first to the last of increasing `times` (k,) and fill `out` (k, n) there.

    Parameters
    ----------
    arrays : Space
        As of `space`; its state and largest sizes move on.
    least : (n,) array
        What counts as small of each component.
    tolerances : tuple
        Relative error wanted of ends of steps, and of readings inside.
    orders : tuple
        Fewest and most stages, of 3, 5, 7.
    size : tuple of length n
    counts : (3,) integer array
        Receives steps, evaluations, rejected steps.

    Returns
    -------
    outcome, time
        DONE, or why not: STUCK, UNDEFINED (not finite) or ENDLESS; how far it came, s.
    """
    n, k, work = len(size), times.size, addresses(arrays)
    state, slope, slopes = arrays.state, arrays.slope, arrays.slopes
    point, other, spare = arrays.point, arrays.other, arrays.spare
    largest, carry, scale, z, polynomial = work.largest, work.carry, work.scale, work.z, work.polynomial
    tolerance, reading = tolerances
    time, late = times[0], 0.0  # the time is their sum
    s, old, since, old_step, old_log = orders[1], 0, 0, 0.0, 0.0
    end = times[k - 1]
    span = end - time
    for c in range(n):  # a loop: Numba compiles seconds of messages for arrays that are assigned
        out[0, c] = state[c]
    done = 1
    counts[EVALUATIONS] += n + 1
    jacobian(time, state, system, slopes, slope, other)
    # two marches that grow their steps alike must not begin alike: their difference would tell nothing
    step = first_step(span, size, work) * (tolerance / _BROAD) ** 0.125
    step = max(step, 10.0 * _SHORTEST * span)
    goal, dense = max(_NEWTON * tolerance, _ROUNDED), _DENSE * reading
    loose, longer = _allowances(tolerance, dense, s)
    crowded, settled, careful, failures, why, outcome = False, False, True, 0, STUCK, DONE
    while done < k:
        left = (end - time) - late
        free = step * longer if crowded else step  # if only its end counted
        if crowded != (k - done > 1 and _PART * (k - done) * free > (longer - 1.0) * left):
            crowded = not crowded
            step = free / longer if crowded else free
        last = step * 1.0001 >= left
        if last:
            step = left
        elif step < _SHORTEST * span:
            outcome = why
            break
        elif step * 2.0 > left:
            step = 0.5 * left
        if counts[STEPS] >= _MOST_STEPS:
            outcome = ENDLESS
            break
        allowed = min(loose, dense) if crowded else loose
        # the Jacobian is taken where the step is expected to end: a stiff one is needed right there
        guess(s, old, 1.0, step / old_step if old > 0 else 0.0, size, work)
        top = 0.0
        for c in range(n):
            point[c] = state[c] + z[(s - 1) * n + c]
            top = max(top, largest[c], least[c])
        jacobian(time + step if old > 0 else time, point, system, slopes, other, spare)
        counts[EVALUATIONS] += n + 1
        for c in range(n):
            floor = max(_FLOOR * max(largest[c], least[c]), _SMALL * top, 1e-300)
            scale[c] = 1.0 / max(abs(state[c]), abs(point[c]), floor)
        solved, turns, contraction = collocate_any(s, time, step, goal, size, work, system)
        counts[EVALUATIONS] += s * turns
        error, log, factor = 0.0, 0.0, 1.0
        if solved == SOLVED:
            for c in range(n):
                ended = abs(state[c] + z[(s - 1) * n + c])
                floor = max(_FLOOR * max(largest[c], least[c]), _SMALL * top, 1e-300)
                scale[c] = 1.0 / max(abs(state[c]), ended, floor)
            again = allowed if careful else 1e300
            error = local_error(s, time, step, again, size, work, system)
            counts[EVALUATIONS] += 1 if careful else 0
            log = math.log(max(error / allowed, 1e-10)) / (s + 1)
            factor = _SAFE * math.exp(-log)
        if solved != SOLVED or not error < allowed:
            counts[REJECTED] += 1
            if solved == SOLVED:
                factor = max(0.1, min(factor, _SAFE))
            else:
                failures += 1
                factor = 0.25 if solved == NOT_FINITE else 0.5
                if failures > 1 and s > orders[0]:
                    s -= 2
                    since = 0
                    loose, longer = _allowances(tolerance, dense, s)
                if failures > 2:
                    old = 0
            step *= factor
            careful = True
            why = UNDEFINED if solved == NOT_FINITE else STUCK
            continue
        # length of the next step (Gustafsson's prediction), not so long that Newton would labour
        if settled:
            factor = min(factor, factor * (step / old_step) * math.exp(old_log - log))
        factor = min(_GROWTH, max(_DROP, factor))
        if contraction > 0.0:
            factor = min(factor, max(0.5, _WANTED / contraction))
        if careful and settled:
            factor = min(factor, 1.0)
        differences(s, size, work)
        # readings inside the step
        cut = 0.0
        while done < k - 1 and (last or (times[done] - time) - late < step):
            part = (times[done] - time) - late
            if error > dense and part > 0.0:
                turns = part_step(s, time, part, part / step, goal, size, work, system)
                counts[EVALUATIONS] += s * turns
                if turns == 0:
                    cut = part
                    break
            else:
                evaluate(part / step, s, size, polynomial, point, 0)
            for c in range(n):
                out[done, c] = state[c] + (point[c] + carry[c])
                largest[c] = max(largest[c], abs(out[done, c]))
            done += 1
        if cut > 0.0:
            step, old, careful = cut, 0, True
            counts[REJECTED] += 1
            continue
        for c in range(n):
            change = polynomial[c] + carry[c]  # z may be that of a part step
            total = state[c] + change
            carry[c] = change - (total - state[c])
            state[c] = total
            largest[c] = max(largest[c], abs(total))
        change = step + late
        total = time + change
        late = change - (total - time)
        time = total
        counts[STEPS] += 1
        if last:
            for c in range(n):
                out[k - 1, c] = state[c]
            done = k
        derivative(time, state, system, slope)
        counts[EVALUATIONS] += 1
        old, old_step, old_log = s, step, max(log, math.log(1e-2) / (s + 1))
        settled, careful, failures, why = True, False, 0, STUCK
        since += 1
        step *= factor
        if since >= _STAY and contraction < _EASY and s < orders[1]:
            s += 2
            since = 0
            loose, longer = _allowances(tolerance, dense, s)
    return outcome, time
