"""Radau IIA of variable order (5, 9, 13) for stiff systems of a few unknowns, with an honest error.

Motions are marched in pairs: how far two of different tolerance are apart tells how good they are.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from data_schemas.errors import RefusedError
from synth.integrators import radau_march as marching
from synth.integrators.radau_march import EVALUATIONS, LOOSE, STEPS
from synth.integrators.radau_step import space
from synth.integrators.trajectory import Trajectory, checked, reason, relative_error
from synth.phase import Floats, Integers

COMPANION = 10.0
"""Tolerance of the second march over that of the first."""
NEAR = 30.0
"""Times looser up to which an earlier march serves as the second one."""
_COARSEST = 1e-5
_MARGIN = 0.5  # the difference is the error of the looser march
_PARTED = 0.03  # marches that differ by more have parted, and either may be wrong by all of the motion
_ROUNDED = 2.0**-52  # by each step, at random
_TIGHTEST, _LOOSEST = 1e-15, 1e-2
_LOOSE = 1e-7  # of a march: looser saves next to nothing and errs erratically
_USUAL = 30.0  # tolerance over that of a march which meets it in tens of swings, the looser one of its pair included
_FINEST = 1e-18  # tolerance of a march: its steps then err by less than they are rounded
_AGAIN = 2  # times, where the tolerance was missed
_AIM = 0.3  # of the tolerance, then
_FAR = 300.0  # times short of the tolerance from which a march next to the last is no use

_REASONS = {
    marching.STUCK: "the step fell below 1e-14 of the span: Newton's iteration or the error test fails however short it is "
    "(a jump, or a solution that grows without bound)",
    marching.UNDEFINED: "the derivative is not finite there",
    marching.ENDLESS: "more than 1e8 steps: ask for a shorter span or a looser tolerance",
}


def integrate(
    system: Any, start: ArrayLike, times: ArrayLike, *, tolerance: float = 1e-10, stages: tuple[int, int] | None = None
) -> Trajectory:
    """States of a stiff system of up to about 12 unknowns at `times`; see `trajectory`.

    Two marches, one at a tolerance ten times looser, are compared. The estimate is half of their difference, which is
    the error of the looser one, and as many roundings as the root of the number of steps. Steps are held to a tolerance
    one by one: where the estimate shows that errors have added up to more than was asked for, tighter marches
    follow, twice at most. What is left then, of rounding above all, the estimate tells.

    Parameters
    ----------
    tolerance : float
        Error wanted anywhere, relative to the largest size of each component, from 1e-15 to 1e-2. That of a yielding
        support may be the share of the swing of the bobs (`swing_of_bobs`); the estimate is relative to its own.
    stages : tuple, optional
        Fewest and most stages (3, 5 or 7); by default chosen from 3 up to what the tolerance is worth.

    Notes
    -----
    Hairer and Wanner (1999), J. Comput. Appl. Math. 111, 93-111. Jumps of the derivative are integrated over at the
    cost of short steps, not located.

    Examples
    --------
    >>> from synth.systems.resistance import VanDerPol
    >>> fast = integrate(VanDerPol(1000.0), [2.0, 0.0], [0.0, 1.0], tolerance=1e-9)
    >>> round(float(fast.states[1, 0]), 9)
    1.999333371
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
        instants, fine.states, best.error, int(fine.counts[STEPS]), evaluations, int(fine.counts[marching.REJECTED])
    )


class Run(NamedTuple):
    """One march."""

    tolerance: float
    states: Floats
    """(k, n) at the instants asked for."""
    largest: Floats
    """(n,) on the way."""
    counts: Integers
    """(3,) see `radau_march.march`."""


class Pair(NamedTuple):
    """A march, and how far it is from a looser one."""

    fine: Run
    error: float
    """Relative to the largest size of each component."""
    missed: float
    """Relative to what the steps are measured by, where that is more."""
    evaluations: int
    """What it cost to know both."""


class Problem(NamedTuple):
    """What to march."""

    system: Any
    start: Floats
    times: Floats
    least: Floats
    stages: tuple[int, int] | None

    def pair(self, tolerance: float, reading: float, former: Run | None = None) -> Pair:
        """March at a tolerance, `reading` that of readings, and compare with the former one if that is near enough."""
        orders = self.stages or (3, 5 if tolerance > LOOSE else 7)
        fine = self.run(tolerance, reading, orders)
        evaluations = int(fine.counts[EVALUATIONS])
        if former is None or former.tolerance > 1.01 * NEAR * tolerance:
            loose = min(_COARSEST, COMPANION * tolerance)
            former = self.run(loose, COMPANION * reading, orders)
            evaluations += int(former.counts[EVALUATIONS])
        difference = np.abs(fine.states - former.states).max(axis=0)
        rounding = _ROUNDED * math.sqrt(1.0 + fine.counts[STEPS])
        apart = relative_error(difference, fine.largest)
        error = (_MARGIN * apart if apart < _PARTED else 1.0 + apart) + rounding
        missed = _MARGIN * relative_error(difference, np.maximum(fine.largest, self.least))
        return Pair(fine, error, missed, evaluations)

    def run(self, tolerance: float, reading: float, orders: tuple[int, int]) -> Run:
        """March once; RefusedError where it comes to a stop."""
        arrays, states = space(self.start), np.empty((self.times.size, self.start.size))
        counts = np.zeros(3, dtype=np.int64)
        outcome, time = marching.march(
            self.system, arrays, self.times, self.least, (tolerance, reading), orders, (0,) * self.start.size,
            states, counts,
        )  # fmt: skip
        if outcome != marching.DONE:
            why = reason(self.system, arrays.state, _REASONS[outcome])
            raise RefusedError(f"radau: stopped at t = {time:.6g} s after {counts[STEPS]} steps: {why}")
        return Run(tolerance, states, arrays.largest, counts)


def swing_of_bobs(system: Any, start: Floats) -> Floats:
    """What counts as small, (n,): of a yielding support, displacement and speed of the bobs; of all else nothing.

    Angles cannot feel a displacement of their support that is small against l theta. Were it followed relative to its
    own size, the ringing of a stiff support by a millionth of l would take a thousand times the steps of the swing.
    """
    least = np.zeros(start.size)
    first, length = getattr(system, "first_angle", 0), getattr(system, "length", None)
    if first == 2 and length is not None:
        own = np.sqrt(system.gravity / length)
        swing = length * np.hypot(start[first::2], start[first + 1 :: 2] / own)
        least[0], least[1] = swing.max(), (swing * own).max()
    return least
