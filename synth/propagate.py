"""Evaluating a plan: angles, free harmonics and acceleration at every sample, in chunks for files to be written."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from data_schemas.errors import RefusedError, SceneError
from synth.choice import NAMES
from synth.kicks import held
from synth.motion.harmonic_sum import Sums
from synth.pendulums.linear import start_state
from synth.phase import Floats, Phasors
from synth.plan import Plan
from synth.recording.clock import Clock

CLOSED_FORM_ERROR = 1e-15
WORST_ERROR = 1e-6  # Of the largest angle: what is estimated to be worse is no truth, and the scene is refused


class SampledMotion(NamedTuple):
    """What happened, at samples."""

    theta: Floats  # (pendulums, samples) angles, rad
    free: Phasors | None
    """(pendulums, samples) free harmonics Z, near-resonant beats included, rad; None for the sine law, which does not
    superpose."""
    slow: Floats | None
    """(pendulums, samples) where `free` is None: what linear pendulums would answer to the support away from their own
    frequency, rad; None too on a support that yields or is still."""
    horizontal_acceleration: Floats
    vertical_acceleration: Floats  # (samples,) m/s^2
    estimated_error: float  # Of theta, relative to the largest angle
    propagator: str  # By what, as the truth calls it
    support_displacement: Floats | None  # (samples,) of a support that yields, m
    gravity_change: Floats | None  # (samples,) what is added to the scene's gravity, m/s^2


def propagate(plan: Plan, clock: Clock) -> Iterator[tuple[Clock, SampledMotion]]:
    """Evaluate a plan at the clock's moments, chunk by chunk, in order of time.

    A scene always falls into the same chunks, so that a record is the same bits in memory and streamed to a file.
    Chunks without a sample are left out.

    `SceneError` if the motion is so violent that it cannot be known. `RefusedError` if no propagator can do it; the
    message holds their reasons.
    """
    planes, count = plan.planes or (plan,), len(plan.frequencies)
    in_closed_form = plan.choice.propagator == "closed-form"
    whole = [] if in_closed_form else [_angles(each, clock) for each in planes]
    error = max((each[1] for each in whole), default=CLOSED_FORM_ERROR)
    propagator = whole[0][2] if whole else plan.propagator
    if not error <= _worst(plan):
        raise SceneError(
            "pendulums: the motion is chaotic or nearly so, its estimated error is"
            f" {error:.1g} of the angle; make the swing or the acceleration smaller, the duration"
            " shorter, or give simulation.tolerance if that will do"
        )
    answers_slowly = bool(plan.responses) and bool(plan.motion.angular_frequency.size or not plan.choice.integrates)
    forced = [_forced(each) for each in planes] if answers_slowly else []
    done = 0
    for part in clock.chunks():
        here, times, kept = slice(done, done + part.times.count), part.times, part.kept
        done = here.stop
        if not part.count:
            continue
        free = slow = None
        if in_closed_form:
            rows = np.vstack([times.elongation(each.responses) for each in planes])
            free = np.array([times.free_harmonic(one)[kept] for each in planes for one in each.responses])
        else:
            rows = np.vstack([angles[:, here] for angles, _, _ in whole])
            slow = np.vstack([times.values(each) for each in forced])[:, kept] if answers_slowly else None
        theta = rows[:count, kept]
        for place, begin, end, angle in held(plan.scene, plan.kicks):
            theta[place, (part.true_seconds >= begin) & (part.true_seconds < end)] = angle
        yield (
            part,
            SampledMotion(
                theta,
                free,
                slow,
                times.acceleration(plan.motion)[kept],
                times.acceleration(plan.vertical)[kept],
                error,
                propagator,
                rows[count, kept] if len(rows) > count else None,
                None if plan.gravity_change is None else times.acceleration(plan.gravity_change)[kept],
            ),
        )


def _forced(plan: Plan) -> Sums:
    """Steady answers of the pendulums to the harmonics away from n, rad."""
    return Sums(plan.motion.angular_frequency, np.array([each.forced for each in plan.responses]), plan.motion.combs)


def _worst(plan: Plan) -> float:
    return WORST_ERROR if plan.tolerance is None else max(WORST_ERROR, plan.tolerance)


def _angles(plan: Plan, clock: Clock) -> tuple[Floats, float, str]:
    """At all moments of a clock, recorded or not, by collocation or a general integrator; where the first refuses or
    errs too much, by its substitutes.

    Returned are (pendulums, moments) rad, with the displacement of a support that yields, m, as the last row; the
    estimated error of the largest angle; the propagator.
    """
    choice = plan.choice
    if choice.propagator == "picard":
        try:
            theta, error = _collocated(plan)
        except RefusedError:
            if not choice.instead:
                raise
        else:
            if error <= _worst(plan) or not choice.instead:
                return theta, error, plan.propagator
    from synth.assembly import integrated  # only here: it brings numba

    able = [choice.propagator, *choice.instead] if choice.integrates else choice.instead
    seconds = Clock(clock.times, slice(None), clock.scale).true_seconds
    asked = choice.aim if plan.tolerance is None else plan.tolerance
    rows, error, name = integrated(plan.assembly(), able, seconds, asked)
    return rows, error, NAMES[name]


def _collocated(plan: Plan) -> tuple[Floats, float]:
    """Angles, (pendulums, moments) rad, and their estimated error."""
    from synth.propagators.picard import PicardPlan  # only here: it brings numba

    return PicardPlan(
        np.array([response.frequency for response in plan.responses]),
        np.array([response.damping_rate for response in plan.responses]),
        np.array([start_state(response) for response in plan.responses]),
        plan.motion,
        plan.lift,
        plan.gravity,
        plan.times,
        plan.scene.restoring == "linear",
        plan.kicks,
    ).elongation()  # samples of a clock are in order of time, none before the start
