"""Evaluating a plan: angles, free harmonics and acceleration at every reading, portion by portion."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from data_schemas.errors import RefusedError, SceneError
from synth.choice import NAMES
from synth.pendulums.linear import start_state
from synth.phase import Floats, Phasors
from synth.plan import Plan
from synth.recording.clock import Clock


def recut(pieces: Iterable[Floats], sizes: Iterable[int]) -> Iterator[Floats]:
    """Cut what comes in pieces anew; no more is held than one portion and one piece.

    `ValueError` if the pieces end too early.

    Parameters
    ----------
    pieces
        (rows, any number of moments) each, in order of time.
    sizes
        Moments of each portion; together no more than the pieces hold.

    Yields
    ------
    (rows, size) float64

    Examples
    --------
    >>> pieces = [np.array([[0.0, 1.0, 2.0]]), np.array([[3.0, 4.0]])]
    >>> [portion.tolist() for portion in recut(pieces, [2, 3])]
    [[[0.0, 1.0]], [[2.0, 3.0, 4.0]]]
    """
    source = iter(pieces)
    held: list[Floats] = []
    have = 0
    for size in sizes:
        while have < size or not held:
            piece = next(source, None)
            if piece is None:
                raise ValueError(f"the motion ends {size - have} moments before the record does")
            held.append(piece)
            have += piece.shape[-1]
        joined = held[0] if len(held) == 1 else np.concatenate(held, axis=-1)
        yield joined[..., :size]
        held, have = [joined[..., size:]], have - size


CLOSED_FORM_ERROR = 1e-15
WORST_ERROR = 1e-6
"""Of the largest angle: what is estimated to be worse is no truth, and the scene is refused."""


@dataclass(frozen=True)
class Course:
    """What happened."""

    theta: Floats
    """(pendulums, readings) angles, rad."""
    free: Phasors | None
    """(pendulums, readings) free harmonics Z, near-resonant beats included, rad; None for the sine law, which does not
    superpose."""
    slow: Floats | None
    """(pendulums, readings) where `free` is None: what linear pendulums would answer to the support away from their own
    frequency, rad; None too on a support that yields or is still."""
    horizontal_acceleration: Floats
    vertical_acceleration: Floats
    """(readings,) m/s^2"""
    estimated_error: float
    """Of theta, relative to the largest angle."""
    propagator: str
    """By what, as the truth calls it."""
    support_displacement: Floats | None = None
    """(readings,) of a support that yields, m."""
    gravity_change: Floats | None = None
    """(readings,) what is added to the scene's gravity, m/s^2."""


Angles = tuple[Floats, float, str]
"""Of all moments of a portion, recorded or not: (pendulums, moments) rad and, on a support that yields, its
displacement in m as the last row; estimated error; propagator."""


def march(plan: Plan, clock: Clock) -> Iterator[tuple[Clock, Course]]:
    """Evaluate a plan at the clock's moments, portion by portion, in order of time.

    A scene always falls into the same portions, so that a record is the same bits in memory and streamed to a file.
    Portions without a reading are left out. The last portion's estimated error holds for all.

    `SceneError` if the motion is so violent that its course cannot be told. `RefusedError` if no propagator can do it;
    the message holds their reasons.
    """
    rows = len(plan.frequencies)
    way = {"closed-form": _closed_form, "picard": _picard}.get(plan.choice.propagator, _integrated)
    streams = [way(each, clock, rows) for each in plan.planes or (plan,)]
    for part, *found in zip(clock.portions(rows), *streams, strict=True):
        every_row, errors, propagators = zip(*found, strict=True)
        error = max(errors)
        if not error <= _worst(plan):
            raise SceneError(
                "pendulums: the motion is chaotic or nearly so, its estimated error is"
                f" {error:.1g} of the angle; make the swing or the acceleration smaller, the duration"
                " shorter, or give simulation.tolerance if that will do"
            )
        if part.count:
            yield part, _course(plan, part, (np.vstack(every_row), error, propagators[0]))


def _worst(plan: Plan) -> float:
    return WORST_ERROR if plan.tolerance is None else max(WORST_ERROR, plan.tolerance)


def _course(plan: Plan, part: Clock, angles: Angles) -> Course:
    """What happened at the readings of a portion, given the angles at all its moments."""
    w, times, kept = plan.motion.angular_frequency, part.times, part.kept
    moved = (
        times.acceleration(plan.motion)[kept],
        times.acceleration(plan.vertical)[kept],
    )
    count = len(plan.frequencies)
    every_row, error, propagator = angles
    theta = every_row[:count, kept]
    yielded = every_row[count, kept] if len(every_row) > count else None
    for place, begin, end, angle in plan.held:
        theta[place, (part.true_seconds >= begin) & (part.true_seconds < end)] = angle
    change = plan.gravity_change
    changed = None if change is None else times.acceleration(change)[kept]
    free = slow = None
    each_plan = plan.planes or (plan,)
    if plan.choice.propagator == "closed-form":
        free = np.array(
            [
                times.free_harmonic(response, each.motion.angular_frequency)[kept]
                for each in each_plan
                for response in each.responses
            ]
        )
    elif plan.responses and (w.size or not plan.choice.integrates):
        slow = np.vstack([times.slow(each.responses, each.motion.angular_frequency) for each in each_plan])[:, kept]
    return Course(theta, free, slow, *moved, error, propagator, yielded, changed)


def _closed_form(plan: Plan, clock: Clock, rows: int) -> Iterator[Angles]:
    for part in clock.portions(rows):
        theta = part.times.elongation(plan.responses, plan.motion.angular_frequency)
        yield theta, CLOSED_FORM_ERROR, plan.propagator


def _picard(plan: Plan, clock: Clock, rows: int) -> Iterator[Angles]:
    """By collocation; from where it refuses or errs too much, by those who may stand in for it."""
    from synth.propagators.picard import PicardPlan  # only here: it brings numba

    worst = 0.0

    def pieces() -> Iterator[Floats]:
        nonlocal worst
        for swing in collocation.stream():  # readings of a clock are in order of time, none before the start
            worst = max(worst, swing.estimated_error)
            yield swing.theta

    collocation = PicardPlan(
        np.array([response.frequency for response in plan.responses]),
        np.array([response.damping_rate for response in plan.responses]),
        np.array([start_state(response, plan.motion.angular_frequency) for response in plan.responses]),
        plan.motion,
        plan.lift,
        plan.gravity,
        plan.times,
        plan.linear,
        plan.kicks,
    )
    done = 0
    sizes = (part.times.count for part in clock.portions(rows))
    try:
        for portion in recut(pieces(), sizes):
            if not worst <= _worst(plan) and plan.choice.instead:
                break
            yield portion, worst, plan.propagator
            done += 1
        else:
            return
    except RefusedError:
        if not plan.choice.instead:
            raise
    yield from itertools.islice(_integrated(plan, clock, rows), done, None)


def _integrated(plan: Plan, clock: Clock, rows: int) -> Iterator[Angles]:
    """By a general integrator."""
    from synth.assembly import integrated  # only here: it brings numba

    choice = plan.choice
    able = [choice.propagator, *choice.instead] if choice.integrates else choice.instead
    parts = list(Clock(clock.times, slice(None), clock.scale).portions(rows))
    seconds = np.concatenate([part.true_seconds for part in parts])
    asked = choice.aim if plan.tolerance is None else plan.tolerance
    found, error, name = integrated(plan.assembly(), able, seconds, asked)
    for portion in recut([found], (part.count for part in parts)):
        yield portion, error, NAMES[name]
