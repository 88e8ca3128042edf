"""Radau IIA of order 9 or 13 for stiff systems of a few unknowns, with an honest error.

Motions are integrated in pairs of runs of different tolerance, whose difference tells how good they are. State and time
are sums of two doubles.

A step ends with order 2 s - 1, its polynomial inside with order s only. Local errors are therefore allowed the
power (s + 1)/(2 s) of the tolerance (Hairer and Wanner 1999), and a reading inside a step that has not earned its
tolerance is solved for as a part step, or made the end of a step; where readings are too many, steps are chosen for the
polynomial. Errors of ends add up and those of readings do not: they have tolerances of their own.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from data_schemas.errors import RefusedError
from synth.integrators import radau_step as stepping
from synth.integrators.trajectory import Trajectory, checked, reason, relative_error
from synth.kernels.compiled import kernel
from synth.phase import Floats, Integers
from synth.systems.dispatch import derivative, jacobian

DONE, STUCK, UNDEFINED, ENDLESS = 0, 1, 2, 3
STEPS, EVALUATIONS, REJECTED = 0, 1, 2

_MOST_STEPS = 100_000_000
_SHORTEST = 1e-14  # of the span
_SHARE = 0.1  # of the tolerance's power for local errors
_NEWTON, _LEFT = 0.1, 1e-17  # of the tolerance for what Newton leaves; not less than this of the sizes
_DENSE = 10.0  # error of the end over the largest error of the polynomial inside, at least
_BROAD = 1e-6  # tolerance for which the first step is what it is
_PART = 0.6  # cost of a part step over that of a step
_FLOOR = 1e-2  # of a component's largest size: errors are not asked to be smaller where it passes zero
_SMALL = 1e-10  # of the largest component: smaller ones count as that large
_FIVE, _SEVEN = (0,) * 5, (0,) * 7  # stages, as tuples so long
_ENOUGH = 3e-8  # tolerance above which 7 stages do not pay
_WANTED = 0.1  # contraction that steps should not exceed by their growth
_SAFE, _GROWTH, _DROP = 0.9, 8.0, 0.125

COMPANION = 10.0  # tolerance of the second run over that of the first
NEAR = 30.0  # times looser up to which an earlier run serves as the second one
_COARSEST = 1e-5
_MARGIN = 0.5  # the difference is the error of the looser run
_PARTED = 0.03  # runs that differ by more have parted, and either may be wrong by all of the motion
_ROUNDED = 2.0**-52  # by each step, at random
_TIGHTEST, _LOOSEST = 1e-15, 1e-2
_LOOSE = 1e-7  # of a run: looser saves next to nothing and errs erratically
_USUAL = 30.0  # tolerance over that of a run which meets it in tens of swings, the looser one of its pair included
_FINEST = 1e-18  # tolerance of a run: its steps then err by less than they are rounded
_AGAIN = 2  # times, where the tolerance was missed
_AIM = 0.3  # of the tolerance, then
_FAR = 300.0  # times short of the tolerance from which a run next to the last is no use

_REASONS = {
    STUCK: "the step fell below 1e-14 of the span: Newton's iteration or the error test fails however short it is "
    "(a jump, or a solution that grows without bound)",
    UNDEFINED: "the derivative is not finite there",
    ENDLESS: "more than 1e8 steps: ask for a shorter span or a looser tolerance",
}


def integrate(
    system: Any, start: ArrayLike, times: ArrayLike, *, tolerance: float = 1e-10, stages: int | None = None
) -> Trajectory:
    """States of a stiff system of up to about 12 unknowns at `times`; see `trajectory`.

    Two runs, one at a tolerance ten times looser, are compared: the estimate is half of their difference, and as many
    roundings as the root of the number of steps. Up to two tighter runs follow. Jumps of the derivative cost steps.

    The tolerance is from 1e-15 to 1e-2; that of a yielding support may be the share of the swing of the bobs
    (`swing_of_bobs`). `stages` are 5 or 7, by default as the tolerance asks: changes of order on the way were found to
    gain nothing. Source: Hairer and Wanner (1999), J. Comput. Appl. Math. 111, 93-111.
    """
    first, instants = checked(start, times, tolerance, (_TIGHTEST, _LOOSEST))
    problem = Problem(system, first, instants, swing_of_bobs(system, first), stages)
    local = reading = min(_LOOSE, tolerance / _USUAL)
    best = latest = problem.pair(local, reading)
    evaluations = latest.evaluations
    for _ in range(_AGAIN):
        if latest.missed <= tolerance or local <= _FINEST:
            break
        short = latest.missed / (_AIM * tolerance)
        local = max(_FINEST, local / (short if short > _FAR else min(max(short, COMPANION), NEAR)))
        reading = max(local, reading / COMPANION)  # errors inside steps do not add up
        try:
            latest = problem.pair(local, reading, latest.fine)
        except RefusedError:  # steps too short for this: what there is holds, with the error that is estimated for it
            break
        evaluations += latest.evaluations
        if latest.error < best.error:
            best = latest
    fine = best.fine
    return Trajectory(
        instants, fine.states, best.error, int(fine.counts[STEPS]), evaluations, int(fine.counts[REJECTED])
    )


class Run(NamedTuple):
    """One integration."""

    tolerance: float
    states: Floats  # (k, n) at the instants asked for
    largest: Floats  # (n,) on the way
    counts: Integers  # (3,) see `march`


class Pair(NamedTuple):
    """A run, and how far it is from a looser one."""

    fine: Run
    error: float  # relative to the largest size of each component
    missed: float  # relative to what the steps are measured by, where that is more
    evaluations: int  # what it cost to know both


class Problem(NamedTuple):
    """What to integrate."""

    system: Any
    start: Floats
    times: Floats
    least: Floats
    stages: int | None

    def pair(self, tolerance: float, reading: float, former: Run | None = None) -> Pair:
        """Run at a tolerance, `reading` that of readings, and compare with the former one if that is near enough."""
        count = _FIVE if (self.stages or (5 if tolerance > _ENOUGH else 7)) == 5 else _SEVEN
        fine = self.run(tolerance, reading, count)
        evaluations = int(fine.counts[EVALUATIONS])
        if former is None or former.tolerance > 1.01 * NEAR * tolerance:
            loose = min(_COARSEST, COMPANION * tolerance)
            former = self.run(loose, COMPANION * reading, count)
            evaluations += int(former.counts[EVALUATIONS])
        difference = np.abs(fine.states - former.states).max(axis=0)
        rounding = _ROUNDED * math.sqrt(1.0 + fine.counts[STEPS])
        apart = relative_error(difference, fine.largest)
        error = (_MARGIN * apart if apart < _PARTED else 1.0 + apart) + rounding
        missed = _MARGIN * relative_error(difference, np.maximum(fine.largest, self.least))
        return Pair(fine, error, missed, evaluations)

    def run(self, tolerance: float, reading: float, count: tuple[int, ...]) -> Run:
        """Integrate once; RefusedError where it comes to a stop."""
        arrays, states = stepping.space(self.start), np.empty((self.times.size, self.start.size))
        counts = np.zeros(3, dtype=np.int64)
        outcome, time = march(
            self.system, arrays, self.times, self.least, (tolerance, reading), count, (0,) * self.start.size,
            states, counts,
        )  # fmt: skip
        if outcome != DONE:
            why = reason(self.system, arrays.state, _REASONS[outcome])
            raise RefusedError(f"radau: stopped at t = {time:.6g} s after {counts[STEPS]} steps: {why}")
        return Run(tolerance, states, arrays.largest, counts)


def swing_of_bobs(system: Any, start: Floats) -> Floats:
    """What counts as small, (n,): of a yielding support, displacement and speed of the bobs; of all else nothing.

    Relative to its own size, the ringing of a stiff support would take a thousand times the steps of the swing.
    """
    least = np.zeros(start.size)
    first, length = getattr(system, "first_angle", 0), getattr(system, "length", None)
    if first == 2 and length is not None:
        own = np.sqrt(system.gravity / length)
        swing = length * np.hypot(start[first::2], start[first + 1 :: 2] / own)
        least[0], least[1] = swing.max(), (swing * own).max()
    return least


@kernel
def _allowances(tolerance: float, dense: float, s: int) -> tuple[float, float]:
    """Local error allowed where only ends of steps count; how much longer steps are then than those for readings."""
    loose = max(_SHARE * tolerance ** (0.5 * (s + 1) / s), _DENSE * tolerance)
    return loose, max(1.0, (loose / dense) ** (1.0 / (s + 1)))


@kernel
def march(
    system: Any, arrays: stepping.Space, times: Any, least: Any, tolerances: tuple[float, float],
    count: Any, size: Any, out: Any, counts: Any,
) -> tuple[int, float]:  # fmt: skip
    """Integrate over increasing `times` (k,) and fill `out` (k, n); DONE or why not, and how far it came, s.

    State and largest sizes in `arrays` move on. `least` (n,) is what counts as small; `tolerances` those of ends of
    steps, and of readings inside; `count` and `size` tuples as long as there are stages and unknowns; `counts` (3,)
    receives steps, evaluations, rejected steps.
    """
    n, s, k, work = len(size), len(count), times.size, stepping.addresses(arrays)
    state, slope, slopes = arrays.state, arrays.slope, arrays.slopes
    point, other, spare = arrays.point, arrays.other, arrays.spare
    largest, carry, scale, z, polynomial = work.largest, work.carry, work.scale, work.z, work.polynomial
    tolerance, reading = tolerances
    time, late = times[0], 0.0  # the time is their sum
    known, old_step, old_log = False, 1.0, 0.0  # whether there is a polynomial of the step before
    end = times[k - 1]
    span = end - time
    for c in range(n):  # a loop: Numba compiles seconds of messages for arrays that are assigned
        out[0, c] = state[c]
    done = 1
    counts[EVALUATIONS] += n + 1
    jacobian(time, state, system, slopes, slope, other)
    # two marches that grow their steps alike must not begin alike: their difference would tell nothing
    step = stepping.first_step(span, size, work) * (tolerance / _BROAD) ** 0.125
    step = max(step, 10.0 * _SHORTEST * span)
    goal, dense = max(_NEWTON * tolerance, _LEFT), _DENSE * reading
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
        stepping.guess(known, 1.0, step / old_step, count, size, work)
        top = 0.0
        for c in range(n):
            point[c] = state[c] + z[(s - 1) * n + c]
            top = max(top, largest[c], least[c])
        jacobian(time + step if known else time, point, system, slopes, other, spare)
        counts[EVALUATIONS] += n + 1
        for c in range(n):
            floor = max(_FLOOR * max(largest[c], least[c]), _SMALL * top, 1e-300)
            scale[c] = 1.0 / max(abs(state[c]), abs(point[c]), floor)
        solved, turns, contraction = stepping.collocate(time, step, goal, count, size, work, system)
        counts[EVALUATIONS] += s * turns
        error, log, factor = 0.0, 0.0, 1.0
        if solved == stepping.SOLVED:
            for c in range(n):
                ended = abs(state[c] + z[(s - 1) * n + c])
                floor = max(_FLOOR * max(largest[c], least[c]), _SMALL * top, 1e-300)
                scale[c] = 1.0 / max(abs(state[c]), ended, floor)
            again = allowed if careful else 1e300
            error = stepping.local_error(time, step, again, count, size, work, system)
            counts[EVALUATIONS] += 1 if careful else 0
            log = math.log(max(error / allowed, 1e-10)) / (s + 1)
            factor = _SAFE * math.exp(-log)
        if solved != stepping.SOLVED or not error < allowed:
            counts[REJECTED] += 1
            if solved == stepping.SOLVED:
                factor = max(0.1, min(factor, _SAFE))
            else:
                failures += 1
                factor = 0.25 if solved == stepping.NOT_FINITE else 0.5
                known &= failures <= 2
            step *= factor
            careful = True
            why = UNDEFINED if solved == stepping.NOT_FINITE else STUCK
            continue
        # length of the next step (Gustafsson's prediction), not so long that Newton would labour
        if settled:
            factor = min(factor, factor * (step / old_step) * math.exp(old_log - log))
        factor = min(_GROWTH, max(_DROP, factor))
        if contraction > 0.0:
            factor = min(factor, max(0.5, _WANTED / contraction))
        if careful and settled:
            factor = min(factor, 1.0)
        stepping.differences(count, size, work)
        # readings inside the step
        cut = 0.0
        while done < k - 1 and (last or (times[done] - time) - late < step):
            part = (times[done] - time) - late
            if error > dense and part > 0.0:
                turns = stepping.part_step(time, part, part / step, goal, count, size, work, system)
                counts[EVALUATIONS] += s * turns
                if turns == 0:
                    cut = part
                    break
            else:
                stepping.evaluate(part / step, count, size, polynomial, point, 0)
            for c in range(n):
                out[done, c] = state[c] + (point[c] + carry[c])
                largest[c] = max(largest[c], abs(out[done, c]))
            done += 1
        if cut > 0.0:
            step, known, careful = cut, False, True
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
        known, old_step, old_log = True, step, max(log, math.log(1e-2) / (s + 1))
        settled, careful, failures, why = True, False, 0, STUCK
        step *= factor
    return outcome, time
