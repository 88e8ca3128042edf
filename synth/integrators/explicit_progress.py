"""All that a march of the explicit integrator has in hand, so that it can be halted and taken up again."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from synth.phase import Floats, Integers

TIME, TIME_LOW, STEP, PROPOSED, ERROR, SHARE = range(6)
STEPS, REJECTED, EVALUATIONS, STIFF, CALM, READY, FINAL, WRITTEN, KICKS, HALTED = range(10)
_NOT_YET = 2.0
_AVERAGE = 1e-4


class Progress(NamedTuple):
    """For a state of n components: arrays (n,) where not said otherwise; changed in place."""

    state: Floats
    """At the start of the step in hand, as the sum of two doubles,"""
    low: Floats
    following: Floats
    """and at its end,"""
    left_over: Floats
    increment: Floats
    scale: Floats
    """Largest size of each component so far."""
    expected: Floats
    """What each will grow to at least, seen from the start."""
    allowed: Floats
    """Error allowed to each in a step."""
    slope: Floats
    """At the end of the step."""
    point: Floats
    """Working space."""
    spare: Floats
    k: Floats
    """(16, n) slopes of the stages."""
    polynomial: Floats
    """(7, n) dense output of the step."""
    clock: Floats
    """(6,) start of the step as a sum of two doubles, its length, length of the next, error of the last, share of a
    crossing in it."""
    counts: Integers
    """(10,) steps, rejected, evaluations; steps at the edge of stability and since; whether the polynomial is made;
    whether the step ends the march; outputs of the last call; impulses so far, and whether the step ends at the next."""


def begin_at(start: Floats, time: float) -> Progress:
    """Progress before the first step, of no length, which ends at `start`."""
    n = start.size
    return Progress(
        state=start.copy(),
        low=np.zeros(n),
        following=start.copy(),
        left_over=np.zeros(n),
        increment=np.zeros(n),
        scale=np.zeros(n),
        expected=np.zeros(n),
        allowed=np.zeros(n),
        slope=np.zeros(n),
        point=np.zeros(n),
        spare=np.zeros(n),
        k=np.zeros((16, n)),
        polynomial=np.zeros((7, n)),
        clock=np.array([time, 0.0, 0.0, 0.0, _AVERAGE, _NOT_YET]),
        counts=np.array([0, 0, 0, 0, 0, 1, 0, 0, 0, 0]),
    )
