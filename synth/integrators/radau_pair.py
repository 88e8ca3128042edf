"""Pairs of marches of Radau IIA: how far two of different tolerance are apart tells how good they are."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from data_schemas.errors import RefusedError
from synth.integrators.radau_march import (
    DONE,
    ENDLESS,
    EVALUATIONS,
    LOOSE,
    STEPS,
    STUCK,
    UNDEFINED,
    march,
    room,
    state_in,
)
from synth.integrators.trajectory import relative_error
from synth.phase import Floats, Integers

COMPANION = 10.0
"""Tolerance of the second march over that of the first."""
NEAR = 30.0
"""Times looser up to which an earlier march serves as the second one."""
_COARSEST = 1e-5
_MARGIN = 0.5  # the difference is the error of the looser march
_PARTED = 0.03  # marches that differ by more have parted, and either may be wrong by all of the motion
_ROUNDED = 2.0**-52  # by each step, at random

_REASONS = {
    STUCK: "the step fell below 1e-14 of the span: Newton's iteration or the error test fails however short it is "
    "(a jump, or a solution that grows without bound)",
    UNDEFINED: "the derivative is not finite there",
    ENDLESS: "more than 1e8 steps: ask for a shorter span or a looser tolerance",
}


class Run(NamedTuple):
    """One march."""

    tolerance: float
    orders: tuple[int, int]
    """Fewest and most stages."""
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

    def begun(self, start: Floats, times: Floats) -> Problem:
        """The same from another state and at other times."""
        return self._replace(start=start, times=times)

    def run(self, tolerance: float, reading: float, orders: tuple[int, int]) -> Run:
        """March once; RefusedError where it comes to a stop."""
        n = self.start.size
        space, places = np.zeros(room(n)), np.zeros(14 * n, dtype=np.int64)
        states, largest, counts = np.empty((self.times.size, n)), np.zeros(n), np.zeros(3, dtype=np.int64)
        state = state_in(space, n)
        state[:] = self.start
        outcome, time = march(
            self.times, tolerance, reading, orders, (0,) * n, self.system, self.least,
            space, places, states, largest, counts,
        )  # fmt: skip
        if outcome != DONE:
            difficulty = getattr(self.system, "difficulty", None)
            reason = (difficulty(state) if difficulty else None) or _REASONS[outcome]
            raise RefusedError(f"radau: stopped at t = {time:.6g} s after {counts[STEPS]} steps: {reason}")
        return Run(tolerance, orders, states, largest, counts)


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
