"""Exponential Picard collocation of pendulums, interval by interval; the equations stand in `propagators.picard`.

Kernels of the remainder are odd in (theta, u, drive) to the last bit.
"""

from typing import NamedTuple

from synth.kernels.collocation import NODES, POINTS, advance, change, couple, last_terms, turned
from synth.kernels.compiled import kernel
from synth.kernels.lanes import load, store, total
from synth.phase import Floats

_MOST_TURNS = 20  # iterations after which an interval counts as too long
_HOPELESS = 1e20  # square of a change of r, rad, from which iteration runs away


class Forcing(NamedTuple):
    """What acts in consecutive intervals."""

    steady: Floats  # (pendulums, intervals, NODES) steady linear answer at the nodes, rad
    vertical: Floats  # (intervals, NODES) zeta,
    horizontal: Floats  # u,
    drive: Floats  # and the part of u that `steady` does not answer
    impulses: Floats
    """(3, pendulums, intervals) at the end of each: what stays of the state, what is added to y and to y'/n."""


class Law(NamedTuple):
    """What pendulums are in intervals of one length: `collocation.Weights`, (pendulums, ...)."""

    flow: Floats
    inner: Floats  # (pendulums, NODES * NODES) of the angle alone
    guess: Floats  # what inner makes of the remainder of the interval before, continued
    end: Floats
    propagator: Floats
    tail: Floats  # (1, 4 * NODES) rows of the Legendre tail
    linear: bool


@kernel
def march(
    state: Floats, remainder: Floats, forcing: Forcing, law: Law, floor: Floats, stop: float, points: Floats,
    report: Floats, room: Floats,
) -> int:  # fmt: skip
    """Carry pendulums through consecutive intervals; how many were done, fewer if iteration does not converge.

    `state` (pendulums, 4), y and y'/n each as leading double and rest, and `remainder` (pendulums, NODES), r in the
    interval before or zero, move on. `floor` (pendulums,) is the square of an angle below which agreement is not asked
    for in relation to y alone; `stop` the change of r, relative, from which an iteration is the last. `points`
    (pendulums, intervals or more, POINTS) receives y at start, nodes and end. `report` (pendulums, 5), raised, never
    reset: squares of the largest last and last but one pair of Legendre coefficients of r, sum of r, and y; iterations.
    `room`: (4, pendulums, NODES).
    """
    flow, inner, guess, end, propagator, tail, linear = law
    steady, vertical, horizontal, drive, impulses = forcing
    pendulums, intervals = steady.shape[0], steady.shape[1]
    base, theta = room[0], room[1]
    known = room[2:]  # r of this turn and of the turn before, in either order
    for p in range(pendulums):  # a loop: Numba compiles seconds of messages for arrays that are assigned
        store(known, (0, p, 0), load(remainder, (p, 0)))
    now, unchecked = 0, 0
    for i in range(intervals):
        for p in range(pendulums):
            own = load(flow, (p, 0)) * state[p, 0] + load(flow, (p, NODES)) * state[p, 2]
            store(base, (p, 0), load(steady, (p, i, 0)) + own)
            couple(guess, 0, known, now, p, base, 0, theta)
        turns = 0
        agree = False
        while not agree:
            if turns == _MOST_TURNS:
                return i
            turns += 1
            now = 1 - now
            for p in range(pendulums):
                remainder_of(linear, theta, vertical, horizontal, drive, p, i, known, now)
            if turns >= unchecked or turns == 2:  # the second tells whether iteration runs away
                agree = True
                for p in range(pendulums):
                    limit = stop * stop * max(report[p, 3], floor[p])
                    step = change(known, p)
                    if step > _HOPELESS:
                        return i
                    agree &= not step > limit
            for p in range(pendulums):
                couple(inner, 0, known, now, p, base, 0, theta)
        unchecked = max(turns - 1, 1)
        for p in range(pendulums):
            report[p, 3] = max(report[p, 3], state[p, 0] * state[p, 0] + state[p, 2] * state[p, 2])
            report[p, 4] += turns
            last, before = last_terms(tail, known, now, p)
            report[p, 0], report[p, 1] = max(report[p, 0], last), max(report[p, 1], before)
            values = load(known, (now, p, 0))
            report[p, 2] += total(values * values)
            points[p, i, 0] = state[p, 0]
        advance(state, propagator, end, known, now)
        for p in range(pendulums):
            store(points, (p, i, 1), load(theta, (p, 0)) - load(steady, (p, i, 0)))
            points[p, i, POINTS - 1] = state[p, 0]
            for k in range(2):
                state[p, 2 * k] = impulses[0, p, i] * state[p, 2 * k] + impulses[1 + k, p, i]
                state[p, 2 * k + 1] *= impulses[0, p, i]
    for p in range(pendulums):
        store(remainder, (p, 0), load(known, (now, p, 0)))
    return int(intervals)


@kernel
def remainder_of(
    linear: bool, theta: Floats, vertical: Floats, horizontal: Floats, drive: Floats, p: int, i: int, known: Floats,
    now: int,
) -> None:  # fmt: skip
    """r = (theta - sin theta) - zeta sin theta + u (1 - cos theta) - drive; linear: r = -zeta theta - drive."""
    angle, heave = load(theta, (p, 0)), load(vertical, (i, 0))
    if linear:
        pull = -(heave * angle)
    else:
        sine, _, short, rise = turned(angle)
        pull = short - heave * sine + load(horizontal, (i, 0)) * rise
    store(known, (now, p, 0), pull - load(drive, (i, 0)))
