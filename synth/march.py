"""Evaluating a plan: angles, free harmonics and acceleration at every reading."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from data_schemas.errors import SceneError
from synth.phase import Floats, Phasors
from synth.plan import Plan
from synth.recording.clock import Clock

CLOSED_FORM_ERROR = 1e-15
WORST_ERROR = 1e-6
"""Of the largest angle: what is estimated to be worse is no truth, and the scene is refused."""


@dataclass(frozen=True)
class Course:
    """What happened.

    Attributes
    ----------
    theta : (pendulums, readings) float64
        Angles, rad.
    free : (pendulums, readings) complex128 or None
        Free harmonics Z, near-resonant beats included, rad; None for the sine law, which does not superpose.
    slow : (pendulums, readings) float64 or None
        For the sine law: what linear pendulums would answer to the support away from their own frequency, rad.
    horizontal_acceleration, vertical_acceleration : (readings,) float64
        m/s^2
    estimated_error : float
        Of theta, relative to the largest angle.
    """

    theta: Floats
    free: Phasors | None
    slow: Floats | None
    horizontal_acceleration: Floats
    vertical_acceleration: Floats
    estimated_error: float


def march(plan: Plan, clock: Clock) -> Course:
    """Evaluate a plan at the clock's moments.

    Raises
    ------
    SceneError
        If the motion is so violent that its course cannot be told.
    """
    w, times, kept = plan.motion.angular_frequency, plan.times, clock.kept
    moved = (
        times.series(w, plan.motion.acceleration[None, :])[0, kept],
        times.series(plan.vertical.angular_frequency, plan.vertical.acceleration[None, :])[0, kept],
    )
    if plan.propagator == "closed form":
        free = np.array([times.free_harmonic(response, w)[kept] for response in plan.responses])
        return Course(times.elongation(plan.responses, w)[:, kept], free, None, *moved, CLOSED_FORM_ERROR)
    from synth.propagators.picard import PicardPlan, start_state  # only here: it brings numba

    theta, error = PicardPlan(
        np.array([response.frequency for response in plan.responses]),
        np.array([response.damping_rate for response in plan.responses]),
        np.array([start_state(response, w) for response in plan.responses]),
        plan.motion,
        plan.vertical,
        plan.gravity,
        times,
    ).elongation()
    if not error < WORST_ERROR:
        raise SceneError(
            f"pendulums: the motion is chaotic or nearly so, its estimated error is {error:.1g} of the angle; "
            "make the swing or the acceleration smaller, or the duration shorter"
        )
    slow = times.series(w, np.array([response.forced for response in plan.responses]))[:, kept]
    return Course(theta[:, kept], None, slow, *moved, error)
